"""From what the physics holds to the `VehicleState` that is recorded."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import acos

import numpy as np

from rover_sim.sim import soil_kernels as kernel
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.stability import force_angle
from rover_sim.sim.vehicle_state import BodyContact, VehicleState
from worlds.geometry import rotation_from_quaternion
from worlds.heightfield import contains
from worlds.types import FloatArray, HeightField, Pose, Vector3

Motion = tuple[Vector3, Vector3]  # velocity and rate of the chassis' centre of mass
_CLOCKWISE = (0, 2, 3, 1)  # wheels seen from above


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Raw values of one instant."""

    time_s: float
    dt: float
    gravity_m_s2: float
    rover: RoverModel
    ground: HeightField
    raw: FloatArray  # (13 + n,) as in soil_kernels.ground_forces
    wheels: FloatArray  # (n, 13) as in soil_kernels
    rock_loads_N: FloatArray  # (n,)
    torques_Nm: FloatArray  # (n,)
    power_W: float
    energy_J: float
    belly_contact: bool
    body_contacts: tuple[BodyContact, ...]
    wheel_contacts: tuple[int, ...]
    motion: tuple[Motion, ...]  # last steps, oldest first


def observe(now: Snapshot) -> VehicleState:
    """The truth of one instant."""
    rotation = rotation_from_quaternion(now.raw[3:7])
    offset = rotation @ np.array(now.rover.chassis.centre_of_mass_m)
    position, rate = now.raw[:3] - offset, now.raw[10:13].copy()
    hubs = position + np.array(now.rover.wheel.positions_m) @ rotation.T
    return VehicleState(
        time_s=now.time_s,
        pose=Pose(position, now.raw[3:7].copy()),
        linear_velocity_w=now.raw[7:10] - np.cross(rate, offset),
        angular_velocity_w=rate,
        wheel_speed_rad_s=now.raw[13:].copy(),
        slip=now.wheels[:, kernel.SLIP],
        slip_angle_rad=now.wheels[:, kernel.SLIP_ANGLE],
        sinkage_m=now.wheels[:, kernel.DEPTH],
        normal_force_N=now.wheels[:, kernel.NORMAL] + now.rock_loads_N,
        drawbar_N=now.wheels[:, kernel.DRAWBAR],
        wheel_torque_Nm=now.torques_Nm,
        power_W=now.power_W,
        energy_J=now.energy_J,
        tilt_rad=acos(min(max(float(rotation[2, 2]), -1.0), 1.0)),
        stability_margin=_stability(now, rotation, position),
        belly_contact=now.belly_contact,
        body_contacts=now.body_contacts,
        wheel_contacts=now.wheel_contacts,
        off_map=not bool(np.all(contains(now.ground, hubs[:, 0], hubs[:, 1]))),
    )


def _stability(now: Snapshot, rotation: FloatArray, origin: FloatArray) -> float:
    """Force-angle measure divided by its value at rest on level ground."""
    rover = now.rover
    feet_b, centre_b = _feet_and_centre(rover)
    (old_velocity, old_rate), (velocity, rate) = now.motion[0], now.motion[-1]
    span = max(len(now.motion) - 1, 1) * now.dt
    acceleration = (np.array(velocity) - old_velocity) / span
    turning = rotation.T @ ((np.array(rate) - old_rate) / span)
    gravity = np.array([0.0, 0.0, -now.gravity_m_s2])
    force = rover.mass_kg * (gravity - acceleration)
    moment = -rotation @ (np.array(rover.chassis.inertia_kg_m2) * turning)
    margin = force_angle(feet_b @ rotation.T + origin, rotation @ centre_b + origin, force, moment)
    return margin / _level_measure(rover, now.gravity_m_s2)


@cache
def _feet_and_centre(rover: RoverModel) -> tuple[FloatArray, FloatArray]:
    """Wheel contacts (m, 3), clockwise from above, and centre of mass (3,) in body axes."""
    feet = np.array(rover.wheel.positions_m) - [0.0, 0.0, rover.wheel.radius_m]
    return feet[list(_CLOCKWISE)], np.array(rover.centre_of_mass_b)


@cache
def _level_measure(rover: RoverModel, gravity_m_s2: float) -> float:
    """The force-angle measure at rest on level ground."""
    weight = np.array([0.0, 0.0, -rover.mass_kg * gravity_m_s2])
    return force_angle(*_feet_and_centre(rover), weight, np.zeros(3))
