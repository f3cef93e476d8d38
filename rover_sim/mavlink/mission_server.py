"""Uploads of missions, fences and rally points: one of a kind at a time, re-asked by timer, committed when complete.

Rules: the MAVLink mission protocol, and where real clients differ, the table in docs/mavlink.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import MAVLINK_1, Message, mavlink, mission_ack
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.geodesy import DEGREES_E7
from rover_sim.mavlink.item_store import ItemStore
from rover_sim.mavlink.status import status_texts
from rover_sim.mavlink.wire import RefusedItemError, WireItem, place_of

REASK_S = 0.5
STALLED_S = 8.0
_MOST_DEGREES = 214.0  # that fit into 31 bits as 1e-7 degrees
_FLOAT_DEGREES_M = 1.0  # how far a place in 32-bit degrees may be from the one that was meant
_REMEMBERED = 16  # clients whose last result is kept for repeated items
_ACCEPTED = int(mavlink.MAV_MISSION_ACCEPTED)
_CANCELLED = int(mavlink.MAV_MISSION_OPERATION_CANCELLED)
_MISSION = int(mavlink.MAV_MISSION_TYPE_MISSION)
_PLANNERS = range(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER4 + 1)


@dataclass
class _Upload:
    """The transfer in progress."""

    client: Client
    store: ItemStore
    count: int
    heard_s: float  # the last item that was news
    asked_s: float
    items: list[WireItem] = field(default_factory=list)


class MissionServer:
    """Takes lists. A person's mission stands above the planner's until a person clears it."""

    def __init__(self, context: Context, stores: Sequence[ItemStore]) -> None:
        self._context = context
        self._stores = {store.kind: store for store in stores}
        self._uploads: dict[int, _Upload] = {}
        self._held: set[int] = set()  # kinds of which a person wrote the list
        self._finished: dict[tuple[Client, int], tuple[int, int]] = {}  # count and result of the last transfer

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

    def tick(self) -> None:
        """Ask again for an item that does not come; give up after 8 s without news."""
        for upload in list(self._uploads.values()):
            if self._context.time_s - upload.heard_s >= STALLED_S:
                self._say(f"{upload.store.name} upload timeout")
                self._end(upload, _CANCELLED)
            elif self._context.time_s - upload.asked_s >= REASK_S:
                self._ask(upload)

    def store(self, message: Message) -> ItemStore | None:
        """The list that a message is about; None if there is no such list, or none for MAVLink 1.

        A frame of MAVLink 1 cannot say which list it means; what stands in the place is not to be trusted.
        """
        if message.mission_type != _MISSION and message.get_msgbuf()[0] == MAVLINK_1:
            return None
        return self._stores.get(message.mission_type)

    def receiving(self, kind: int) -> bool:
        """Whether a transfer is in progress."""
        return kind in self._uploads

    def acknowledge(self, client: Client, result: int, kind: int = _MISSION) -> None:
        """MISSION_ACK to one client, with the id of the list that the vehicle now has."""
        opaque_id = self._stores[kind].opaque_id if kind in self._stores else 0
        answer = mission_ack(client.system, client.component, result, kind, opaque_id)
        self._context.endpoint.reply(client, answer)

    def claim(self, client: Client, kind: int) -> bool:
        """Let a client write a list: it ends its own transfer, and a person the planner's; False if it may not."""
        upload, planner = self._uploads.get(kind), self._is_planner(client)
        if planner and kind in self._held:
            return False
        if upload is not None and upload.client != client:
            if planner or not self._is_planner(upload.client):
                return False
            self._end(upload, _CANCELLED)
        self._uploads.pop(kind, None)
        return True

    def write(self, client: Client, kind: int, items: Sequence[WireItem]) -> None:
        """Replace a list that the client has claimed; raises RefusedItemError."""
        store, before = self._stores[kind], self._stores[kind].opaque_id
        store.replace(items)
        if self._is_planner(client) or not store.items:
            self._held.discard(kind)
        elif store.opaque_id != before:  # the planner's own, sent back as it was, stays the planner's
            self._held.add(kind)

    def _begin(self, client: Client, message: Message) -> None:
        store, now = self.store(message), self._context.time_s
        if store is None:
            self.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
        elif not self.claim(client, store.kind):
            self._close(client, store.kind, message.count, mavlink.MAV_MISSION_DENIED)
        elif message.count > store.capacity:
            self._say(f"{store.name} of {message.count} items refused, at most {store.capacity}")
            self._close(client, store.kind, message.count, mavlink.MAV_MISSION_NO_SPACE)
        else:
            self._finished.pop((client, store.kind), None)
            upload = self._uploads[store.kind] = _Upload(client, store, message.count, now, now)
            self._go_on(upload)

    def _take_int(self, client: Client, message: Message) -> None:
        self._take(client, message, WireItem.of(message))

    def _take_float(self, client: Client, message: Message) -> None:
        """The older MISSION_ITEM, with degrees; refused where they are no numbers or do not fit into the newer one."""
        codes = mavlink.MAV_MISSION_INVALID_PARAM5_X, mavlink.MAV_MISSION_INVALID_PARAM6_Y
        for degrees, code in zip((message.x, message.y), codes, strict=True):
            if not abs(degrees) < _MOST_DEGREES:
                self._refuse_item(client, message, code)
                return
        message.x, message.y = round(message.x * DEGREES_E7), round(message.y * DEGREES_E7)
        self._take(client, message, WireItem.of(message))

    def _take(self, client: Client, message: Message, item: WireItem) -> None:
        store = self.store(message)
        if store is None:
            self.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
            return
        upload = self._uploads.get(store.kind)
        if store.kind == _MISSION and message.current in (2, 3):
            self.acknowledge(client, self._guide(item) if message.current == 2 else _ACCEPTED)
        elif upload is None:
            self._repeat(client, store.kind, message.seq)
        elif upload.client != client:
            self.acknowledge(client, mavlink.MAV_MISSION_DENIED, store.kind)
        elif message.seq == len(upload.items):
            self._add(upload, item)
        elif message.seq > len(upload.items):
            self._ask(upload)  # one before it was lost; an error would end QGroundControl's upload

    def _refuse_item(self, client: Client, message: Message, code: int) -> None:
        """An error ends the client's transfer if the item was the one that it waits for."""
        upload = self._uploads.get(message.mission_type)
        if upload is not None and upload.client == client and message.seq == len(upload.items):
            self._end(upload, code)
        else:
            self.acknowledge(client, code, message.mission_type)

    def _add(self, upload: _Upload, item: WireItem) -> None:
        try:
            upload.store.check_item(item, len(upload.items))
        except RefusedItemError as error:
            self._end(upload, error.result)
            return
        upload.items.append(item)
        upload.heard_s = self._context.time_s
        self._go_on(upload)

    def _go_on(self, upload: _Upload) -> None:
        if len(upload.items) < upload.count:
            self._ask(upload)
            return
        try:
            self.write(upload.client, upload.store.kind, upload.items)
        except RefusedItemError as error:
            self._end(upload, error.result)
        else:
            self._end(upload, _ACCEPTED)

    def _ask(self, upload: _Upload) -> None:
        upload.asked_s = self._context.time_s
        client = upload.client
        question = mavlink.MAVLink_mission_request_int_message(
            client.system, client.component, len(upload.items), upload.store.kind
        )
        self._context.endpoint.reply(client, question)

    def _end(self, upload: _Upload, result: int) -> None:
        del self._uploads[upload.store.kind]
        self._close(upload.client, upload.store.kind, upload.count, result)

    def _close(self, client: Client, kind: int, count: int, result: int) -> None:
        """Give the result of a list, and keep it: a refused list too takes the place of the one before."""
        self._finished[client, kind] = count, result
        if len(self._finished) > _REMEMBERED:
            del self._finished[next(iter(self._finished))]
        self.acknowledge(client, result, kind)

    def _repeat(self, client: Client, kind: int, seq: int) -> None:
        """An item after the end: its sender may have missed the result, so it is told once more."""
        count, result = self._finished.get((client, kind), (0, int(mavlink.MAV_MISSION_ERROR)))
        if result != _ACCEPTED or seq == count - 1:
            self.acknowledge(client, result, kind)

    def _cancelled(self, client: Client, message: Message) -> None:
        upload = self._uploads.get(message.mission_type)
        if upload is not None and upload.client == client and message.type != _ACCEPTED:
            del self._uploads[upload.store.kind]
            self._finished[client, upload.store.kind] = upload.count, _CANCELLED

    def _refuse_partial(self, client: Client, message: Message) -> None:
        self.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)

    def _guide(self, item: WireItem) -> int:
        """The older way to say "go there": an item whose field current is 2."""
        altitude = self._context.frame.to_geo(self._context.autopilot.home_w).altitude_m
        place = place_of(item.x, item.y, altitude, self._context.frame)
        if place is None:
            return int(mavlink.MAV_MISSION_INVALID)
        there = self._context.autopilot.guided_place_w
        if there is not None and math.dist(there[:2], place[:2]) < _FLOAT_DEGREES_M:
            return _ACCEPTED  # QGroundControl has sent the same place before, by a command that is exact
        return _ACCEPTED if self._context.autopilot.goto(place) is None else int(mavlink.MAV_MISSION_ERROR)

    def _is_planner(self, client: Client) -> bool:
        return client.system == self._context.endpoint.system and client.component in _PLANNERS

    def _say(self, text: str) -> None:
        for message in status_texts(mavlink.MAV_SEVERITY_WARNING, text, 2):
            self._context.endpoint.broadcast(message)
