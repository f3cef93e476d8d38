"""Hears the heartbeats of ground stations, for the fail-safe of a lost link."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client


class StationService:
    """Counts the stations that may steer: all others come and go."""

    def __init__(self, context: Context) -> None:
        self._context = context

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """HEARTBEAT."""
        return {"HEARTBEAT": self._heartbeat}

    def tick(self) -> None:
        """Nothing happens by itself: the autopilot sees when they stop coming."""

    def _heartbeat(self, client: Client, message: Message) -> None:
        name = self._context.persona.steering.operator
        wanted = 0.0 if name is None else self._context.autopilot.parameters[name]
        if message.type == mavlink.MAV_TYPE_GCS and wanted in (0.0, float(client.system)):
            self._context.autopilot.stations.heard(self._context.time_s)
