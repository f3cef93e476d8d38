"""Plans in world coordinates as mission items, home first as ArduPilot numbers them."""

from __future__ import annotations

from collections.abc import Sequence

from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.geodesy import LocalFrame, heading_deg
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from worlds.types import FloatArray, Vector3

CRUISE_M_S = 0.6
RISK_SLOWING = 0.5  # share of the cruise speed that full risk takes
_NONE = (0.0, 0.0, 0.0, 0.0)


def mission_items(
    waypoints_w: Sequence[Vector3], frame: LocalFrame, home_w: Vector3, speed_m_s: float | None = None
) -> list[WireItem]:
    """Home, a speed if given, and the waypoints, all with heights above home."""
    return [
        home_item(frame, home_w),
        *_speed(speed_m_s),
        *(_waypoint(place, frame, home_w) for place in waypoints_w),
    ]


def way_items(
    ahead_w: FloatArray, height_m: float, frame: LocalFrame, home_w: Vector3, speed_m_s: float
) -> list[WireItem]:
    """The mission of the waypoints (N, 2) ahead of the rover, all at one height."""
    places = [(float(x), float(y), height_m) for x, y in ahead_w]
    return mission_items(places, frame, home_w, round(speed_m_s, 2))


def risky_speed(risk: float) -> float:
    """Speed (m/s) of a way of ``risk`` 0..1."""
    return CRUISE_M_S * (1.0 - RISK_SLOWING * risk)


def backing_items(
    places_w: Sequence[Vector3], frame: LocalFrame, home_w: Vector3, speed_m_s: float | None = None
) -> list[WireItem]:
    """Back up through places behind the rover, at a speed if given, then drive forwards again."""
    return [
        home_item(frame, home_w),
        *_speed(speed_m_s),
        _command(mavlink.MAV_CMD_DO_SET_REVERSE, 1.0),
        *(_waypoint(place, frame, home_w) for place in places_w),
        _command(mavlink.MAV_CMD_DO_SET_REVERSE, 0.0),
    ]


def turning_items(yaw_rad: float, frame: LocalFrame, home_w: Vector3) -> list[WireItem]:
    """Turn on the spot to a heading in the world."""
    return [home_item(frame, home_w), _command(mavlink.MAV_CMD_CONDITION_YAW, heading_deg(yaw_rad))]


def home_item(frame: LocalFrame, home_w: Vector3) -> WireItem:
    """Item 0: the home position, a waypoint in the absolute frame."""
    place = frame.to_geo(home_w)
    return WireItem(
        mavlink.MAV_FRAME_GLOBAL, WAYPOINT, _NONE, place.latitude_e7, place.longitude_e7, _millimetres(place.altitude_m)
    )


def _waypoint(place_w: Vector3, frame: LocalFrame, home_w: Vector3) -> WireItem:
    place = frame.to_geo(place_w)
    above_home = _millimetres(place.altitude_m - frame.to_geo(home_w).altitude_m)
    relative = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return WireItem(relative, WAYPOINT, _NONE, place.latitude_e7, place.longitude_e7, above_home)


def _speed(speed_m_s: float | None) -> list[WireItem]:
    return [] if speed_m_s is None else [_command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0)]


def _command(command: int, *parameters: float) -> WireItem:
    one, two, three, four = (*parameters, *(0.0,) * (4 - len(parameters)))
    return WireItem(mavlink.MAV_FRAME_MISSION, command, (one, two, three, four), 0, 0, 0.0)


def _millimetres(height_m: float) -> float:
    return round(height_m, 3)
