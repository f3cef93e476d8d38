"""Downloads and clearing of all lists, and the choice of the current mission item."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink, mission_count
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.item_store import ItemStore
from rover_sim.mavlink.mission_server import MissionServer
from rover_sim.mavlink.status import mission_current, status_texts
from rover_sim.mavlink.wire import WireItem

_MISSION, _ALL = mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_ALL
_READING_S = 10.0  # without a question, after which a download is over


@dataclass
class _Reading:
    """The list as it was when its reader asked for the count: what comes later must belong to the same list."""

    items: tuple[WireItem, ...]
    heard_s: float


class MissionReader:
    """Serves the stored lists; a reader gets one list whole, whoever replaces it meanwhile."""

    def __init__(self, context: Context, stores: tuple[ItemStore, ...], server: MissionServer) -> None:
        self._context = context
        self._stores = stores
        self._server = server
        self._readings: dict[tuple[Client, int], _Reading] = {}

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """The messages of a download, and the rest of the mission protocol."""
        return {
            "MISSION_REQUEST_LIST": self._count,
            "MISSION_REQUEST_INT": self._item,
            "MISSION_REQUEST": self._item,
            "MISSION_REQUEST_PARTIAL_LIST": self._refuse,
            "MISSION_CLEAR_ALL": self._clear,
            "MISSION_SET_CURRENT": self._set_current,
        }

    def tick(self) -> None:
        """Forget who reads no more."""
        over_s = self._context.time_s - _READING_S
        self._readings = {key: reading for key, reading in self._readings.items() if reading.heard_s > over_s}

    def _count(self, client: Client, message: Message) -> None:
        kind, store = message.mission_type, self._server.store(message)
        if store is None:
            self._server.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, kind)
        elif self._server.receiving(kind):
            self._server.acknowledge(client, mavlink.MAV_MISSION_DENIED, kind)
        else:
            self._readings[client, kind] = _Reading(store.readable, self._context.time_s)
            answer = mission_count(client.system, client.component, len(store.items), kind, store.opaque_id)
            self._context.endpoint.reply(client, answer)

    def _item(self, client: Client, message: Message) -> None:
        kind, store = message.mission_type, self._server.store(message)
        if store is None:
            self._server.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, kind)
            return
        reading = self._readings.get((client, kind))
        items = store.readable if reading is None else reading.items
        if reading is not None:
            reading.heard_s = self._context.time_s
        if message.seq >= len(items):
            self._server.acknowledge(client, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)
        else:
            answer = items[message.seq].message(client.system, client.component, message.seq, kind)
            self._context.endpoint.reply(client, answer)

    def _clear(self, client: Client, message: Message) -> None:
        kind, store = message.mission_type, self._server.store(message)
        stores = self._stores if kind == _ALL else (store,) if store is not None else ()
        if not stores:
            self._server.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, kind)
            return
        # A list that may not be touched stays; the others are cleared, as each of them would be alone.
        free = [entry for entry in stores if self._server.claim(client, entry.kind)]
        for entry in free:
            self._server.write(client, entry.kind, [])
        result = mavlink.MAV_MISSION_ACCEPTED if len(free) == len(stores) else mavlink.MAV_MISSION_DENIED
        self._server.acknowledge(client, result, kind)

    def _set_current(self, _client: Client, message: Message) -> None:
        """Success is the broadcast MISSION_CURRENT, failure a text: the message has no acknowledgement."""
        if self._context.autopilot.set_current(message.seq):
            self._context.endpoint.broadcast(mission_current(self._context))
            return
        for text in status_texts(mavlink.MAV_SEVERITY_WARNING, f"No mission item {message.seq}", 3):
            self._context.endpoint.broadcast(text)

    def _refuse(self, client: Client, message: Message) -> None:
        self._server.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
