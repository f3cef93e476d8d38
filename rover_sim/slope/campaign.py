"""All tests of one campaign: what is to be measured, and what came out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from rover_sim.slope.drawbar import IMPOSED_SLIPS, DrawbarPoint, measure_drawbar
from rover_sim.slope.rig import Direction, Setup, SlopePoint, measure_slope
from rover_sim.slope.tilt_table import AXES, TiltPoint, measure_tilt
from rover_sim.slope.turning import RADII_IN_TRACKS, TurnPoint, measure_turn

Point = SlopePoint | TurnPoint | DrawbarPoint | TiltPoint
Task = Callable[[], Point]
P = TypeVar("P", SlopePoint, TurnPoint, DrawbarPoint, TiltPoint)


@dataclass(frozen=True)
class Campaign:
    """What the user asked for."""

    soils: tuple[str, ...]
    slopes_deg: tuple[float, ...]
    directions: tuple[Direction, ...]
    gravity_m_s2: float
    rover: str
    load_kg: float
    speed_m_s: float

    def setups(self) -> list[Setup]:
        """The rover on each soil."""
        return [Setup(soil, self.gravity_m_s2, self.rover, self.load_kg, self.speed_m_s) for soil in self.soils]

    def tasks(self) -> list[Task]:
        """Everything to measure, in the order of the results."""
        setups = self.setups()
        tasks: list[Task] = [
            partial(measure_slope, setup, direction, slope_deg)
            for setup in setups
            for direction in self.directions
            for slope_deg in self.slopes_deg
        ]
        tasks += [partial(measure_turn, setup, radius) for setup in setups for radius in RADII_IN_TRACKS]
        tasks += [partial(measure_drawbar, setup, slip) for setup in setups for slip in IMPOSED_SLIPS]
        tasks += [partial(measure_tilt, setups[0], axis) for axis in AXES]
        return tasks


def of_kind(points: Mapping[int, Point], kind: type[P]) -> list[P]:
    """The points of one test, in the order of their tasks."""
    return [point for _, point in sorted(points.items()) if isinstance(point, kind)]
