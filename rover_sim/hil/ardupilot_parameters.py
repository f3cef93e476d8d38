"""Parameters with which ArduPilot Rover drives one of our rovers: outputs, speed and steering gains."""

from __future__ import annotations

from math import degrees

from rover_sim.hil.handling import CRUISE_SHARE, Handling
from rover_sim.mavlink.plan_items import CRUISE_M_S
from rover_sim.sim.rover import RoverModel

THROTTLE_LEFT, THROTTLE_RIGHT = 73, 74  # output functions; both assigned is what makes it steer like a tank
_CENTRED = {"MIN": 1000, "MAX": 2000, "TRIM": 1500}
_GAIN_SHARE = 0.19  # P and I beside the feed-forward, as in the set that was measured to drive well with ArduRover 4.6
_TURN_SHARE, _PIVOT_SHARE = 0.8, 0.5  # of the fastest turn: asked for at most, and on the spot
_PIVOT_DEG_S, _TURN_DEG_S, _TURN_DEG_S2 = 60.0, 120.0, 120.0  # ArduPilot's defaults, for rovers that can turn so fast
_SPEED_SHARE = 0.8  # of the fastest drive, asked for at most: the rest is for steering
_ACCELERATION_SHARE = 0.5  # of what the motors can
_WAYPOINT_M = 0.25  # at which a waypoint is reached, as with the built-in autopilot


def parameters(rover: RoverModel, handling: Handling, goal_radius_m: float) -> dict[str, float]:
    """Names and values, in the order in which they are written."""
    feed_forward = 1.0 / handling.turn_rate_rad_s
    motor = rover.motor
    fastest_deg_s = degrees(handling.turn_rate_rad_s)
    acceleration = _ACCELERATION_SHARE * motor.max_acceleration_rad_s2 * rover.wheel.radius_m
    spin_up_per_s = motor.max_acceleration_rad_s2 / motor.max_speed_rad_s
    return {
        "SERVO1_FUNCTION": THROTTLE_LEFT,
        "SERVO3_FUNCTION": THROTTLE_RIGHT,
        **{
            f"{kind}{channel}_{end}": us
            for kind in ("SERVO", "RC")
            for channel in (1, 3)
            for end, us in _CENTRED.items()
        },
        "CRUISE_SPEED": handling.cruise_m_s,
        "CRUISE_THROTTLE": 100.0 * CRUISE_SHARE,
        "WP_SPEED": min(CRUISE_M_S, _SPEED_SHARE * handling.full_m_s),
        "WP_RADIUS": min(_WAYPOINT_M, 0.5 * goal_radius_m),
        "WP_PIVOT_RATE": min(_PIVOT_DEG_S, _PIVOT_SHARE * fastest_deg_s),
        "ATC_ACCEL_MAX": acceleration,
        "ATC_STR_RAT_FF": feed_forward,
        "ATC_STR_RAT_P": _GAIN_SHARE * feed_forward,
        "ATC_STR_RAT_I": _GAIN_SHARE * feed_forward,
        "ATC_STR_RAT_MAX": min(_TURN_DEG_S, _TURN_SHARE * fastest_deg_s),
        "ATC_STR_ACC_MAX": min(_TURN_DEG_S2, fastest_deg_s * spin_up_per_s),
    }


def parameter_text(values: dict[str, float], about: str) -> str:
    """A file for ``--defaults``: a comment and a line a parameter, name and value."""
    return "".join([f"# {about}\n", *(f"{name} {round(value, 4):g}\n" for name, value in values.items())])
