"""What a traverse wants of the link between planner and vehicle, whoever the vehicle is."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.narrator import Narrator
from rover_sim.mavlink.vehicle_control import VehicleControl
from worlds.types import PoseEstimate, SensorReadings


class PlannerLink(Protocol):
    """The planner's link to the vehicle, with what a traverse wants of it."""

    @property
    def frame(self) -> LocalFrame:
        """Where the world lies on Earth."""
        ...

    @property
    def companion(self) -> VehicleControl:
        """The planner's side."""
        ...

    @property
    def narrator(self) -> Narrator:
        """Who tells stations what the simulator knows."""
        ...

    def tick(self, time_s: float, estimate: PoseEstimate | None, readings: SensorReadings | None) -> None:
        """One round of the link, right after the driver's update."""
        ...

    def save_plans(self, waypoints: Path, plan: Path) -> None:
        """Write the mission that the vehicle holds, in both of QGroundControl's formats."""
        ...

    def close(self) -> None:
        """Close the link and finish its log."""
        ...
