"""The slope rig: a rover driven up, down or across a plane at constant wheel speed, measured once it is steady."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, cos, degrees, hypot, inf, radians, sin, tan
from typing import Literal, get_args

import msgspec
import numpy as np

from rover_sim.sim.mobility_events import Kind, MobilityLog
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.vehicle_state import VehicleState
from rover_sim.sim.world import TIME_STEP_S
from rover_sim.slope.bands import STALL_SLIP, is_inside, slip_band
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion
from worlds.scenario import Scenario, SoilChoice
from worlds.shapes import NO_ROCKS, SolidShapes
from worlds.soil import Soil
from worlds.soil_file import load_soil
from worlds.types import FloatArray, HeightField, Pose, World

Direction = Literal["up", "down", "across"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)

_CELL_M = 0.08
_MARGIN_M = 3.0
_SAMPLE_S = 0.05
_RUN_IN = 1.2  # wheelbases made good before measuring: the rear wheels are then on ground that the front ones passed
_GIVE_UP = 5.0  # wheelbases of wheel travel after which a rover that does not get on is measured where it is
_MEASURED = 0.8  # wheelbases of wheel travel that are averaged
_LEAST_FRICTION = 0.3
_SLIDE_S = 5.0  # longer than a simulation waits for its rover to come to rest
_AZIMUTH_DEG: dict[Direction, float] = {"up": 0.0, "down": 180.0, "across": 90.0}


@dataclass(frozen=True)
class Setup:
    """What stands on the rig."""

    soil: str  # a preset or a file
    gravity_m_s2: float
    rover: str  # a shipped name or a file
    load_kg: float  # in the middle of the deck
    speed_m_s: float  # of the rims

    def model(self) -> RoverModel:
        """The rover with its load; raises `ScenarioError` for a rover that cannot be."""
        return loaded(load_rover(self.rover), self.load_kg)


@dataclass(frozen=True)
class SlopePoint:
    """One steady drive on a slope; the keys are those of a row of ``slope.json``."""

    soil: str
    gravity_m_s2: float
    rover: str
    direction: str
    slope_deg: float
    slip: float  # driving 1 - v / (omega r), braking (omega r - v) / v; v along the heading
    slip_angle_deg: float  # downhill from the heading
    sinkage_m: float
    drawbar_N: float  # net pull of the soil, all wheels: what carries the rover up
    power_W: float
    stalled: bool
    embedded: bool
    band: tuple[float, float] | None
    inside: bool | None


def loaded(rover: RoverModel, load_kg: float) -> RoverModel:
    """The rover with a point mass in the middle of its deck, the top of its highest box."""
    if load_kg == 0.0:
        return rover
    chassis = rover.chassis
    deck = max(chassis.box, key=lambda box: box.centre_m[2] + 0.5 * box.size_m[2])
    place = np.array([*deck.centre_m[:2], deck.centre_m[2] + 0.5 * deck.size_m[2]])
    mass = chassis.mass_kg + load_kg
    arm = place - np.array(chassis.centre_of_mass_m)
    centre = np.array(chassis.centre_of_mass_m) + load_kg / mass * arm
    reduced = chassis.mass_kg * load_kg / mass  # of the pair about their common centre
    inertia = np.array(chassis.inertia_kg_m2) + reduced * (arm @ arm - arm**2)
    heavier = msgspec.structs.replace(
        chassis, mass_kg=mass, centre_of_mass_m=tuple(centre.tolist()), inertia_kg_m2=tuple(inertia.tolist())
    )
    return msgspec.structs.replace(rover, chassis=heavier)


def plane_world(
    soil: Soil, gravity_m_s2: float, slope_deg: float, azimuth_deg: float, size_m: float, *, ruts: bool = True
) -> World:
    """A plane that rises toward ``azimuth_deg``; the rover stands in the middle of it and heads east."""
    half = 0.5 * size_m
    axis = np.linspace(-half, half, round(size_m / _CELL_M) + 1)
    rise = cos(radians(azimuth_deg)) * axis[None, :] + sin(radians(azimuth_deg)) * axis[:, None]
    ground = HeightField(rise * tan(radians(slope_deg)), float(axis[1] - axis[0]), (-half, -half))
    scenario = Scenario(name="slope", gravity_m_s2=gravity_m_s2, soil=SoilChoice(preset=soil.name, ruts=ruts))
    start = Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0))
    shapes = SolidShapes(NO_ROCKS, (), ground)
    return World(scenario, 0, ground, NO_ROCKS, (), shapes, soil, start, (half, 0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of driving, sampled."""

    states: tuple[VehicleState, ...]
    shear_radius_m: float

    @property
    def time_s(self) -> float:
        """How long it took."""
        return self.states[-1].time_s - self.states[0].time_s

    @property
    def way_w(self) -> FloatArray:
        """Displacement of the body origin (3,)."""
        return self.states[-1].pose.position_w - self.states[0].pose.position_w

    @property
    def wheel_way_m(self) -> float:
        """Mean travel of the rims at the shearing radius."""
        return float(self.mean("wheel_speed_rad_s").mean()) * self.shear_radius_m * self.time_s

    @property
    def power_W(self) -> float:
        """Mean power."""
        return (self.states[-1].energy_J - self.states[0].energy_J) / self.time_s

    def mean(self, name: str) -> FloatArray:
        """Mean over time of a quantity of the state."""
        return np.asarray(np.mean([getattr(state, name) for state in self.states], axis=0))


def drive(simulation: Simulation, speeds_rad_s: Sequence[float], seconds: float, reach_m: float = inf) -> Stretch:
    """Hold wheel speeds for a while, or until the rover is ``reach_m`` from where it was."""
    per_sample = max(1, round(_SAMPLE_S / simulation.dt))
    states = [simulation.state]
    for _ in range(max(1, round(seconds / simulation.dt / per_sample))):
        for _ in range(per_sample):
            simulation.step(speeds_rad_s)
        states.append(simulation.state)
        if np.linalg.norm(states[-1].pose.position_w - states[0].pose.position_w) > reach_m:
            break
    return Stretch(tuple(states), simulation.rover.wheel_shape().shear_radius_m)


def measure_slope(setup: Setup, direction: Direction, slope_deg: float, time_step_s: float = TIME_STEP_S) -> SlopePoint:
    """Drive until the rover is steady, then measure it."""
    rover = setup.model()
    run_in, stretch = slope_drive(rover, setup, direction, slope_deg, load_soil(setup.soil), time_step_s)
    embedded = embeds(rover, setup.gravity_m_s2, (*run_in.states, *stretch.states[1:]))
    return _evaluate(setup, direction, slope_deg, stretch, embedded=embedded)


def slope_drive(
    rover: RoverModel,
    setup: Setup,
    direction: Direction,
    slope_deg: float,
    soil: Soil,
    time_step_s: float = TIME_STEP_S,
    *,
    ruts: bool = True,
) -> tuple[Stretch, Stretch]:
    """Run-in and measured stretch of a drive on a plane; the rover and the soil need not be files.

    Without ``ruts`` every wheel meets virgin soil, as in the theory of a single wheel.
    """
    azimuth_deg = _AZIMUTH_DEG[direction]
    half = (_RUN_IN + 2.0) * rover.wheelbase_m + _MARGIN_M + _slide_m(setup.gravity_m_s2, slope_deg)
    world = plane_world(soil, setup.gravity_m_s2, slope_deg, azimuth_deg, 2.0 * half, ruts=ruts)
    speeds = [setup.speed_m_s / rover.wheel_shape().shear_radius_m] * len(rover.wheel.positions_m)
    wheelbase_s = rover.wheelbase_m / setup.speed_m_s
    with Simulation(world, rover, np.random.default_rng(0), time_step_s=time_step_s) as simulation:
        run_in = drive(simulation, speeds, _GIVE_UP * wheelbase_s, _RUN_IN * rover.wheelbase_m)
        return run_in, drive(simulation, speeds, _MEASURED * wheelbase_s, rover.wheelbase_m)


def _slide_m(gravity_m_s2: float, slope_deg: float) -> float:
    """Room for a rover that slides away while it should come to rest."""
    pull = gravity_m_s2 * (sin(radians(slope_deg)) - _LEAST_FRICTION * cos(radians(slope_deg)))
    return 0.5 * max(pull, 0.0) * _SLIDE_S**2


def made_good(stretch: Stretch) -> tuple[float, float]:
    """Way (m) along the heading and to its left, both in the plane of the ground."""
    axes = rotation_from_quaternion(stretch.states[0].pose.quaternion_w)
    axes_end = rotation_from_quaternion(stretch.states[-1].pose.quaternion_w)
    ahead, left = (axes[:, i] + axes_end[:, i] for i in (0, 1))
    way = stretch.way_w
    return float(way @ ahead / np.linalg.norm(ahead)), float(way @ left / np.linalg.norm(left))


def travel_slip(stretch: Stretch) -> float:
    """Slip ratio of the whole rover over a stretch: driving 1 - v / (omega r), braking (omega r - v) / v."""
    wheel_way, way = stretch.wheel_way_m, made_good(stretch)[0]
    return (wheel_way - way) / max(wheel_way, way, 1e-9)


def embeds(rover: RoverModel, gravity_m_s2: float, states: Sequence[VehicleState]) -> bool:
    """Whether a wheel slipped past the stop limit and still sank, as the mobility events of a traverse define it."""
    log = MobilityLog(rover, gravity_m_s2)
    for before, state in pairwise(states):
        log.look(state, state.time_s - before.time_s)
    return any(event.kind is Kind.EMBEDDING for event in log.events)


def _evaluate(setup: Setup, direction: Direction, slope_deg: float, stretch: Stretch, *, embedded: bool) -> SlopePoint:
    slip = travel_slip(stretch)
    ahead, left = made_good(stretch)
    stalled = slip > STALL_SLIP
    band = slip_band(setup.soil, setup.gravity_m_s2, direction, slope_deg)
    return SlopePoint(
        soil=setup.soil,
        gravity_m_s2=setup.gravity_m_s2,
        rover=setup.rover,
        direction=direction,
        slope_deg=slope_deg,
        slip=round(slip, 5),
        slip_angle_deg=round(degrees(atan2(-left, abs(ahead))), 3) if hypot(ahead, left) > 1e-3 else 0.0,
        sinkage_m=round(float(stretch.mean("sinkage_m").mean()), 6),
        drawbar_N=round(float(stretch.mean("drawbar_N").sum()), 3),
        power_W=round(stretch.power_W, 3),
        stalled=stalled,
        embedded=embedded,
        band=(band.low, band.high) if band else None,
        inside=is_inside(band, slip, stuck=stalled or embedded),
    )
