"""Commands from the sender's side: one at a time in order, repeated until acknowledged."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from rover_sim.mavlink.dialect import Message, mavlink

RETRY_S = 1.0
RETRIES = 4


class CommandState(StrEnum):
    """How far a command is."""

    SENDING = "sending"
    DONE = "done"
    FAILED = "failed"


@dataclass
class PendingCommand:
    """One command; its owner looks at ``state``. ``result`` is the MAV_RESULT, None if nobody answered."""

    command: int
    parameters: tuple[float, ...]  # seven
    state: CommandState = CommandState.SENDING
    result: int | None = None


class Commander:
    """Acknowledgements name only the command, so a second command waits for the end of the first."""

    def __init__(self, send: Callable[[Message], None], system: int, component: int) -> None:
        self._send = send
        self.target = system, component
        self._queue: deque[PendingCommand] = deque()
        self._sent_s: float | None = None
        self._tries = 0

    def command(self, command: int, *parameters: float) -> PendingCommand:
        """Queue a command; the parameters that are left out are 0."""
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        pending = PendingCommand(command, padded)
        self._queue.append(pending)
        return pending

    def tick(self, time_s: float) -> None:
        """Send the first of the queue, or repeat it."""
        if not self._queue or (self._sent_s is not None and time_s - self._sent_s < RETRY_S):
            return
        if self._tries > RETRIES:
            self._end(CommandState.FAILED, None)
            self.tick(time_s)
            return
        pending = self._queue[0]
        self._send(
            mavlink.MAVLink_command_long_message(*self.target, pending.command, self._tries, *pending.parameters)
        )
        self._sent_s = time_s
        self._tries += 1

    def acknowledged(self, message: Message, time_s: float) -> None:
        """COMMAND_ACK; "in progress" asks for patience."""
        if not self._queue or self._sent_s is None or message.command != self._queue[0].command:
            return
        if message.result == mavlink.MAV_RESULT_IN_PROGRESS:
            self._sent_s = time_s
            return
        accepted = message.result == mavlink.MAV_RESULT_ACCEPTED
        self._end(CommandState.DONE if accepted else CommandState.FAILED, message.result)

    def _end(self, state: CommandState, result: int | None) -> None:
        pending = self._queue.popleft()
        pending.state, pending.result = state, result
        self._sent_s, self._tries = None, 0
