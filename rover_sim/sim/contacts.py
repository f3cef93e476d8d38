"""Contacts of rover and obstacles, as PyBullet found them, by obstacle id."""

from __future__ import annotations

from typing import Any

import numpy as np

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.obstacle_index import ObstacleIndex
from rover_sim.sim.vehicle_state import BodyContact
from rover_sim.sim.world import CHASSIS, RoverBody
from worlds.types import FloatArray, World

# Places in a contact point of getContactPoints(bodyA=rover).
_LINK, _POINT, _NORMAL_TO_ROVER, _DISTANCE, _FORCE = 3, 5, 7, 8, 9


class ContactReader:
    """Reads the contacts of each step; keeps the hardest hull contact of each obstacle until it is taken."""

    def __init__(self, client: int, rover: RoverBody, world: World, obstacles: tuple[int, ...]) -> None:
        self._client, self._rover = client, rover
        self._any = bool(obstacles)
        self._index = ObstacleIndex(world.collision_mesh)
        self._wheel_place = {link: place for place, link in enumerate(rover.wheels)}
        self._before: FloatArray = np.zeros(13)
        self._now: list[tuple[Any, ...]] = []
        self._kept: dict[int, BodyContact] = {}
        self.body: tuple[BodyContact, ...] = ()

    def before_step(self, raw: FloatArray) -> None:
        """Remember the motion (13,) with which obstacles will be met."""
        if self._any:
            self._before[:] = raw[:13]

    def after_step(self, time_s: float) -> None:
        """Read the contacts of the step that ended at ``time_s``."""
        if not self._any:
            return
        found = pybullet.getContactPoints(bodyA=self._rover.body, physicsClientId=self._client)
        self._now = [point for point in found if point[_FORCE] > 0.0] if found else []
        hull = [point for point in self._now if point[_LINK] == CHASSIS]
        self.body = tuple(self._body_contact(point, time_s) for point in hull)
        for contact in self.body:
            known = self._kept.get(contact.obstacle_id)
            if known is None or contact.impact_speed_m_s > known.impact_speed_m_s:
                self._kept[contact.obstacle_id] = contact

    def take(self) -> tuple[BodyContact, ...]:
        """Hull contacts since the last call."""
        taken = tuple(self._kept.values())
        self._kept.clear()
        return taken

    def wheel_loads(self) -> FloatArray:
        """Normal force (n,) of rocks on each wheel."""
        loads = np.zeros(len(self._wheel_place))
        for point in self._now:
            if point[_LINK] in self._wheel_place:
                loads[self._wheel_place[point[_LINK]]] += point[_FORCE]
        return loads

    def wheel_ids(self) -> tuple[int, ...]:
        """Obstacles that wheels touch."""
        touched = {self._index.nearest(point[_POINT]) for point in self._now if point[_LINK] in self._wheel_place}
        return tuple(sorted(touched))

    def _body_contact(self, point: tuple[Any, ...], time_s: float) -> BodyContact:
        position = np.array(point[_POINT])
        velocity = self._before[7:10] + np.cross(self._before[10:13], position - self._before[:3])
        speed = max(-float(velocity @ np.array(point[_NORMAL_TO_ROVER])), 0.0)
        where = (float(position[0]), float(position[1]), float(position[2]))
        return BodyContact(self._index.nearest(where), time_s, speed, float(point[_FORCE]), where)
