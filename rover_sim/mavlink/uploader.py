"""Mission upload from the sender's side: COUNT, then whatever the vehicle asks for, until its result.

The vehicle leads: it asks for each item and asks again for a lost one. The sender's own timer only wakes up a
vehicle that says nothing at all. 1.5 s is the mission protocol's figure; its 5 retries are too few for a bad link:
where 40 % of the frames are lost, the result of one upload in 15 would never be known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.plan_ids import plan_id
from rover_sim.mavlink.wire import WireItem

RETRY_S = 1.5
RETRIES = 15
_RESULTS = {
    mavlink.MAV_MISSION_ERROR: "error",
    mavlink.MAV_MISSION_UNSUPPORTED_FRAME: "frame not supported",
    mavlink.MAV_MISSION_UNSUPPORTED: "command not supported",
    mavlink.MAV_MISSION_NO_SPACE: "too many items",
    mavlink.MAV_MISSION_INVALID: "invalid item",
    **{mavlink.MAV_MISSION_INVALID_PARAM1 + number: f"parameter {number + 1} not possible" for number in range(4)},
    mavlink.MAV_MISSION_INVALID_PARAM5_X: "latitude not possible",
    mavlink.MAV_MISSION_INVALID_PARAM6_Y: "longitude not possible",
    mavlink.MAV_MISSION_INVALID_PARAM7: "altitude not possible",
    mavlink.MAV_MISSION_DENIED: "denied: another ground station is transferring",
    mavlink.MAV_MISSION_OPERATION_CANCELLED: "cancelled by the vehicle",
}


class UploadState(StrEnum):
    """How far an upload is."""

    SENDING = "sending"
    DONE = "done"
    FAILED = "failed"
    REPLACED = "replaced"  # a newer plan came before this one began


@dataclass
class Upload:
    """One upload; its owner looks at ``state`` and, when it failed, at ``reason``."""

    number: int
    items: tuple[WireItem, ...]
    state: UploadState = UploadState.SENDING
    reason: str = ""
    opaque_id: int = 0  # that the vehicle gives it
    result: int | None = None  # MAV_MISSION_RESULT of a refusal
    refused_item: int | None = None  # sent last before the refusal


class Uploader:
    """Sends one mission at a time; of those that wait, only the newest is kept."""

    def __init__(self, send: Callable[[Message], None], system: int, component: int) -> None:
        self._send = send
        self.target = system, component
        self._active: Upload | None = None
        self._waiting: Upload | None = None
        self._count = 0
        self._last: int | None = None  # the item sent last; None: only the count so far
        self._sent_s = 0.0
        self._retries = 0

    @property
    def busy(self) -> bool:
        """Whether a transfer is in progress."""
        return self._active is not None

    def upload(self, items: Sequence[WireItem], time_s: float) -> Upload:
        """Begin an upload, or let it wait for the end of the one in progress."""
        self._count += 1
        upload = Upload(self._count, tuple(items), opaque_id=plan_id(items))  # as our own vehicle will make it
        if self._waiting is not None:
            self._waiting.state = UploadState.REPLACED
            self._waiting = None
        if self._active is None:
            self._begin(upload, time_s)
        else:
            self._waiting = upload
        return upload

    def tick(self, time_s: float) -> None:
        """Repeat what was not answered; give up after the last retry."""
        if self._active is None or time_s - self._sent_s < RETRY_S:
            return
        if self._retries >= RETRIES:
            self._end(UploadState.FAILED, "the vehicle does not answer", time_s)
            return
        self._retries += 1
        self._say(self._last, time_s)

    def requested(self, message: Message, time_s: float) -> None:
        """MISSION_REQUEST_INT or the older MISSION_REQUEST: both are answered with MISSION_ITEM_INT."""
        if self._active is None or message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            return
        if message.seq < len(self._active.items):
            self._retries = 0
            self._say(message.seq, time_s)

    def acknowledged(self, message: Message, time_s: float) -> None:
        """MISSION_ACK: the result, except for ArduPilot's complaint about the order, which ends nothing."""
        if self._active is None or message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            return
        if message.type == mavlink.MAV_MISSION_INVALID_SEQUENCE:
            return
        if message.type != mavlink.MAV_MISSION_ACCEPTED:
            self._active.result, self._active.refused_item = message.type, self._last
            self._end(UploadState.FAILED, _RESULTS.get(message.type, f"refused with result {message.type}"), time_s)
        elif not self._active.items or self._last == len(self._active.items) - 1:
            self._active.opaque_id = message.opaque_id or self._active.opaque_id
            self._end(UploadState.DONE, "", time_s)  # an earlier one belongs to the upload before

    def _begin(self, upload: Upload, time_s: float) -> None:
        self._active, self._retries = upload, 0
        self._say(None, time_s)

    def _say(self, seq: int | None, time_s: float) -> None:
        if self._active is None:
            return
        self._last, self._sent_s = seq, time_s
        items = self._active.items
        if seq is None:
            self._send(mavlink.MAVLink_mission_count_message(*self.target, len(items)))
        else:
            self._send(items[seq].message(*self.target, seq))

    def _end(self, state: UploadState, reason: str, time_s: float) -> None:
        if self._active is not None:
            self._active.state, self._active.reason = state, reason
        self._active, waiting, self._waiting = None, self._waiting, None
        if waiting is not None:
            self._begin(waiting, time_s)
