"""What each MAVLink command does; an unknown command is refused at once by `command_server`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rover_sim.autopilot.admission import target_refusal
from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.geodesy import DEGREES_E7
from rover_sim.mavlink.parameter_server import parameter_value
from rover_sim.mavlink.telemetry import Telemetry
from rover_sim.mavlink.wire import RefusedItemError, place_of, turn_item
from worlds.types import Vector3

ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
DENIED = int(mavlink.MAV_RESULT_DENIED)
FAILED = int(mavlink.MAV_RESULT_FAILED)
UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)
_EMERGENCY_STOP, _FORCE_ARM = 21196.0, 2989.0


@dataclass(frozen=True, eq=False)
class Request:
    """A command as COMMAND_LONG or COMMAND_INT brought it; ``p5``, ``p6`` are degrees whichever it was."""

    client: Client
    command: int
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    p6: float
    p7: float

    @classmethod
    def of(cls, client: Client, message: Message) -> Request:
        """The command in a COMMAND_LONG or COMMAND_INT."""
        parameters = (message.param1, message.param2, message.param3, message.param4)
        if message.get_type() == "COMMAND_INT":
            place = (message.x / DEGREES_E7, message.y / DEGREES_E7, message.z)
        else:
            place = (message.param5, message.param6, message.param7)
        return cls(client, message.command, *parameters, *place)


Action = Callable[[Context, Telemetry, Request], int]


def _arm(context: Context, _telemetry: Telemetry, request: Request) -> int:
    if request.p1 == 0.0:
        context.autopilot.disarm()
        return ACCEPTED
    if request.p1 != 1.0:
        return DENIED
    return _result(context.autopilot.arm(force=request.p2 == _FORCE_ARM))


def _set_mode(context: Context, _telemetry: Telemetry, request: Request) -> int:
    custom = math.isfinite(request.p1) and int(request.p1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    mode = context.persona.commanded_mode(request.p2, request.p3) if custom else None
    if mode is Mode.GUIDED and context.persona.px4_modes:
        context.autopilot.end_guided_task()  # a place is driven to in Hold: whoever asks for Offboard leaves it
    return UNSUPPORTED if mode is None else _result(context.autopilot.set_mode(mode))


def _mission_start(context: Context, _telemetry: Telemetry, request: Request) -> int:
    first = request.p1
    if first >= 1.0 and not (math.isfinite(first) and context.autopilot.set_current(int(first))):
        return DENIED
    return _result(context.autopilot.start_mission())


def _set_current(context: Context, _telemetry: Telemetry, request: Request) -> int:
    found = math.isfinite(request.p1) and context.autopilot.set_current(int(request.p1))
    return ACCEPTED if found else DENIED


def _reposition(context: Context, _telemetry: Telemetry, request: Request) -> int:
    if context.persona.px4_modes and math.isnan(request.p5) and math.isnan(request.p6):
        return _result(context.autopilot.set_mode(Mode.HOLD))  # "stay where you are", QGroundControl's pause
    place = _place(context, request)
    if place is None:
        return DENIED
    fenced = target_refusal(context.autopilot, context.estimate, place) is not None
    reason = context.autopilot.goto(place)
    return DENIED if fenced else _result(reason)


def _change_speed(context: Context, _telemetry: Telemetry, request: Request) -> int:
    if not 0.0 < request.p2 < math.inf:
        return DENIED
    context.autopilot.set_speed(request.p2)
    return ACCEPTED


def _yaw(context: Context, _telemetry: Telemetry, request: Request) -> int:
    try:
        turn = turn_item(request.p1, request.p3, 1.0 if request.p4 == 1.0 else 0.0)
    except RefusedItemError:
        return DENIED
    return _result(context.autopilot.turn(turn.heading_rad, relative=turn.relative))


def _return(context: Context, _telemetry: Telemetry, _request: Request) -> int:
    return _result(context.autopilot.set_mode(Mode.RETURN))


def _set_home(context: Context, _telemetry: Telemetry, request: Request) -> int:
    place = _here(context) if request.p1 == 1.0 else _place(context, request)
    if place is None:
        return DENIED
    context.autopilot.home_w = place
    return ACCEPTED


def _fence_enable(context: Context, _telemetry: Telemetry, request: Request) -> int:
    """Sets FENCE_ENABLE; a PX4 has no such switch, and a rover no floor to lift alone (2)."""
    parameters = context.autopilot.parameters
    if "FENCE_ENABLE" not in parameters:
        return UNSUPPORTED
    if request.p1 not in (0.0, 1.0):
        return DENIED
    parameters.set("FENCE_ENABLE", request.p1)
    context.endpoint.broadcast(parameter_value(context, "FENCE_ENABLE"))
    return ACCEPTED


def _prearm(context: Context, _telemetry: Telemetry, _request: Request) -> int:
    return _result(context.autopilot.prearm_reason())


def _pause(context: Context, _telemetry: Telemetry, request: Request) -> int:
    if request.p1 not in (0.0, 1.0):
        return DENIED
    return _result(context.autopilot.set_mode(Mode.HOLD if request.p1 == 0.0 else Mode.AUTO))


def _storage(_context: Context, _telemetry: Telemetry, request: Request) -> int:
    """Parameters are stored as they are set; reading them back (0) and resetting them (2) are not supported."""
    return ACCEPTED if request.p1 == 1.0 else UNSUPPORTED


def _request_message(_context: Context, telemetry: Telemetry, request: Request) -> int:
    known = math.isfinite(request.p1) and telemetry.send(request.client, int(request.p1), request.p2)
    return ACCEPTED if known else UNSUPPORTED


def _set_interval(_context: Context, telemetry: Telemetry, request: Request) -> int:
    known = math.isfinite(request.p1) and telemetry.set_interval(request.client, int(request.p1), request.p2)
    return ACCEPTED if known else DENIED


def _get_interval(context: Context, _telemetry: Telemetry, request: Request) -> int:
    if not 0.0 <= request.p1 <= 65535.0:
        return DENIED
    interval = request.client.channel.streams.interval_us(int(request.p1))
    answer = mavlink.MAVLink_message_interval_message(int(request.p1), interval)
    context.endpoint.reply(request.client, answer)
    return ACCEPTED


def _capabilities(_context: Context, telemetry: Telemetry, request: Request) -> int:
    telemetry.send(request.client, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    return ACCEPTED


def _get_home(_context: Context, telemetry: Telemetry, request: Request) -> int:
    telemetry.send(request.client, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    return ACCEPTED


ACTIONS: Mapping[int, Action] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_CONDITION_YAW: _yaw,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    mavlink.MAV_CMD_PREFLIGHT_STORAGE: _storage,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_DO_FENCE_ENABLE: _fence_enable,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS: _prearm,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _capabilities,
    mavlink.MAV_CMD_GET_HOME_POSITION: _get_home,
}


def _result(reason: str | None) -> int:
    return ACCEPTED if reason is None else FAILED


def _here(context: Context) -> Vector3 | None:
    if context.estimate is None:
        return None
    x, y, z = (float(value) for value in context.estimate.pose.position_w)
    return x, y, z


def _place(context: Context, request: Request) -> Vector3 | None:
    """The command's place; None if it is none. NaN as height means "on the ground", which is where a rover goes."""
    if not (math.isfinite(request.p5) and math.isfinite(request.p6)):
        return None
    altitude = context.frame.to_geo(context.autopilot.home_w).altitude_m
    return place_of(request.p5 * DEGREES_E7, request.p6 * DEGREES_E7, altitude, context.frame)
