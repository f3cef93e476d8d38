"""Truth of one instant as autopilots want it told, and as the models of their sensors take it."""

from __future__ import annotations

from dataclasses import dataclass

from worlds.types import Vector3

STANDARD_GRAVITY_M_S2 = 9.80665  # that every autopilot's estimator assumes, on whatever world the rover drives


@dataclass(frozen=True)
class NedState:
    """Truth of one instant; position, velocity and acceleration are those of the chassis' centre of mass."""

    time_s: float
    position_m: Vector3  # north, east, down from where the rover stood at the start
    velocity_m_s: Vector3  # north, east, down
    quaternion: tuple[float, float, float, float]  # w, x, y, z: body to north-east-down
    rate_rad_s: Vector3  # body
    specific_force_m_s2: Vector3  # body; level and at rest (0, 0, -9.80665)
