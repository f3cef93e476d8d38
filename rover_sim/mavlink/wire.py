"""Mission items as they are on the wire, and their translation to the autopilot's typed items and back."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from rover_sim.autopilot.mission import (
    DriveTo,
    Home,
    Item,
    Jump,
    ReturnHome,
    SetFence,
    SetHome,
    SetReverse,
    SetSpeed,
    TurnTo,
    Wait,
)
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.geodesy import DEGREES_E7, GeoPoint, LocalFrame, yaw_rad
from worlds.types import Vector3

_ABSOLUTE = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_RELATIVE = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
FARTHEST_M = 20_000.0  # beyond this an item is a mistake, such as a plan for another continent

WAYPOINT = mavlink.MAV_CMD_NAV_WAYPOINT


@dataclass(frozen=True)
class WireItem:
    """The fields of MISSION_ITEM_INT that describe an item, as received: a download repeats them exactly."""

    frame: int
    command: int
    params: tuple[float, float, float, float]
    x: int  # degrees * 1e7 in a global frame
    y: int
    z: float
    autocontinue: int = 1
    current: int = 0

    @classmethod
    def of(cls, message: Message) -> WireItem:
        """The item in a MISSION_ITEM_INT."""
        params = (message.param1, message.param2, message.param3, message.param4)
        return cls(
            message.frame,
            message.command,
            params,
            message.x,
            message.y,
            message.z,
            message.autocontinue,
            message.current,
        )

    def message(self, system: int, component: int, seq: int, kind: int = mavlink.MAV_MISSION_TYPE_MISSION) -> Message:
        """MISSION_ITEM_INT to a component; ``kind`` is a MAV_MISSION_TYPE."""
        head = (system, component, seq, self.frame, self.command, 0, self.autocontinue)
        return mavlink.MAVLink_mission_item_int_message(*head, *self.params, self.x, self.y, self.z, kind)

    @property
    def is_home(self) -> bool:
        """Whether this item, sent first, is the home position of an ArduPilot item list.

        Ground stations that know the rule send home as a waypoint in the absolute frame; see docs/mavlink.md.
        """
        return self.command == WAYPOINT and (self.frame in _ABSOLUTE or self.is_blank)

    @property
    def is_blank(self) -> bool:
        """A waypoint without a place: MAVSDK uploads it alone, as home, to clear the mission of an ArduPilot."""
        return self.command == WAYPOINT and self.x == 0 and self.y == 0


class RefusedItemError(Exception):
    """An item that the vehicle cannot take; carries the MAV_MISSION_RESULT for its sender."""

    def __init__(self, result: int) -> None:
        super().__init__(f"mission item refused with result {result}")
        self.result = result


def typed_item(item: WireItem, frame: LocalFrame, home_w: Vector3, *, may_be_home: bool) -> Item:
    """The autopilot's item; raises RefusedItemError with the exact reason. NaN stands for "not given" everywhere."""
    if may_be_home and item.is_home:
        _check_degrees(item)
        return Home()
    if item.command in (WAYPOINT, mavlink.MAV_CMD_NAV_LOITER_TIME):
        radius = _given(item.params[1]) if item.command == WAYPOINT else 0.0
        return DriveTo(place_in(item, frame, home_w), _least(_given(item.params[0]), 1), _least(radius, 2))
    if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
        return DriveTo(place_in(item, frame, home_w), math.inf)
    if item.command == mavlink.MAV_CMD_DO_SET_HOME:
        there = replace(item, z=math.nan)  # at the height of the home that it replaces
        return SetHome(None if item.params[0] == 1.0 else place_in(there, frame, home_w))
    make = _PLACELESS.get(item.command)
    if make is None:
        raise RefusedItemError(mavlink.MAV_MISSION_UNSUPPORTED)
    return make(*(_given(value) for value in item.params))


def turn_item(angle_deg: float, direction: float, relative: float) -> TurnTo:
    """CONDITION_YAW: absolute compass heading (shortest way), or an angle with its direction (-1 is left)."""
    if not math.isfinite(angle_deg):
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1)
    if relative:
        return TurnTo(math.radians(angle_deg) * (1.0 if direction < 0 else -1.0), relative=True)
    return TurnTo(yaw_rad(angle_deg))


def place_of(x_e7: float, y_e7: float, altitude_m: float, frame: LocalFrame) -> Vector3 | None:
    """World position of coordinates in 1e-7 degrees; None if they are no place on Earth or much too far away."""
    latitude, longitude = x_e7 / DEGREES_E7, y_e7 / DEGREES_E7
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        return None
    place = frame.to_world(GeoPoint(latitude, longitude, altitude_m))
    return place if math.hypot(place[0], place[1]) <= FARTHEST_M else None


def place_in(item: WireItem, frame: LocalFrame, home_w: Vector3) -> Vector3:
    """World position of an item; raises RefusedItemError for a frame or a place that cannot be."""
    if item.frame not in (*_ABSOLUTE, *_RELATIVE):
        raise RefusedItemError(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    home_altitude = frame.to_geo(home_w).altitude_m
    # NaN: no height given. A rover drives on the ground whatever the height says.
    above = item.z if math.isfinite(item.z) else 0.0
    altitude = above if item.frame in _ABSOLUTE and math.isfinite(item.z) else home_altitude + above
    _check_degrees(item)
    place = place_of(item.x, item.y, altitude, frame)
    if place is None:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID)
    return place


def _check_degrees(item: WireItem) -> None:
    if abs(item.x) > 90.0 * DEGREES_E7:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if abs(item.y) > 180.0 * DEGREES_E7:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM6_Y)


def _least(value: float, param: int) -> float:
    """A finite number of at least 0."""
    if not 0.0 <= value < math.inf:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1 + param - 1)
    return value


def _above_zero(value: float, param: int) -> float:
    if not 0.0 < value < math.inf:
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1 + param - 1)
    return value


def _whole(value: float, least: int, param: int, most: int = 65535) -> int:
    if not (least <= value <= most and float(value).is_integer()):
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1 + param - 1)
    return int(value)


def _given(value: float) -> float:
    return 0.0 if math.isnan(value) else value


_PLACELESS: Mapping[int, Callable[[float, float, float, float], Item]] = {
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda *_: ReturnHome(),
    mavlink.MAV_CMD_CONDITION_DELAY: lambda seconds, *_: Wait(_least(seconds, 1)),
    mavlink.MAV_CMD_NAV_DELAY: lambda seconds, *_: Wait(_least(seconds, 1)),  # -1 would be a time of day
    mavlink.MAV_CMD_DO_JUMP: lambda index, times, *_: Jump(_whole(index, 0, 1), _whole(times, -1, 2)),
    mavlink.MAV_CMD_DO_FENCE_ENABLE: lambda on, *_: SetFence(on=bool(_whole(on, 0, 1, 1))),
    mavlink.MAV_CMD_CONDITION_YAW: lambda angle, _rate, direction, relative: turn_item(angle, direction, relative),
    mavlink.MAV_CMD_DO_CHANGE_SPEED: lambda _kind, speed, *_: SetSpeed(_above_zero(speed, 2)),
    mavlink.MAV_CMD_DO_SET_REVERSE: lambda reverse, *_: SetReverse(reverse=bool(reverse)),
}
