"""Contacts of rover and obstacles, as PyBullet found them, by obstacle id."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.obstacle_bodies import ObstacleBodies
from rover_sim.sim.vehicle_state import BodyContact
from rover_sim.sim.world import RoverBody
from worlds.types import BoolArray, FloatArray, Vector3

# Places in a contact point of getContactPoints(bodyA=rover).
_LINK, _POINT, _NORMAL_TO_ROVER, _DISTANCE, _FORCE = 3, 5, 7, 8, 9

_STEEP = 0.5  # level part of a contact normal: the face is steeper than 30 degrees
_OPPOSITE = -0.5  # cosine between two such directions: at least 120 degrees apart


class ContactReader:
    """Reads the contacts of each step; keeps the hardest hull contact (arms included) of each obstacle until taken."""

    def __init__(self, client: int, rover: RoverBody, obstacles: ObstacleBodies) -> None:
        self._client, self._rover = client, rover
        self._any = obstacles.any
        self.obstacles = obstacles.index
        self._wheel_place = {link: place for place, link in enumerate(rover.wheels)}
        self._before: list[float] = [0.0] * 13  # position, attitude, velocity and rate
        self._now: list[tuple[Any, ...]] = []
        self._kept: dict[int, BodyContact] = {}
        self._wheel_touched = False
        self.body: tuple[BodyContact, ...] = ()

    def before_step(self, raw: FloatArray) -> None:
        """Remember the motion (13,) with which obstacles will be met."""
        if self._any:
            self._before = raw[:13].tolist()

    def after_step(self, time_s: float) -> None:
        """Read the contacts of the step that ended at ``time_s``."""
        if not self._any:
            return
        found = pybullet.getContactPoints(bodyA=self._rover.body, physicsClientId=self._client)
        self._now = [point for point in found if point[_FORCE] > 0.0] if found else []
        hull = [point for point in self._now if point[_LINK] not in self._wheel_place]
        self._wheel_touched = self._wheel_touched or len(hull) < len(self._now)
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

    def take_wheel_touch(self) -> bool:
        """Whether a wheel has touched an obstacle since the last call."""
        touched, self._wheel_touched = self._wheel_touched, False
        return touched

    def wheel_loads(self) -> FloatArray:
        """Normal force (n,) of rocks on each wheel."""
        loads = np.zeros(len(self._wheel_place))
        for point in self._now:
            if point[_LINK] in self._wheel_place:
                loads[self._wheel_place[point[_LINK]]] += point[_FORCE]
        return loads

    def wheel_ids(self) -> tuple[int, ...]:
        """Obstacles that wheels touch."""
        touched = {self.obstacles.nearest(point[_POINT]) for point in self._now if point[_LINK] in self._wheel_place}
        return tuple(sorted(touched))

    def wedged(self) -> BoolArray:
        """Which wheels (n,) are pressed from two sides, by obstacles whose level directions are far apart."""
        wheels = np.zeros(len(self._wheel_place), dtype=np.bool_)
        for place, points in self._by_wheel().items():
            level = [np.hypot(normal[0], normal[1]) for normal in points]
            wheels[place] = any(
                a[0] * b[0] + a[1] * b[1] < _OPPOSITE * la * lb
                for (a, la), (b, lb) in combinations(zip(points, level, strict=True), 2)
                if min(la, lb) > _STEEP
            )
        return wheels

    def _by_wheel(self) -> dict[int, list[Vector3]]:
        """Contact normals toward the wheel, by the wheel's place."""
        normals: dict[int, list[Vector3]] = {}
        for point in self._now:
            if point[_LINK] in self._wheel_place:
                normals.setdefault(self._wheel_place[point[_LINK]], []).append(point[_NORMAL_TO_ROVER])
        return normals

    def _body_contact(self, point: tuple[Any, ...], time_s: float) -> BodyContact:
        x, y, z = point[_POINT]
        cx, cy, cz, _, _, _, _, vx, vy, vz, wx, wy, wz = self._before
        dx, dy, dz = x - cx, y - cy, z - cz
        nx, ny, nz = point[_NORMAL_TO_ROVER]
        # Approach of the hull's point, velocity + rate x lever, along the normal.
        away = nx * (vx + wy * dz - wz * dy) + ny * (vy + wz * dx - wx * dz) + nz * (vz + wx * dy - wy * dx)
        return BodyContact(self.obstacles.nearest((x, y, z)), time_s, max(-away, 0.0), point[_FORCE], (x, y, z))
