"""Set points for a foreign vehicle in mode Guided, as its autopilot understands them."""

from __future__ import annotations

import math

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.foreign_discovery import Found
from rover_sim.mavlink.foreign_rules import Turn
from rover_sim.mavlink.geodesy import heading_deg

REFRESH_S = 0.25  # an ArduPilot forgets them after 3 s, a PX4 wants more than two a second
_ONLY_YAW = 2559  # type_mask of SET_POSITION_TARGET_LOCAL_NED: all ignored but the yaw
_NO_RATES = 7  # type_mask of SET_ATTITUDE_TARGET


def turn_message(found: Found, yaw_rad: float, time_s: float) -> Message:
    """Turn on the spot to a heading in the world."""
    heading = math.radians(heading_deg(yaw_rad))
    boot_ms = int(time_s * 1e3) & 0xFFFFFFFF
    target = found.system, found.component
    if found.rules.turn is Turn.ATTITUDE:
        attitude = [math.cos(heading / 2.0), 0.0, 0.0, math.sin(heading / 2.0)]
        return mavlink.MAVLink_set_attitude_target_message(boot_ms, *target, _NO_RATES, attitude, 0.0, 0.0, 0.0, 0.0)
    frame = mavlink.MAV_FRAME_LOCAL_NED
    return mavlink.MAVLink_set_position_target_local_ned_message(
        boot_ms, *target, frame, _ONLY_YAW, *(0.0,) * 9, heading, 0.0
    )
