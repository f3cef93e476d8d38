"""A ground station after QGroundControl: frames, the clock, and commands with its time-outs and tries.

Written after its sources (``MavCommandQueue``, ``RequestMessageCoordinator``, ``Vehicle``). What takes time is a
generator that yields until the next look at the clock; every retry, failure and pop-up that a user would see is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any

from rover_sim.mavlink.dialect import Message, Packer, Parser, mavlink
from rover_sim.mavlink.persona import Persona

Script = Generator[None, None, Any]
SYSTEM, COMPONENT = 255, 190
ACK_S, MESSAGE_S = 1.2, 1.0
ACCEPTED = 0


@dataclass
class Step:
    """One state of the connection."""

    name: str
    seconds: float
    sent: int


@dataclass
class QgcStation:
    """One ground station; ``send`` puts a frame on the link, `hear` takes what has come, `look` lets time pass."""

    persona: Persona
    send_frame: Callable[[bytes], None]
    steps: list[Step] = field(default_factory=list)
    retries: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)  # pop-ups and errors
    parameters: dict[str, float] = field(default_factory=dict)
    flying: bool = False
    flying_changes: int = 0
    armed: bool = False
    mode: int = -1
    time_s: float = 0.0

    def __post_init__(self) -> None:
        self._packer, self._parser = Packer(SYSTEM, COMPONENT), Parser()
        self._heard: list[Message] = []
        self._sent = 0
        self._beat_s = 0.0

    # Traffic

    def hear(self, data: bytes) -> None:
        for message in self._parser.datagram(data):
            if message.get_srcSystem() == 1 and message.get_srcComponent() == 1:
                self._note(message)
                self._heard.append(message)

    def look(self, time_s: float) -> None:
        self.time_s = time_s
        if time_s >= self._beat_s:
            self._beat_s = time_s + 1.0
            self.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def send(self, message: Message) -> None:
        self._sent += 1
        self.send_frame(self._packer.pack(message))

    def _note(self, message: Message) -> None:
        before = self.flying
        if message.get_type() == "HEARTBEAT":
            self.armed, self.mode = bool(message.base_mode & 128), message.custom_mode
            if not self.persona.tells_landed:
                self.flying = self.armed and message.system_status in (4, 5, 6)
        elif message.get_type() == "EXTENDED_SYS_STATE" and message.landed_state:
            self.flying = message.landed_state != 1
        self.flying_changes += self.flying is not before

    # Waiting

    def _await(self, wanted: Callable[[Message], bool], seconds: float) -> Script:
        """The next such message; None after the time."""
        end_s = self.time_s + seconds
        while True:
            for at, message in enumerate(self._heard):
                if wanted(message):
                    del self._heard[: at + 1]
                    return message
            self._heard.clear()
            if self.time_s >= end_s:
                return None
            yield

    def _until(self, done: Callable[[], bool], seconds: float) -> Script:
        end_s = self.time_s + seconds
        while not done() and self.time_s < end_s:
            self._heard.clear()
            yield
        return done()

    # Commands

    def command(self, number: int, *parameters: float, tries: int = 1, quiet: bool = False) -> Script:
        """A COMMAND_LONG's result; None if nobody answered."""
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        return (
            yield from self._command(mavlink.MAVLink_command_long_message(1, 1, number, 0, *padded), tries, quiet=quiet)
        )

    def _command(self, message: Message, tries: int, *, quiet: bool = False) -> Script:
        number = message.command
        for again in range(tries):
            self._retry(again, f"command {number}")
            self.send(message)
            ack = yield from self._await(lambda one: one.get_type() == "COMMAND_ACK" and one.command == number, ACK_S)
            if ack is not None:
                if ack.result != ACCEPTED and not quiet:
                    self.complaints.append(f"command {number} result {ack.result}")
                return ack.result
        self.complaints.append(f"command {number} unanswered")
        return None

    def request(self, message_id: int, index: float = 0.0) -> Script:
        """REQUEST_MESSAGE; the message may come before its acknowledgement."""
        found: list[Message] = []
        number = mavlink.MAV_CMD_REQUEST_MESSAGE

        def done(one: Message) -> bool:
            if one.get_msgId() == message_id:
                found.append(one)
            return bool(one.get_type() == "COMMAND_ACK" and one.command == number)

        message = mavlink.MAVLink_command_long_message(1, 1, number, 0, message_id, index, 0, 0, 0, 0, 0)
        for again in range(3):
            self._retry(again, f"request of {message_id}")
            self.send(message)
            ack = yield from self._await(done, ACK_S)
            if ack is None:
                continue
            if ack.result == ACCEPTED and not found:
                late = yield from self._await(lambda one: one.get_msgId() == message_id, MESSAGE_S)
                found += [late] if late else []
            return found[0] if found else None
        self.complaints.append(f"request of {message_id} unanswered")
        return None

    def _retry(self, again: int, what: str) -> None:
        if again:
            self.retries.append(what)
