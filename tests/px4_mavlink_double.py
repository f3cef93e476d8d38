"""The MAVLink side of a PX4 rover in simulated time: mission rules, modes by main and sub mode, readiness.

After PX4's sources as they were read; nothing here was measured, and it is not PX4. Motion goes in, pulses come out.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from rover_sim.mavlink.dialect import Message, mavlink, mission_ack, mission_count, mission_current
from rover_sim.mavlink.plan_ids import plan_id
from rover_sim.mavlink.transport import Transport
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from tests.vehicle_double import HOME, NEUTRAL, VehicleDouble, Wheels, steer_heading, steer_towards, to_wheels
from worlds.scenario import Origin

MANUAL, LOITER, MISSION, OFFBOARD = 1 << 16, 4 << 16 | 3 << 24, 4 << 16 | 4 << 24, 6 << 16
POSITION_S, READY_S = 8.0, 12.0  # the estimator has a position; the pre-arm checks pass
ASK_S, LIMIT_S, STREAM_S = 0.5, 5.0, 1.0
_FRAMES = (0, 2, 3, 5, 6)
_KNOWN = (
    WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_NAV_DELAY,
    mavlink.MAV_CMD_DO_JUMP,
    mavlink.MAV_CMD_DO_CHANGE_SPEED,
)
_OK, _DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
_NOT_NOW, _UNSUPPORTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED, mavlink.MAV_RESULT_UNSUPPORTED
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
Sender = tuple[int, int]


class Px4RoverDouble(VehicleDouble):
    """One PX4 rover with an estimator of its own, which is ready 12 s after the start."""

    autopilot = int(mavlink.MAV_AUTOPILOT_PX4)

    def __init__(self, transport: Transport, home: Origin = HOME) -> None:
        super().__init__(transport, home)
        self.custom_mode = MANUAL
        self.items: tuple[WireItem, ...] = ()
        self.current, self.complete, self.speed_m_s, self.radius_m = 0, False, 1.0, 0.3
        self.driven: list[WireItem] = []
        self.opaque_id = 0
        self._sender: Sender | None = None
        self._incoming: list[WireItem] = []
        self._count = self._last_read = 0
        self._heard_s = self._asked_s = 0.0
        self._heading: tuple[float, float] | None = None  # of the last set point, and its time
        self._first_set_point_s: float | None = None
        self._handlers = {
            "COMMAND_LONG": self._command,
            "MISSION_COUNT": self._counted,
            "MISSION_ITEM_INT": self._item,
            "MISSION_REQUEST_LIST": self._list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_REQUEST": self._request,
            "MISSION_CLEAR_ALL": self._clear,
            "SET_ATTITUDE_TARGET": self._attitude_target,
        }

    def live(self) -> None:
        if self._sender is not None and self.time_s - self._heard_s >= LIMIT_S:
            self._sender = None  # without a word to the sender
            self.say(mavlink.MAV_SEVERITY_WARNING, "Operation timeout")
        elif self._sender is not None and self.time_s - self._asked_s >= ASK_S:
            self._ask()
        if self._heading is not None and self.time_s - self._heading[1] > STREAM_S:
            self._heading = self._first_set_point_s = None
            if self.custom_mode == OFFBOARD:
                self.custom_mode = LOITER

    def streamed(self, message_id: int) -> Message | None:
        if message_id == mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS:
            flags = 0x1F if self.time_s >= POSITION_S else 0x07
            return mavlink.MAVLink_estimator_status_message(int(self.time_s * 1e6), flags, *(0.0,) * 8)
        if message_id == mavlink.MAVLINK_MSG_ID_SYS_STATUS:
            health = _PREARM if self.time_s >= READY_S else 0
            return mavlink.MAVLink_sys_status_message(_PREARM, _PREARM, health, 0, 65535, -1, -1, 0, 0, 0, 0, 0, 0)
        if message_id == mavlink.MAVLINK_MSG_ID_MISSION_CURRENT:
            state = 1 if not self.items else 5 if self.complete else 3 if self.custom_mode == MISSION else 2
            return mission_current(self.current, len(self.items), state, 0, (self.opaque_id, 0, 0))
        return super().streamed(message_id)

    # Commands

    def _command(self, message: Message) -> None:
        self.commands.append(message.command)
        answers: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_DO_SET_MODE: lambda m: self.set_mode(int(m.param2) << 16 | int(m.param3) << 24),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
        }
        answer = answers.get(message.command)
        result = _UNSUPPORTED if answer is None else answer(message)
        sender = message.get_srcSystem(), message.get_srcComponent()
        self.send(mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *sender))

    def _arm(self, message: Message) -> int:
        if message.param1 == 1.0 and self.time_s < READY_S:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, "Arming denied: Resolve system health failures first")
            return int(_NOT_NOW)
        self.armed = message.param1 == 1.0
        return int(_OK)

    def set_mode(self, number: int) -> int:
        """As DO_SET_MODE, or a person at a ground station."""
        if number not in (MANUAL, LOITER, MISSION, OFFBOARD):
            return int(_UNSUPPORTED)
        streaming = self._first_set_point_s is not None and self.time_s - self._first_set_point_s >= STREAM_S
        refused = (
            (number != MANUAL and self.time_s < POSITION_S)
            or (number == MISSION and not self.items)
            or (number == OFFBOARD and not streaming)
        )
        if refused:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, "Switching to mode is currently not available")
            return int(_NOT_NOW)
        self.custom_mode = number
        return int(_OK)

    def _set_interval(self, message: Message) -> int:
        self.set_interval(int(message.param1), message.param2)
        return int(_OK)

    def _change_speed(self, message: Message) -> int:
        self.speed_m_s = message.param2
        return int(_OK)

    # Mission protocol

    def _counted(self, message: Message) -> None:
        sender = _sender(message)
        if self._sender is not None and (sender != self._sender or self._incoming):
            self._ack(sender, mavlink.MAV_MISSION_ERROR)
        elif message.count > 500:
            self._ack(sender, mavlink.MAV_MISSION_NO_SPACE)
        elif message.count == 0:
            self._store([], sender)
        else:
            self._sender, self._incoming, self._count, self._heard_s = sender, [], message.count, self.time_s
            self._ask()

    def _item(self, message: Message) -> None:
        sender = _sender(message)
        if self._sender is None:
            if message.seq == len(self.items) - 1:  # the last one again: its result was lost
                self._ack(sender, mavlink.MAV_MISSION_ACCEPTED)
            return
        if sender != self._sender or message.seq != len(self._incoming):
            return
        item, result = WireItem.of(message), mavlink.MAV_MISSION_ACCEPTED
        if item.frame not in _FRAMES:
            result = mavlink.MAV_MISSION_UNSUPPORTED_FRAME
        elif item.command not in _KNOWN:
            result = mavlink.MAV_MISSION_UNSUPPORTED
        if result != mavlink.MAV_MISSION_ACCEPTED:
            self._sender = None  # the old mission stays
            self._ack(sender, result)
            return
        self._incoming.append(item)
        self._heard_s = self.time_s
        if len(self._incoming) == self._count:
            self._store(self._incoming, sender)
        else:
            self._ask()

    def _store(self, items: list[WireItem], sender: Sender) -> None:
        self.items, self.opaque_id, self._sender = tuple(items), plan_id(items), None
        self.current, self.complete = 0, False
        self._skip()
        self.send(mission_ack(*sender, mavlink.MAV_MISSION_ACCEPTED, 0, self.opaque_id))

    def _list(self, message: Message) -> None:
        if self._sender is None:
            self._last_read = 0
            self.send(mission_count(*_sender(message), len(self.items), 0, self.opaque_id))

    def _request(self, message: Message) -> None:
        sender = _sender(message)
        if message.seq not in (self._last_read, self._last_read - 1, self._last_read + 1) or (
            message.seq >= len(self.items)
        ):
            self._ack(sender, mavlink.MAV_MISSION_ERROR)
            return
        self._last_read = message.seq
        self.send(self.items[message.seq].message(*sender, message.seq))

    def _clear(self, message: Message) -> None:
        self._store([], _sender(message))

    def _ask(self) -> None:
        self._asked_s = self.time_s
        if self._sender is not None:
            self.send(mavlink.MAVLink_mission_request_int_message(*self._sender, len(self._incoming)))

    def _ack(self, sender: Sender, result: int) -> None:
        self.send(mavlink.MAVLink_mission_ack_message(*sender, result))

    # Driving

    def drive(self) -> Wheels:
        if self.custom_mode == OFFBOARD and self._heading is not None:
            return to_wheels(*steer_heading(self.motion, self._heading[0], 0.0, self.gains))
        if self.custom_mode != MISSION or self.complete or self.current >= len(self.items):
            return NEUTRAL, NEUTRAL
        item = self.items[self.current]
        if not self.driven or self.driven[-1] is not item:
            self.driven.append(item)
        north, east = self.metres(item.x, item.y)
        if math.hypot(north - self.motion.north_m, east - self.motion.east_m) > self.radius_m:
            return to_wheels(*steer_towards(self.motion, north, east, self.speed_m_s, self.gains))
        self.send(mavlink.MAVLink_mission_item_reached_message(self.current))
        self.current += 1
        self._skip()
        return NEUTRAL, NEUTRAL

    def _skip(self) -> None:
        """Carry out what is no place."""
        while self.current < len(self.items) and self.items[self.current].command != WAYPOINT:
            item = self.items[self.current]
            if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
                self.speed_m_s = item.params[1]
            self.current += 1
        if self.items and self.current >= len(self.items):
            self.current, self.complete = len(self.items) - 1, True

    def _attitude_target(self, message: Message) -> None:
        w, _, _, z = message.q
        if self._first_set_point_s is None:
            self._first_set_point_s = self.time_s
        self._heading = 2.0 * math.atan2(z, w), self.time_s


def _sender(message: Message) -> Sender:
    return message.get_srcSystem(), message.get_srcComponent()
