"""PING, TIMESYNC, and the refusal of file transfer: services of a few lines each."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client

_FTP_BYTES = 251
_ACK, _NAK = 128, 129
_UNKNOWN_COMMAND, _FILE_NOT_FOUND = 7, 10
_HARMLESS = (0, 1, 2)  # none, terminate session, reset sessions: nothing is open, so all is well
_OPENING = (3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)  # list, open, read, create ... of a file


class ClockService:
    """Answers PING and TIMESYNC."""

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
            now_ns = round(self._context.time_s * 1e9)
            self._context.endpoint.reply(client, mavlink.MAVLink_timesync_message(now_ns, message.ts1))


class FileService:
    """Refuses every file at once: QGroundControl then asks for the parameters one by one without waiting."""

    def __init__(self, context: Context) -> None:
        self._context = context

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """MAVFTP."""
        return {"FILE_TRANSFER_PROTOCOL": self._answer}

    def tick(self) -> None:
        """Nothing happens by itself."""

    def _answer(self, client: Client, message: Message) -> None:
        """The payload: sequence (2 bytes), session, opcode, size, request opcode, burst, padding, offset (4), data."""
        request = bytes(message.payload)
        sequence = (int.from_bytes(request[:2], "little") + 1) & 0xFFFF
        opcode = request[3]
        if opcode in _HARMLESS:
            kind, data = _ACK, b""
        else:
            kind, data = _NAK, bytes([_FILE_NOT_FOUND if opcode in _OPENING else _UNKNOWN_COMMAND])
        header = sequence.to_bytes(2, "little") + bytes([request[2], kind, len(data), opcode, 0, 0, 0, 0, 0, 0])
        answer = (header + data).ljust(_FTP_BYTES, b"\0")
        self._context.endpoint.reply(
            client, mavlink.MAVLink_file_transfer_protocol_message(0, client.system, client.component, answer)
        )
