"""A double of a foreign autopilot on a kinematic rover, and the companion that is to take it through a mission."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rover_sim.mavlink.endpoint import Link
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.foreign_companion import ForeignCompanion
from rover_sim.mavlink.foreign_pursuit import Patience
from rover_sim.mavlink.memory import MemoryEnd, memory_link
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.wire import WireItem
from tests.ardupilot_mavlink_double import ArduRoverDouble
from tests.vehicle_double import KinematicRover, VehicleDouble

STEP_S = 0.05


class ForeignPair:
    """Companion and double on one link; the clock is the test's."""

    def __init__(
        self,
        double: Callable[[MemoryEnd], VehicleDouble] = ArduRoverDouble,
        faults: Faults | None = None,
        seed: int = 1,
        patience: Patience | None = None,
        start_s: float = 0.0,
    ) -> None:
        ours, theirs = memory_link(faults, np.random.default_rng(seed))
        self.companion = ForeignCompanion(Link(ours, {}), patience=patience)
        self.double, self.rover = double(theirs), KinematicRover()
        self.time_s = start_s
        self.tick: Callable[[float], object] = self.companion.tick  # or who ticks it

    def step(self) -> None:
        wheels = self.double.tick(self.time_s, self.rover.motion)
        self.tick(self.time_s)
        self.rover.step(wheels, STEP_S)
        self.time_s += STEP_S

    def run(self, seconds: float) -> None:
        end = self.time_s + seconds
        while self.time_s < end:
            self.step()

    def until(self, done: Callable[[], bool], limit_s: float) -> float:
        """Run until it is so; the time at which it is."""
        end = self.time_s + limit_s
        while not done():
            assert self.time_s < end, f"not within {limit_s} s; {self.companion.trouble}, {self.companion.status}"
            self.step()
        return self.time_s

    def items(self, *places: tuple[float, float], speed_m_s: float | None = None) -> list[WireItem]:
        """A mission through places east and north of home."""
        return mission_items([(x, y, 0.0) for x, y in places], self.double.frame, (0.0, 0.0, 0.0), speed_m_s)
