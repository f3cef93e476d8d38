"""The eyes of a rover, camera and laser scanner: when each looks, and when it fails."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from worlds.fault_events import Event
from worlds.scenario import Scenario
from worlds.types import LaserModel


@dataclass(frozen=True)
class Eye:
    """A camera or a scanner: when it looks, and when it fails if it does."""

    steps: int  # between two looks
    fails_s: float
    lost: tuple[Event, ...] = ()  # in which it is silent

    def due(self, step: int, steps_per_s: int) -> bool:
        """Whether it looks at a physics step."""
        return step % self.steps == 0 and self.sees(step / steps_per_s)

    def sees(self, time_s: float) -> bool:
        """Whether it gives anything at a time."""
        return time_s < self.fails_s and not any(event.active(time_s) for event in self.lost)


def eyes(scenario: Scenario, steps_per_s: int) -> dict[str, Eye]:
    """The eyes that a scenario gives its rover."""
    sensors, camera_hz = scenario.sensors, scenario.camera.rate_hz
    lost = {name: tuple(event for event in scenario.event if event.sensor == name) for name in ("camera", "laser")}
    found = {}
    if camera_hz > 0.0:
        failing = inf if sensors.camera_fails_s is None else sensors.camera_fails_s
        found["camera"] = Eye(max(1, round(steps_per_s / camera_hz)), failing, lost["camera"])
    if sensors.laser:
        failing = inf if sensors.laser_fails_s is None else sensors.laser_fails_s
        found["laser"] = Eye(round(steps_per_s / LaserModel.rate_hz), failing, lost["laser"])
    return found
