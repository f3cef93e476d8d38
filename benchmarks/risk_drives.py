"""The drives of `risk_calibration.py`: random ways over random slopes, and what the whole physics made of them.

Each number is a drive of its own: a rover (half of them carry a mast that may make them top-heavy), a prior of soils
and one soil drawn from it, a rough slope of 0 to 25 degrees in any direction with stones on it, a map of it with
errors, and a straight or curved way of 5 to 15 m. The built-in autopilot drives it with closed eyes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from math import cos, sin

import msgspec
import numpy as np
from scipy import ndimage

from planner.denoise import denoised, error_left
from planner.risk_prior import MapError, SoilPrior, draw_soils
from planner.route_ground import ElevationMap
from rover_sim.given_way import Way
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.verify import drive_way
from worlds.build import build_world
from worlds.scenario import Goal, Rocks, Scenario, SoilChoice, Terrain
from worlds.soil import PRESETS
from worlds.types import FloatArray, HeightField, World

STREAM = 7701
SOILS = ("firm", "mars_sand", "loose_sand", "dry_sand", "lunar_nominal", "sandy_loam_11")
MAP_CELL_M = 0.4
STONES_M = 0.6  # rms lift of a wheel by stones over their cover: a third a metre of 4 cm at 1.5 %
OVER_DEG = 45.0  # half as steep again as any of the slopes
STEP_M = 0.5  # between two points of a way


@dataclass(frozen=True, eq=False)
class Drive:
    """All of one drive: what is believed of it, and what is true."""

    number: int
    rover: RoverModel
    prior: SoilPrior
    map: HeightField
    error: MapError
    way_w: FloatArray  # (N, 2)
    world: World
    slope_deg: float


@dataclass(frozen=True)
class Outcome:
    """What came of it."""

    number: int
    reason: str
    detail: str
    length_m: float
    driven_m: float
    lateral_m: float  # largest distance from the way
    max_tilt_deg: float

    @property
    def rollover(self) -> bool:
        """Whether the rover went over, or so far that only the end of the drive kept it from that."""
        return self.reason == "tipped" or self.max_tilt_deg > OVER_DEG

    @property
    def immobilised(self) -> bool:
        """Whether it was stopped short of the end in another way."""
        return not self.rollover and self.reason not in ("goal", "goal_missed")


def make_drive(number: int) -> Drive:
    """The drive of a number; the same each time."""
    rng = np.random.default_rng([STREAM, number])
    prior = _prior(rng)
    rover, way = _rover(rng), _way(rng)
    slope_deg = float(rng.uniform(0.0, 25.0))
    roughness, cover = float(rng.uniform(0.0, 0.10)), float(rng.uniform(0.0, 0.03))
    reach = float(np.abs(way).max()) + 4.0
    scenario = Scenario(
        name=f"risk-{number}",
        terrain=Terrain(
            size_m=(2.0 * reach, 2.0 * reach),
            roughness_m=roughness,
            slope_deg=slope_deg,
            slope_azimuth_deg=float(rng.uniform(-180.0, 180.0)),
        ),
        rocks=Rocks(cfa=cover, max_diameter_m=0.14, min_diameter_m=0.05, clear_radius_m=1.0),
        soil=SoilChoice(preset="firm"),
        goal=Goal(position_m=(float(way[-1, 0]), float(way[-1, 1])), radius_m=1.0, time_limit_s=150.0),
    )
    world = replace(build_world(scenario, number), soil=draw_soils(prior, 1, rng)[0])
    measured = _map(world, float(rng.uniform(0.0, 0.05)), rng)
    error = error_left(measured, 0.004 + STONES_M * cover)
    return Drive(number, rover, prior, denoised(measured).field, error, way, world, slope_deg)


def drive(plan: Drive) -> Outcome:
    """Drive it with the whole physics."""
    points = tuple((float(x), float(y)) for x, y in plan.way_w)
    driven = drive_way(plan.world, plan.rover, Way(points, 1.0))
    figures = driven.figures
    length = float(np.linalg.norm(np.diff(plan.way_w, axis=0), axis=1).sum())
    return Outcome(
        plan.number,
        figures["reason"],
        figures["detail"],
        round(length, 3),
        figures["distance_m"],
        figures["largest_cross_track_m"],
        figures["max_tilt_deg"],
    )


def as_row(outcome: Outcome) -> dict[str, object]:
    """The outcome for a file."""
    return asdict(outcome)


def _prior(rng: np.random.Generator) -> SoilPrior:
    """One soil, or two of which one is likelier."""
    names = rng.choice(SOILS, 2, replace=False).tolist()
    share = 1.0 if rng.random() < 0.6 else float(rng.uniform(0.5, 0.9))
    return SoilPrior(tuple(PRESETS[name] for name in names), (share, 1.0 - share))


def _rover(rng: np.random.Generator) -> RoverModel:
    """A Husky, in half of the cases with its mass raised by up to 0.7 m."""
    rover = load_rover("husky")
    raised = float(rng.uniform(0.0, 0.7)) if rng.random() < 0.5 else 0.0
    x, y, z = rover.chassis.centre_of_mass_m
    chassis = msgspec.structs.replace(rover.chassis, centre_of_mass_m=(x, y, z + raised))
    return msgspec.structs.replace(rover, chassis=chassis)


def _way(rng: np.random.Generator) -> FloatArray:
    """Points (N, 2) from the origin, first ahead: a line or an arc of at least 5 m radius."""
    length = float(rng.uniform(5.0, 15.0))
    bend = 0.0 if rng.random() < 0.5 else float(rng.uniform(-0.2, 0.2))
    arcs = np.linspace(0.0, length, max(2, round(length / STEP_M)) + 1)
    headings = bend * 0.5 * (arcs[1:] + arcs[:-1])
    steps = np.diff(arcs)[:, None] * np.array([[cos(angle), sin(angle)] for angle in headings])
    return np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def _map(world: World, noise_m: float, rng: np.random.Generator) -> ElevationMap:
    """The ground as means over cells, with white noise."""
    fine = world.ground
    cells = max(1, round(MAP_CELL_M / fine.resolution_m))
    mean = ndimage.uniform_filter(fine.heights_m, cells, mode="nearest")[::cells, ::cells]
    heights = mean + rng.normal(0.0, noise_m, mean.shape)
    return ElevationMap.of(HeightField(heights, fine.resolution_m * cells, fine.origin_m), noise_m)
