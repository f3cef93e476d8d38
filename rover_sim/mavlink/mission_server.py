"""Mission upload: one transfer at a time, re-asked by timer, committed only when complete.

Rules: the MAVLink mission protocol, and where real clients differ, the table in docs/mavlink.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.geodesy import DEGREES_E7
from rover_sim.mavlink.mission_store import CAPACITY, MissionStore
from rover_sim.mavlink.status import status_texts
from rover_sim.mavlink.wire import RefusedItemError, WireItem, place_of

REASK_S = 0.5
STALLED_S = 8.0
_REMEMBERED = 16  # clients whose last result is kept for repeated items
_ACCEPTED = int(mavlink.MAV_MISSION_ACCEPTED)


@dataclass
class _Upload:
    """The transfer in progress."""

    client: Client
    count: int
    heard_s: float  # the last item that was news
    asked_s: float
    items: list[WireItem] = field(default_factory=list)


class MissionServer:
    """Takes missions; other lists (fence, rally) are empty and stay so."""

    def __init__(self, context: Context, store: MissionStore) -> None:
        self._context = context
        self._store = store
        self._upload: _Upload | None = None
        self._finished: dict[Client, tuple[int, int]] = {}  # count and result of each client's last transfer

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """The messages of an upload."""
        return {
            "MISSION_COUNT": self._begin,
            "MISSION_ITEM_INT": self._take_int,
            "MISSION_ITEM": self._take_float,
            "MISSION_ACK": self._cancelled,
            "MISSION_WRITE_PARTIAL_LIST": self._refuse_partial,
        }

    @property
    def receiving(self) -> bool:
        """Whether a transfer is in progress."""
        return self._upload is not None

    def tick(self) -> None:
        """Ask again for an item that does not come; give up after 8 s without news."""
        upload = self._upload
        if upload is None:
            return
        if self._context.time_s - upload.heard_s >= STALLED_S:
            self._say("Mission upload timeout")
            self._end(upload, mavlink.MAV_MISSION_OPERATION_CANCELLED)
        elif self._context.time_s - upload.asked_s >= REASK_S:
            self._ask(upload)

    def acknowledge(self, client: Client, result: int, mission_type: int = mavlink.MAV_MISSION_TYPE_MISSION) -> None:
        """MISSION_ACK to one client."""
        answer = mavlink.MAVLink_mission_ack_message(client.system, client.component, result, mission_type)
        self._context.endpoint.reply(client, answer)

    def abandon(self, client: Client) -> bool:
        """End the client's own transfer without a result; False if somebody else's is in progress."""
        if self._upload is not None and self._upload.client != client:
            return False
        self._upload = None
        return True

    def _begin(self, client: Client, message: Message) -> None:
        if message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            listed = (mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY)
            nothing = message.mission_type in listed and message.count == 0  # no items into an empty list
            self.acknowledge(client, _ACCEPTED if nothing else mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
        elif not self.abandon(client):
            self.acknowledge(client, mavlink.MAV_MISSION_DENIED)
        elif message.count > CAPACITY:
            self._say(f"Mission of {message.count} items refused, at most {CAPACITY}")
            self.acknowledge(client, mavlink.MAV_MISSION_NO_SPACE)
        else:
            self._finished.pop(client, None)
            now = self._context.time_s
            self._upload = _Upload(client, message.count, now, now)
            self._go_on(self._upload)

    def _take_int(self, client: Client, message: Message) -> None:
        self._take(client, message, WireItem.of(message))

    def _take_float(self, client: Client, message: Message) -> None:
        """The older MISSION_ITEM, with degrees; refused as out of range if they are no numbers."""
        if not (math.isfinite(message.x) and math.isfinite(message.y) and abs(message.x) + abs(message.y) < 400.0):
            self.acknowledge(client, mavlink.MAV_MISSION_INVALID_PARAM5_X, message.mission_type)
            return
        message.x, message.y = round(message.x * DEGREES_E7), round(message.y * DEGREES_E7)
        self._take(client, message, WireItem.of(message))

    def _take(self, client: Client, message: Message, item: WireItem) -> None:
        if message.mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            self.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
        elif message.current in (2, 3):
            self.acknowledge(client, self._guide(item) if message.current == 2 else _ACCEPTED)
        elif self._upload is None:
            self._repeat(client, message.seq)
        elif self._upload.client != client:
            self.acknowledge(client, mavlink.MAV_MISSION_DENIED)
        elif message.seq == len(self._upload.items):
            self._add(self._upload, item)
        elif message.seq > len(self._upload.items):
            self._ask(self._upload)  # one before it was lost; an error would end QGroundControl's upload

    def _add(self, upload: _Upload, item: WireItem) -> None:
        try:
            self._store.check(item, len(upload.items))
        except RefusedItemError as error:
            self._end(upload, error.result)
            return
        upload.items.append(item)
        upload.heard_s = self._context.time_s
        self._go_on(upload)

    def _go_on(self, upload: _Upload) -> None:
        if len(upload.items) < upload.count:
            self._ask(upload)
        else:
            self._store.replace(upload.items)
            self._end(upload, _ACCEPTED)

    def _ask(self, upload: _Upload) -> None:
        upload.asked_s = self._context.time_s
        client = upload.client
        question = mavlink.MAVLink_mission_request_int_message(client.system, client.component, len(upload.items))
        self._context.endpoint.reply(client, question)

    def _end(self, upload: _Upload, result: int) -> None:
        self._upload = None
        self._finished[upload.client] = upload.count, result
        if len(self._finished) > _REMEMBERED:
            del self._finished[next(iter(self._finished))]
        self.acknowledge(upload.client, result)

    def _repeat(self, client: Client, seq: int) -> None:
        """An item after the end: its sender may have missed the result, so it is told once more."""
        count, result = self._finished.get(client, (0, int(mavlink.MAV_MISSION_ERROR)))
        if result != _ACCEPTED or seq == count - 1:
            self.acknowledge(client, result)

    def _cancelled(self, client: Client, message: Message) -> None:
        upload = self._upload
        if upload is not None and upload.client == client and message.type != _ACCEPTED:
            self._upload = None
            self._finished[client] = upload.count, int(mavlink.MAV_MISSION_OPERATION_CANCELLED)

    def _refuse_partial(self, client: Client, message: Message) -> None:
        self.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)

    def _guide(self, item: WireItem) -> int:
        """The older way to say "go there": an item whose field current is 2."""
        altitude = self._context.frame.to_geo(self._context.autopilot.home_w).altitude_m
        place = place_of(item.x, item.y, altitude, self._context.frame)
        if place is None:
            return int(mavlink.MAV_MISSION_INVALID)
        return _ACCEPTED if self._context.autopilot.goto(place) is None else int(mavlink.MAV_MISSION_ERROR)

    def _say(self, text: str) -> None:
        for message in status_texts(mavlink.MAV_SEVERITY_WARNING, text, 2):
            self._context.endpoint.broadcast(message)
