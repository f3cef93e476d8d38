"""From what the physics holds to the `VehicleState` that is recorded."""

from __future__ import annotations

from math import acos, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from rover_sim.sim import soil_kernels as kernel
from rover_sim.sim.motion_kernels import BODY_COLUMNS, body_motion
from rover_sim.sim.rover import Body, RoverModel
from rover_sim.sim.stability import force_angle, tip_angles
from rover_sim.sim.support_polygon import outline
from rover_sim.sim.surroundings import Surface, Surroundings
from rover_sim.sim.vehicle_state import BodyContact, VehicleState
from worlds.types import BoolArray, FloatArray, HeightField, IntArray, Pose, Vector3

Motion = tuple[Vector3, Vector3, Vector3]  # velocity and rate of the chassis' centre of mass, push of that step (N)


class Balance(NamedTuple):
    """What tip-over is judged by, of one rover; worked out once, as even looking it up by the rover takes a while."""

    mass_kg: float  # of the whole rover
    centre_b: FloatArray  # (3,) of the chassis' mass, body axes
    wheel_radius_m: float
    outline: IntArray  # wheels whose contacts span the polygon of support, clockwise from above
    inertia_kg_m2: FloatArray  # (3, 3) about the centre of mass, body axes
    level_measure: float  # the force-angle measure at rest on level ground


class Snapshot(NamedTuple):
    """Raw values of one instant."""

    time_s: float
    dt: float
    gravity_m_s2: float
    balance: Balance
    field: HeightField
    surface: Surface
    around: Surroundings
    raw: FloatArray  # (13 + n + 2 m,) as in soil_kernels.ground_forces
    hubs_w: FloatArray  # (n, 3)
    centre_w: FloatArray  # (3,) of mass, whole rover
    wheels: FloatArray  # (n, 13) as in soil_kernels
    rock_loads_N: FloatArray  # (n,)
    torques_Nm: FloatArray  # (n,)
    power_W: float
    energy_J: float
    belly_contact: bool
    body_contacts: tuple[BodyContact, ...]
    wheel_contacts: tuple[int, ...]
    wedged: BoolArray  # (n,)
    motion: tuple[Motion, ...]  # last steps, oldest first


def observe(now: Snapshot) -> VehicleState:
    """The truth of one instant."""
    hubs, wheel_speeds = now.hubs_w, now.raw[13 : 13 + len(now.hubs_w)].copy()
    force, turning = _felt(now)
    rotation, position, velocity, ahead, tip_angle, tip_rate, measure = _stance(
        now.raw, hubs, now.centre_w, now.balance, force, turning
    )
    return VehicleState(
        time_s=now.time_s,
        pose=Pose(position, now.raw[3:7].copy()),
        linear_velocity_w=velocity,
        angular_velocity_w=now.raw[10:13].copy(),
        hubs_w=hubs,
        wheel_speed_rad_s=wheel_speeds,
        slip=now.wheels[:, kernel.SLIP],
        slip_angle_rad=now.wheels[:, kernel.SLIP_ANGLE],
        sinkage_m=now.wheels[:, kernel.DEPTH],
        normal_force_N=now.wheels[:, kernel.NORMAL] + now.rock_loads_N,
        drawbar_N=now.wheels[:, kernel.DRAWBAR],
        wheel_torque_Nm=now.torques_Nm,
        wheel_power_W=now.torques_Nm * wheel_speeds,
        pit_depth_m=now.around.pit_depths(now.surface, hubs, ahead),
        wedged=now.wedged,
        power_W=now.power_W,
        energy_J=now.energy_J,
        tilt_rad=acos(min(max(float(rotation[2, 2]), -1.0), 1.0)),
        stability_margin=measure / now.balance.level_measure,
        tip_angle_rad=tip_angle,
        tip_rate_rad_s=tip_rate,
        belly_contact=now.belly_contact,
        belly_clearance_m=now.around.belly_clearance(now.surface, position, rotation),
        body_contacts=now.body_contacts,
        wheel_contacts=now.wheel_contacts,
        off_map=_off_map(now.field, hubs),
    )


def _off_map(field: HeightField, places_w: FloatArray) -> bool:
    """Whether any of a few places (n, 3) is not on the map."""
    (west, east), (south, north) = field.x_limits_m, field.y_limits_m
    return not all(west <= x <= east and south <= y <= north for x, y, _ in places_w.tolist())


def _felt(now: Snapshot) -> tuple[Vector3, Vector3]:
    """Force (N) on the rover without the ground's, and how fast its rate changes (rad/s2), over the last steps."""
    mass_kg, steps = now.balance.mass_kg, max(len(now.motion) - 1, 1)
    (old_velocity, old_rate, _), (velocity, rate, _) = now.motion[0], now.motion[-1]
    span = steps * now.dt
    px = py = pz = 0.0
    for _, _, push in now.motion:
        if any(push):
            px, py, pz = px + push[0] / steps, py + push[1] / steps, pz + push[2] / steps
    ax, ay, az = ((new - old) / span for new, old in zip(velocity, old_velocity, strict=True))
    x, y, z = ((new - old) / span for new, old in zip(rate, old_rate, strict=True))
    return (px - mass_kg * ax, py - mass_kg * ay, mass_kg * (-now.gravity_m_s2 - az) + pz), (x, y, z)


@njit(cache=True)
def _stance(
    raw: FloatArray, hubs: FloatArray, centre: FloatArray, balance: Balance, force: Vector3, turning: Vector3
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """What follows from the motion of the chassis.

    Rotation (3, 3), place and velocity (3,) of the body origin, the level direction (n, 2) in which each wheel rolls,
    angle left to each tip-over axis and the rate of falling over it (m,), and the force-angle measure.
    """
    body = np.empty(BODY_COLUMNS)
    body_motion(raw, body)
    rotation, rate = body[9:18].reshape(3, 3), body[6:9]
    offset, place, velocity = np.zeros(3), np.empty(3), np.empty(3)
    for i in range(3):
        for j in range(3):
            offset[i] += rotation[i, j] * balance.centre_b[j]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        place[i] = body[i] - offset[i]
        velocity[i] = body[3 + i] - (rate[j] * offset[k] - rate[k] * offset[j])
    level = max(sqrt(rotation[1, 1] ** 2 + rotation[0, 1] ** 2), 1e-9)
    ahead = np.empty((len(hubs), 2))  # axle x up: level
    ahead[:, 0], ahead[:, 1] = rotation[1, 1] / level, -rotation[0, 1] / level
    angles, rates, measure = _tipping(rotation, rate, hubs, centre, balance, force, turning)
    return rotation, place, velocity, ahead, angles, rates, measure


@njit(cache=True)
def _tipping(
    rotation: FloatArray,
    rate: FloatArray,
    hubs: FloatArray,
    centre: FloatArray,
    balance: Balance,
    force: Vector3,
    turning: Vector3,
) -> tuple[FloatArray, FloatArray, float]:
    """Angles and rates of the tip-over axes (m,), and the measure; see `_stance`."""
    sides = len(balance.outline)
    feet, angles, rates = np.empty((sides, 3)), np.empty(sides), np.empty(sides)
    for side in range(sides):
        for axis in range(3):
            feet[side, axis] = hubs[balance.outline[side], axis] - balance.wheel_radius_m * rotation[axis, 2]
    tip_angles(feet, centre, np.array([0.0, 0.0, -1.0]), rate, angles, rates)
    spin, moment = np.zeros(3), np.zeros(3)  # body axes; world
    for i in range(3):
        for j in range(3):
            spin[i] += turning[j] * rotation[j, i]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                moment[i] -= rotation[i, j] * balance.inertia_kg_m2[j, k] * spin[k]
    measure = force_angle(feet, centre, np.array(force), moment)
    return angles, rates, measure


def balance_of(rover: RoverModel, gravity_m_s2: float) -> Balance:
    """Polygon of support, inertia and measure at rest of a rover."""
    around = np.array(outline(np.array(rover.wheel.positions_m)[:, :2]), dtype=np.int32)
    feet = np.array(rover.wheel.positions_m)[around] - [0.0, 0.0, rover.wheel.radius_m]
    weight = np.array([0.0, 0.0, -rover.mass_kg * gravity_m_s2])
    level = float(force_angle(feet, np.array(rover.centre_of_mass_b), weight, np.zeros(3)))
    centre_b = np.array(rover.chassis.centre_of_mass_m)
    return Balance(rover.mass_kg, centre_b, rover.wheel.radius_m, around, _inertia(rover), level)


def _inertia(rover: RoverModel) -> FloatArray:
    """Moments of inertia (3, 3) of chassis, level arms and wheels about their common centre of mass, body axes."""
    wheel, centre = rover.wheel, np.array(rover.centre_of_mass_b)
    across = wheel.mass_kg * (3.0 * wheel.radius_m**2 + wheel.width_m**2) / 12.0
    own = np.diag([across, 0.5 * wheel.mass_kg * wheel.radius_m**2, across])
    total = np.zeros((3, 3))
    parts: tuple[Body, ...] = (rover.chassis, *rover.suspension.arm)
    for part in parts:
        offset = np.array(part.centre_of_mass_m) - centre
        total = total + np.diag(part.inertia_kg_m2) + _point_inertia(part.mass_kg, offset)
    for position in wheel.positions_m:
        total = total + own + _point_inertia(wheel.mass_kg, np.array(position) - centre)
    return total


def _point_inertia(mass_kg: float, place: FloatArray) -> FloatArray:
    return np.asarray(mass_kg * (float(place @ place) * np.eye(3) - np.outer(place, place)))
