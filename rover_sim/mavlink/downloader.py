"""Mission download from the reader's side: the count, then item after item, then a last word.

PX4 gives out the item asked for and the one before only, and wants the last word; ArduPilot needs neither.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.geodesy import DEGREES_E7
from rover_sim.mavlink.wire import WireItem

RETRY_S = 0.7
RETRIES = 15
_MISSION = mavlink.MAV_MISSION_TYPE_MISSION


@dataclass
class Download:
    """One download; its owner looks at ``items`` once it is ``done``, and at ``reason`` if it failed."""

    items: list[WireItem] = field(default_factory=list)
    done: bool = False
    reason: str = ""


class Downloader:
    """Reads the mission of one vehicle, one download at a time; a new one ends that before."""

    def __init__(self, send: Callable[[Message], None], system: int, component: int) -> None:
        self.target = system, component
        self._send = send
        self._active: Download | None = None
        self._count: int | None = None
        self._asked_s = 0.0
        self._tries = 0
        self._refusal = ""
        self.handlers: Mapping[str, Callable[[Message, float], None]] = {
            "MISSION_COUNT": self._counted,
            "MISSION_ITEM_INT": lambda message, time_s: self._received(message, WireItem.of(message), time_s),
            "MISSION_ITEM": lambda message, time_s: self._received(message, _of_floats(message), time_s),
        }

    @property
    def busy(self) -> bool:
        """Whether a download is in progress."""
        return self._active is not None

    def start(self, time_s: float) -> Download:
        """Begin a download."""
        self._active, self._count, self._tries, self._refusal = Download(), None, 0, ""
        self._ask(time_s)
        return self._active

    def tick(self, time_s: float) -> None:
        """Ask again for what has not come; give up after the last retry."""
        if self._active is None or time_s - self._asked_s < RETRY_S:
            return
        if self._tries >= RETRIES:
            self._end(self._refusal or "the vehicle does not answer")
            return
        self._tries += 1
        self._ask(time_s)

    def _counted(self, message: Message, time_s: float) -> None:
        if self._active is None or self._count is not None or message.mission_type != _MISSION:
            return
        self._count, self._tries = message.count, 0
        self._next(time_s)

    def _received(self, message: Message, item: WireItem, time_s: float) -> None:
        active = self._active
        wanted = active is not None and message.mission_type == _MISSION and message.seq == len(active.items)
        if active is None or self._count is None or not wanted:
            return
        active.items.append(item)
        self._tries = 0
        self._next(time_s)

    def refused(self, message: Message) -> None:
        """MISSION_ACK: not now, or the late result of an upload; so asking goes on until the last retry."""
        self._refusal = f"the vehicle refuses to be read, with result {message.type}"

    def _next(self, time_s: float) -> None:
        if self._active is not None and len(self._active.items) == self._count:
            self._send(mavlink.MAVLink_mission_ack_message(*self.target, mavlink.MAV_MISSION_ACCEPTED))
            self._end("")
        else:
            self._ask(time_s)

    def _ask(self, time_s: float) -> None:
        self._asked_s = time_s
        if self._count is None:
            self._send(mavlink.MAVLink_mission_request_list_message(*self.target))
        elif self._active is not None:
            self._send(mavlink.MAVLink_mission_request_int_message(*self.target, len(self._active.items)))

    def _end(self, reason: str) -> None:
        if self._active is not None:
            self._active.done, self._active.reason = not reason, reason
        self._active = None


def _of_floats(message: Message) -> WireItem:
    """The item in a MISSION_ITEM, whose places are degrees."""
    placed = message.frame != mavlink.MAV_FRAME_MISSION
    scale = DEGREES_E7 if placed else 1.0
    params = (message.param1, message.param2, message.param3, message.param4)
    x, y = round(message.x * scale), round(message.y * scale)
    return WireItem(message.frame, message.command, params, x, y, message.z, message.autocontinue, message.current)
