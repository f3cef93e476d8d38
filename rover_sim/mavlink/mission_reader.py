"""Mission download, clearing, and the choice of the current item: each request is answered on its own."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.mission_server import MissionServer
from rover_sim.mavlink.mission_store import MissionStore
from rover_sim.mavlink.status import mission_current, status_texts

_MISSION = mavlink.MAV_MISSION_TYPE_MISSION
_EMPTY_LISTS = (mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY)


class MissionReader:
    """Serves the stored mission; keeps no memory of who is reading how far."""

    def __init__(self, context: Context, store: MissionStore, server: MissionServer) -> None:
        self._context = context
        self._store = store
        self._server = server

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
        """Nothing happens by itself."""

    def _count(self, client: Client, message: Message) -> None:
        kind = message.mission_type
        if kind != _MISSION and kind not in _EMPTY_LISTS:
            self._server.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, kind)
        elif kind == _MISSION and self._server.receiving:
            self._server.acknowledge(client, mavlink.MAV_MISSION_DENIED)
        else:
            count = len(self._store.items) if kind == _MISSION else 0
            answer = mavlink.MAVLink_mission_count_message(client.system, client.component, count, kind)
            self._context.endpoint.reply(client, answer)

    def _item(self, client: Client, message: Message) -> None:
        items = self._store.readable
        if message.mission_type != _MISSION:
            self._server.acknowledge(client, mavlink.MAV_MISSION_INVALID_SEQUENCE, message.mission_type)
        elif message.seq >= len(items):
            self._server.acknowledge(client, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        else:
            answer = items[message.seq].message(client.system, client.component, message.seq)
            self._context.endpoint.reply(client, answer)

    def _clear(self, client: Client, message: Message) -> None:
        kind = message.mission_type
        if kind in _EMPTY_LISTS:
            self._server.acknowledge(client, mavlink.MAV_MISSION_ACCEPTED, kind)
        elif kind not in (_MISSION, mavlink.MAV_MISSION_TYPE_ALL):
            self._server.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, kind)
        elif not self._server.abandon(client):
            self._server.acknowledge(client, mavlink.MAV_MISSION_DENIED, kind)
        else:
            self._store.replace([])
            self._server.acknowledge(client, mavlink.MAV_MISSION_ACCEPTED, kind)

    def _set_current(self, _client: Client, message: Message) -> None:
        """Success is the broadcast MISSION_CURRENT, failure a text: the message has no acknowledgement."""
        if self._context.autopilot.set_current(message.seq):
            self._context.endpoint.broadcast(mission_current(self._context))
            return
        for text in status_texts(mavlink.MAV_SEVERITY_WARNING, f"No mission item {message.seq}", 3):
            self._context.endpoint.broadcast(text)

    def _refuse(self, client: Client, message: Message) -> None:
        self._server.acknowledge(client, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
