"""Parameters with which PX4's differential rover drives one of our rovers, as QGroundControl loads them.

Names as in PX4's own rover (``ROMFS/.../airframes/4009_gz_r1_rover``, v1.16) and its simulated outputs
(``src/modules/simulation/pwm_out_sim``).
"""

from __future__ import annotations

from math import degrees, radians

from rover_sim.hil.handling import Handling
from rover_sim.mavlink.plan_items import CRUISE_M_S
from rover_sim.sim.rover import RoverModel

DIFFERENTIAL = 6  # CA_AIRFRAME
RIGHT_MOTOR, LEFT_MOTOR = 101, 102  # output functions Motor 1 and Motor 2
BOTH_REVERSE = 3  # bits of CA_R_REV
_NO_STICKS = 4  # COM_RC_IN_MODE
_NO_POWER_CHECK = 894281  # CBRK_SUPPLY_CHK: a board on USB measures no battery
_BOARD_CENTRE = 500  # of 0 to 1000; with the default, 0, full speed astern would read as disarmed
_SPEED_SHARE, _TURN_SHARE, _ACCELERATION_SHARE = 0.8, 0.8, 0.5  # of what the rover can, asked for at most
_WAYPOINT_M, _LOOKAHEAD_M = 0.25, 0.5
_TURN_START_DEG, _TURN_END_DEG = 35.0, 8.0  # heading error at which it stops to turn, and drives on
Parameters = dict[str, int | float]


def parameters(rover: RoverModel, handling: Handling, goal_radius_m: float, *, board: bool) -> Parameters:
    """Names and values: whole numbers where PX4's parameter is one."""
    motor, outputs = rover.motor, "HIL_ACT" if board else "PWM_MAIN"
    acceleration = _ACCELERATION_SHARE * motor.max_acceleration_rad_s2 * rover.wheel.radius_m
    fastest_deg_s = degrees(handling.turn_rate_rad_s)
    on_board: Parameters = {
        "SYS_HITL": 1,
        "CBRK_SUPPLY_CHK": _NO_POWER_CHECK,
        "HIL_ACT_DIS1": _BOARD_CENTRE,
        "HIL_ACT_DIS2": _BOARD_CENTRE,
    }
    return {
        "CA_AIRFRAME": DIFFERENTIAL,
        "CA_R_REV": BOTH_REVERSE,
        f"{outputs}_FUNC1": RIGHT_MOTOR,
        f"{outputs}_FUNC2": LEFT_MOTOR,
        **(on_board if board else {}),
        "COM_RC_IN_MODE": _NO_STICKS,
        "RD_WHEEL_TRACK": 2.0 * handling.full_m_s / handling.turn_rate_rad_s,  # that the turn rate behaves like
        "RD_TRANS_DRV_TRN": radians(_TURN_START_DEG),
        "RD_TRANS_TRN_DRV": radians(_TURN_END_DEG),
        "RO_MAX_THR_SPEED": handling.full_m_s,
        "RO_SPEED_LIM": min(CRUISE_M_S, _SPEED_SHARE * handling.full_m_s),
        "RO_ACCEL_LIM": acceleration,
        "RO_DECEL_LIM": acceleration,
        "RO_YAW_RATE_LIM": _TURN_SHARE * fastest_deg_s,
        "RO_YAW_ACCEL_LIM": fastest_deg_s * motor.max_acceleration_rad_s2 / motor.max_speed_rad_s,
        "NAV_ACC_RAD": min(_WAYPOINT_M, 0.5 * goal_radius_m),
        "PP_LOOKAHD_MIN": _LOOKAHEAD_M,
    }


def parameter_text(values: Parameters, about: str) -> str:
    """A QGroundControl parameter file: vehicle, component, name, value and MAVLink type, by tabs."""
    lines = [f"# {about}", "#", "# Vehicle-Id Component-Id Name Value Type"]
    for name, value in values.items():
        whole = isinstance(value, int)
        lines.append("\t".join(("1", "1", name, str(value) if whole else f"{value:.6g}", "6" if whole else "9")))
    return "\n".join(lines) + "\n"
