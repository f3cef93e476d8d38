"""How the autopilot may move the rover, from its parameters."""

from __future__ import annotations

from math import radians

from planner.mobility import Limits
from rover_sim.autopilot.parameters import ParameterTable
from worlds.types import Footprint

_YAW_PER_ACCELERATION = 2.0  # 1/m
_LOOKAHEAD_LENGTHS, _SLOW_RADIUS_LENGTHS = 0.5, 1.2  # of the rover


def limits(parameters: ParameterTable, footprint: Footprint) -> Limits:
    """Speeds, accelerations and distances of a mission."""
    return Limits(
        cruise_speed_m_s=parameters["CRUISE_SPEED"],
        turn_rate_rad_s=radians(parameters["TURN_RATE"]),
        arrival_radius_m=parameters["WP_RADIUS"],
        acceleration_m_s2=parameters["ACCEL_MAX"],
        yaw_acceleration_rad_s2=_YAW_PER_ACCELERATION * parameters["ACCEL_MAX"],
        lookahead_m=_LOOKAHEAD_LENGTHS * footprint.length_m,
        slow_radius_m=_SLOW_RADIUS_LENGTHS * footprint.length_m,
    )
