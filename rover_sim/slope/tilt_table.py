"""Tilt table: level ground under a gravity that leans more and more until the rover goes over."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan, cos, degrees, radians, sin
from typing import Literal, get_args

import msgspec
import numpy as np

from rover_sim.sim.rover import RoverModel
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.stability import force_angle
from rover_sim.sim.support_polygon import outline
from rover_sim.sim.vehicle_state import VehicleState
from rover_sim.sim.world import set_gravity
from rover_sim.slope.rig import Setup, plane_world
from worlds.geometry import rotation_from_quaternion
from worlds.soil import Soil, soil_preset
from worlds.types import Vector3

Axis = Literal["lateral", "uphill", "downhill"]
AXES: tuple[Axis, ...] = get_args(Axis)

_FAST_DEG_S = 10.0  # up to this share of the analytic angle
_FAST_SHARE = 0.9
_SLOW_DEG_S = 0.5
_PAST = 1.2  # times the analytic angle: the table stops there
_STAYS_S = 0.2  # a wheel that only hops comes back within that
_LIFTED = 1e-3  # of the weight: a wheel that carries less has left the table
_SIZE_M = 8.0
_LEAN: dict[Axis, tuple[float, float]] = {"lateral": (0.0, -1.0), "uphill": (-1.0, 0.0), "downhill": (1.0, 0.0)}


@dataclass(frozen=True)
class TiltPoint:
    """Where a rover with blocked wheels on a surface that grips goes over."""

    rover: str
    load_kg: float
    axis: str  # lateral: to its right; uphill, downhill: the way its nose points
    analytic_deg: float  # arc tangent of the lever of the lower wheels over the height of the centre of mass
    tip_deg: float | None  # table angle at which all upper wheels have lifted
    margin_zero_deg: float | None  # table angle at which the force-angle measure changes sign
    error_deg: float | None


def measure_tilt(setup: Setup, axis: Axis) -> TiltPoint:
    """Tilt until the upper wheels have lifted."""
    rover = _blocked(setup.model())
    analytic = analytic_tip_deg(rover, axis)
    tip, margin_zero = _tilt(rover, setup.gravity_m_s2, axis, analytic)
    return TiltPoint(
        rover=setup.rover,
        load_kg=setup.load_kg,
        axis=axis,
        analytic_deg=round(analytic, 3),
        tip_deg=None if tip is None else round(tip, 3),
        margin_zero_deg=None if margin_zero is None else round(margin_zero, 3),
        error_deg=None if tip is None else round(tip - analytic, 3),
    )


def analytic_tip_deg(rover: RoverModel, axis: Axis) -> float:
    """Angle at which the centre of mass stands over the lower wheels; arms are taken as rigid."""
    lean = _LEAN[axis]
    centre = rover.centre_of_mass_b
    reach = [place[0] * lean[0] + place[1] * lean[1] for place in rover.wheel.positions_m]
    lever = max(reach) - (centre[0] * lean[0] + centre[1] * lean[1])
    height = centre[2] + rover.wheel.radius_m - float(np.mean([place[2] for place in rover.wheel.positions_m]))
    return degrees(atan(lever / height))


def _blocked(rover: RoverModel) -> RoverModel:
    """The rover with brakes that hold whatever comes, on its rims: no grouser digs into the table."""
    motor = msgspec.structs.replace(rover.motor, max_torque_Nm=1e5)
    wheel = msgspec.structs.replace(rover.wheel, grouser_m=0.0)
    return msgspec.structs.replace(rover, motor=motor, wheel=wheel)


def _grip() -> Soil:
    """Firm ground on which a rover tips before it slides."""
    return replace(soil_preset("firm"), name="firm", friction_angle_rad=radians(80.0), cohesion_Pa=0.0)


def _tilt(rover: RoverModel, gravity: float, axis: Axis, analytic: float) -> tuple[float | None, float | None]:
    """Table angles (deg) at which the upper wheels have lifted and at which the force-angle measure is zero."""
    world = plane_world(_grip(), gravity, 0.0, 0.0, _SIZE_M)
    lean = _LEAN[axis]
    upper = [place[0] * lean[0] + place[1] * lean[1] < 0.0 for place in rover.wheel.positions_m]
    least_N = _LIFTED * rover.mass_kg * gravity
    angle, lifted_s, lift, margin_zero = 0.0, 0.0, 0.0, None
    with Simulation(world, rover, np.random.default_rng(0)) as simulation:
        while angle < _PAST * analytic:
            rate = _FAST_DEG_S if angle < _FAST_SHARE * analytic else _SLOW_DEG_S
            angle += rate * simulation.dt
            level = gravity * sin(radians(angle))
            pull = (level * lean[0], level * lean[1], -gravity * cos(radians(angle)))
            set_gravity(simulation.client, pull)
            simulation.step([0.0] * len(upper))
            if margin_zero is None and _margin(rover, simulation.state, pull) < 0.0:
                margin_zero = angle
            if angle > _FAST_SHARE * analytic and simulation.state.normal_force_N[upper].max() < least_N:
                lift = angle if lifted_s == 0.0 else lift
                lifted_s += simulation.dt
            else:
                lifted_s = 0.0
            if lifted_s > _STAYS_S:
                return lift, margin_zero
    return None, margin_zero


def _margin(rover: RoverModel, state: VehicleState, pull: Vector3) -> float:
    """Force-angle measure at rest under a leaning gravity, about the contacts under the hubs."""
    corners = list(outline(np.array(rover.wheel.positions_m)[:, :2]))
    feet = state.hubs_w[corners] - [0.0, 0.0, rover.wheel.radius_m]
    rotation = rotation_from_quaternion(state.pose.quaternion_w)
    centre = state.pose.position_w + rotation @ np.array(rover.centre_of_mass_b)
    return float(force_angle(feet, centre, rover.mass_kg * np.array(pull), np.zeros(3)))
