"""The mission store of an ArduRover 4.6.0-dev as it was measured: not atomic, lossy, with the older request.

The count cuts the stored mission at once, items overwrite in place, item 0 is home whatever is sent.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.wire import WAYPOINT, WireItem

MOST, ASK_S, LIMIT_S = 655, 1.0, 8.0
Sender = tuple[int, int]
_OK, _ERROR, _DENIED = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_DENIED
_PLACED = (
    WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_LAND,
)
_KNOWN = (
    *_PLACED,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_NAV_DELAY,
    mavlink.MAV_CMD_CONDITION_DELAY,
    mavlink.MAV_CMD_DO_CHANGE_SPEED,
    mavlink.MAV_CMD_DO_SET_HOME,
    mavlink.MAV_CMD_DO_SET_REVERSE,
    mavlink.MAV_CMD_DO_JUMP,
)
_FRAMES = {0: 0, 5: 0, 3: 3, 6: 3, 10: 10, 11: 10, 2: 2}  # sent: read back


class ArduMissions:
    """Uploads and downloads; ``changed`` is called at each item that is written, ``done`` at the end of an upload."""

    def __init__(
        self,
        send: Callable[[Message], None],
        say: Callable[[int, str], None],
        home: WireItem,
        changed: Callable[[], None],
        running: Callable[[], bool],
    ) -> None:
        self.items: list[WireItem] = []  # as they read back
        self._send, self._say, self._home, self._changed, self._running = send, say, home, changed, running
        self._sender: Sender | None = None
        self._wanted = self._count = 0
        self._heard_s = self._asked_s = 0.0
        self.torn = False  # an upload has begun and not ended well

    def tick(self, time_s: float) -> None:
        if self._sender is None:
            return
        if time_s - self._heard_s >= LIMIT_S:
            self._ack(self._sender, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            self._say(mavlink.MAV_SEVERITY_WARNING, "Mission upload timeout")
            self._sender = None
        elif time_s - self._asked_s >= ASK_S:
            self._ask(time_s)

    def count(self, message: Message, time_s: float) -> None:
        sender = _sender(message)
        if self._sender not in (None, sender):
            self._ack(sender, _DENIED)
        elif message.count > MOST:
            self._ack(sender, mavlink.MAV_MISSION_NO_SPACE)
            self._say(mavlink.MAV_SEVERITY_WARNING, f"Only {MOST} items are supported")
        else:
            del self.items[message.count :]
            self.torn = True
            self._changed()
            self._sender, self._wanted, self._count, self._heard_s = sender, 0, message.count, time_s
            if message.count == 0:
                self._end(sender)
            else:
                self._ask(time_s)

    def item(self, message: Message, time_s: float) -> None:
        sender = _sender(message)
        if self._sender is None:
            self._ack(sender, _ERROR)
        elif message.seq != self._wanted:
            self._ack(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        elif sender != self._sender:
            self._ack(sender, _DENIED)
        else:
            item = WireItem.of(message)
            result = _check(item)
            if result != _OK:
                self._ack(sender, result)
                self._sender = None
                return
            self._write(message.seq, item)
            self._wanted, self._heard_s = self._wanted + 1, time_s
            if self._wanted == self._count:
                self._end(sender)
            else:
                self._ask(time_s)

    def list(self, message: Message) -> None:
        sender = _sender(message)
        if self._sender is not None:
            self._ack(sender, _DENIED)
        else:
            self._send(mavlink.MAVLink_mission_count_message(*sender, len(self.items)))

    def request(self, message: Message) -> None:
        sender = _sender(message)
        if message.seq >= max(len(self.items), 1):
            self._send(mavlink.MAVLink_mission_count_message(*sender, len(self.items)))
            self._ack(sender, _ERROR)
        else:
            item = self._home if message.seq == 0 else self.items[message.seq]
            self._send(item.message(*sender, message.seq))

    def clear(self, message: Message) -> None:
        sender = _sender(message)
        if self._sender is not None or self._running():
            self._ack(sender, _ERROR)
        else:
            self.items, self.torn = [], False
            self._changed()
            self._ack(sender, _OK)

    def _write(self, seq: int, item: WireItem) -> None:
        self.items[seq : seq + 1] = [_as_stored(item)]
        self._changed()

    def _end(self, sender: Sender) -> None:
        self._sender, self.torn = None, False
        self._ack(sender, _OK)
        self._say(mavlink.MAV_SEVERITY_INFO, "Flight plan received")

    def _ask(self, time_s: float) -> None:
        self._asked_s = time_s
        if self._sender is not None:
            self._send(mavlink.MAVLink_mission_request_message(*self._sender, self._wanted))

    def _ack(self, sender: Sender, result: int) -> None:
        self._send(mavlink.MAVLink_mission_ack_message(*sender, result))


def _sender(message: Message) -> Sender:
    return message.get_srcSystem(), message.get_srcComponent()


def _check(item: WireItem) -> int:
    if item.command not in _KNOWN:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    if item.frame not in _FRAMES:
        return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    for number, value in enumerate(item.params):
        free = number == 3 and item.command in (WAYPOINT, mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LAND)
        if math.isinf(value) or (math.isnan(value) and not free):
            return int(mavlink.MAV_MISSION_INVALID_PARAM1) + number
    if item.command in _PLACED and abs(item.x) > 900_000_000:
        return int(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if item.command in _PLACED and abs(item.y) > 1_800_000_000:
        return int(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    return int(_OK)


def _as_stored(item: WireItem) -> WireItem:
    """What is kept of an item."""
    if item.command not in _PLACED:
        return replace(item, frame=int(mavlink.MAV_FRAME_GLOBAL), x=0, y=0, z=0.0, current=0)
    params = item.params
    if item.command == WAYPOINT:
        params = (float(int(params[0])), 0.0, 0.0, 0.0)
    return replace(item, frame=_FRAMES[item.frame], params=params, z=round(item.z, 2), current=0)
