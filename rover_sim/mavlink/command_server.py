"""Commands: every one is answered at once, an unknown one with UNSUPPORTED."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.mavlink.commands import ACTIONS, UNSUPPORTED, Request
from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.heartbeat import BANNER
from rover_sim.mavlink.status import status_texts
from rover_sim.mavlink.telemetry import Telemetry


class CommandServer:
    """Takes COMMAND_LONG, COMMAND_INT and the older SET_MODE."""

    def __init__(self, context: Context, telemetry: Telemetry) -> None:
        self._context = context
        self._telemetry = telemetry
        self._greeted: set[Client] = set()

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """All ways to give a command."""
        return {"COMMAND_LONG": self._command, "COMMAND_INT": self._command, "SET_MODE": self._set_mode}

    def tick(self) -> None:
        """Forget clients whose channel is gone."""
        channels = self._context.endpoint.channels
        self._greeted = {client for client in self._greeted if client.channel in channels}

    def _command(self, client: Client, message: Message) -> None:
        request = Request.of(client, message)
        action = ACTIONS.get(request.command)
        result = UNSUPPORTED if action is None else action(self._context, self._telemetry, request)
        self._acknowledge(client, request.command, result)
        if request.command == mavlink.MAV_CMD_REQUEST_MESSAGE and client not in self._greeted:
            self._greeted.add(client)  # a ground station that has just found us
            for text in status_texts(mavlink.MAV_SEVERITY_INFO, BANNER, 1):
                self._context.endpoint.reply(client, text)

    def _set_mode(self, client: Client, message: Message) -> None:
        """The older message names only a system; ArduPilot acknowledges it like a command numbered as the message."""
        custom = message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        mode = self._context.persona.mode(message.custom_mode) if custom else None
        refused = "no such mode" if mode is None else self._context.autopilot.set_mode(mode)
        result = mavlink.MAV_RESULT_ACCEPTED if refused is None else mavlink.MAV_RESULT_FAILED
        self._acknowledge(client, mavlink.MAVLINK_MSG_ID_SET_MODE, result)

    def _acknowledge(self, client: Client, command: int, result: int) -> None:
        answer = mavlink.MAVLink_command_ack_message(
            command, result, target_system=client.system, target_component=client.component
        )
        self._context.endpoint.reply(client, answer)
