"""PING and TIMESYNC: answers that let others measure delay and the offset of clocks."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client


class ClockService:
    """Answers PING and TIMESYNC by the time since start, as SYSTEM_TIME and all telemetry tell it.

    A SYSTEM_TIME of a ground station sets nothing: the vehicle's clock is the simulation's.
    """

    def __init__(self, context: Context) -> None:
        self._context = context

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """Both requests."""
        return {"PING": self._ping, "TIMESYNC": self._timesync}

    def tick(self) -> None:
        """Nothing happens by itself."""

    def _ping(self, client: Client, message: Message) -> None:
        if message.target_system == 0:  # a question; with a target it is an answer
            answer = mavlink.MAVLink_ping_message(message.time_usec, message.seq, client.system, client.component)
            self._context.endpoint.reply(client, answer)

    def _timesync(self, client: Client, message: Message) -> None:
        if message.tc1 == 0:
            now_ns = max(1, round(self._context.time_s * 1e9))  # 0 would make it a question
            self._context.endpoint.reply(client, mavlink.MAVLink_timesync_message(now_ns, message.ts1))
