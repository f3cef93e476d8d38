"""The planner's link to an autopilot that is not ours, as a traverse wants it."""

from __future__ import annotations

from pathlib import Path

from rover_sim.mavlink.endpoint import Endpoint, Link
from rover_sim.mavlink.foreign_companion import ForeignCompanion
from rover_sim.mavlink.foreign_pursuit import Patience
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.mission_file import write_plan, write_waypoints
from rover_sim.mavlink.narrator import Narrator
from rover_sim.mavlink.plan_items import CRUISE_M_S, home_item
from rover_sim.mavlink.tlog import TlogWriter
from rover_sim.mavlink.transport import Transport
from worlds.types import PoseEstimate, SensorReadings, Vector3

_SYSTEM = 1  # under which the simulator itself speaks in the log


class AutopilotLink:
    """Companion and log on one transport, which is closed with them."""

    def __init__(
        self,
        frame: LocalFrame,
        home_w: Vector3,
        transport: Transport,
        tlog: Path | None = None,
        patience: Patience | None = None,
    ) -> None:
        """``frame``: as the autopilot has it; ``home_w``: where the rover starts (m), which is home to it."""
        self.frame, self._home_w = frame, home_w
        log = None if tlog is None else Link(TlogWriter(tlog), {}, hears_simulator=True)
        self.companion = ForeignCompanion(Link(transport, {}), log, patience)
        # Of the truth the log hears, the autopilot does not.
        self.narrator = Narrator(Endpoint(_SYSTEM, 0, [], log))

    def tick(self, time_s: float, estimate: PoseEstimate | None, readings: SensorReadings | None) -> None:
        """One round of the link; the autopilot has an estimate and sensors of its own."""
        del estimate, readings
        self.companion.tick(time_s)

    def save_plans(self, waypoints: Path, plan: Path) -> None:
        """Write the mission that was sent last, in both of QGroundControl's formats."""
        items = self.companion.sent or (home_item(self.frame, self._home_w),)
        write_waypoints(waypoints, items)
        write_plan(plan, items, CRUISE_M_S)

    def close(self) -> None:
        """Close link and log."""
        self.companion.close()
