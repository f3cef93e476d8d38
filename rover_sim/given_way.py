"""The planner's side of the link where the way is given: one mission, uploaded once and driven to its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.navigator_state import Decision
from planner.terrain_map import RockMemory, empty_memory
from rover_sim.autopilot.modes import MissionState, Mode, Severity
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.plan_items import risky_speed, way_items
from rover_sim.mavlink.uploader import Upload, UploadState
from rover_sim.mavlink.vehicle_control import VehicleControl
from rover_sim.summary import Counts
from worlds.types import FloatArray, PoseEstimate, Vector3


class Pilot(Protocol):
    """Who tells the vehicle where to drive, over MAVLink."""

    counts: Counts
    ways_w: list[FloatArray]  # of the drive missions sent
    stop_text: str  # of the last fail-safe stop

    @property
    def doing(self) -> str:
        """What the rover is about, in a word or two."""
        ...

    @property
    def end(self) -> Decision | None:
        """What ended the drive as the pilot sees it; None while it goes on."""
        ...

    @property
    def exhausted(self) -> bool:
        """Whether fail-safes have stopped the rover for good."""
        ...

    @property
    def rocks(self) -> RockMemory:
        """Rocks as they are remembered."""
        ...

    def tick(self, estimate: PoseEstimate) -> None:
        """After each round of the link."""
        ...


@dataclass(frozen=True)
class Way:
    """A way planned beforehand; its first point is where the rover stands."""

    points_w: tuple[tuple[float, float], ...]  # at least two
    traversability: float


class GivenWay:
    """Sends a way to the vehicle and watches it; a fail-safe stop ends the drive, as nobody plans anew."""

    def __init__(self, companion: VehicleControl, local: LocalFrame, home_w: Vector3, way: Way) -> None:
        points = np.array(way.points_w)
        self.ways_w: list[FloatArray] = [points]
        self.counts = Counts(plans=1, missions_sent=1, waypoints_sent=len(points) - 1)
        self.stop_text = ""
        self._companion = companion
        self._items = way_items(points[1:], home_w[2], local, home_w, risky_speed(1.0 - way.traversability))
        self._rocks = empty_memory(points[0]).rocks
        self._upload: Upload | None = None
        self._started = False

    @property
    def doing(self) -> str:
        """What the rover is about, in a word or two."""
        return "drive" if self._started else "waiting"

    @property
    def end(self) -> Decision | None:
        """Arrived once the vehicle says that its mission is complete; no path where it does not take the mission."""
        if self._upload is not None and self._upload.state is UploadState.FAILED:
            return Decision("no_path", "the vehicle did not take the mission")
        complete = self._companion.status.mission_state is MissionState.COMPLETE
        return Decision("arrived", "the mission is complete") if self._started and complete else None

    @property
    def exhausted(self) -> bool:
        """Whether a fail-safe has stopped the rover."""
        return bool(self.stop_text)

    @property
    def rocks(self) -> RockMemory:
        """None are remembered, as nothing is looked at."""
        return self._rocks

    def tick(self, estimate: PoseEstimate) -> None:
        """Send the mission once, then notice when the vehicle stops by itself."""
        if self._upload is None:
            self._upload = self._companion.drive(self._items, estimate.time_s)
            return
        if self._companion.owns_mission is False:
            self.stop_text = "a ground station replaced the mission"
        status = self._companion.status
        self._started = self._started or status.mode == Mode.AUTO
        if self._started and status.mode == Mode.HOLD and status.mission_state is not MissionState.COMPLETE:
            grave = [text for _, severity, text in status.texts if severity <= Severity.ERROR]
            self.stop_text = grave[-1] if grave else "the vehicle stopped"
