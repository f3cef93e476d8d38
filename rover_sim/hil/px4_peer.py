"""The simulator's end of PX4's HIL link, over any transport: steps out, controls in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rover_sim.hil import px4_messages
from rover_sim.hil.px4_lockstep import Lockstep
from rover_sim.hil.px4_messages import STEP_USEC, due
from rover_sim.mavlink.dialect import Message, Packer, Parser, mavlink
from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from rover_sim.mavlink.tlog import SIMULATED_EPOCH_S
from rover_sim.mavlink.transport import Transport
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensed import Sensed
from worlds.types import Vector3

Wait = Callable[[tuple[int, ...], float], float]  # for news on handles, at most so many seconds; gives those passed
_EPOCH_USEC = round(SIMULATED_EPOCH_S * 1e6)
_HEARTBEAT_USEC = 1_000_000
_TICK_S = 1e-6  # a shorter wait is none


@dataclass(frozen=True)
class Profile:
    """What differs between PX4 as a program and PX4 on a board."""

    lockstep: bool  # its clock is ours
    truth: bool  # wants HIL_STATE_QUATERNION; a board would take it for its own estimate
    heartbeat: bool  # begins to talk when it hears one
    forgiven_s: float  # of wall time that the world may lag and make good by steps in a row


# A program's clock stands while the world is late, a board's goes on.
PROGRAM = Profile(lockstep=True, truth=True, heartbeat=False, forgiven_s=0.01)
BOARD = Profile(lockstep=False, truth=False, heartbeat=True, forgiven_s=0.25)


class Px4Peer:
    """One PX4 at a time; a new connection is a new PX4, and the wheels stand until it has said how to turn them."""

    def __init__(
        self, transport: Transport, frame: LocalFrame, start_w: Vector3, where: str, profile: Profile = PROGRAM
    ) -> None:
        """``start_w``: where the rover's north-east-down frame has its zero; ``where``: the link, for messages."""
        self.lockstep, self.profile, self._where = Lockstep(), profile, where
        self._transport, self._frame, self._start_w = transport, frame, start_w
        self._time_usec = 0
        self.number = 0  # of the PX4 on the link: it rises with every connection
        self._begin(None)

    @property
    def connected(self) -> bool:
        """Whether somebody is on the link."""
        return self._peer is not None

    @property
    def lacks(self) -> str:
        """What is still waited for before the first step, in words; empty where nothing is."""
        if self._peer is None:
            return f"PX4 at {self._where}"
        if not self._heard:
            return f"a HEARTBEAT of PX4 at {self._where}"
        if self.profile.heartbeat and not self._in_hil:
            return f"HIL mode of the PX4 at {self._where} (its parameter SYS_HITL must be 1 from its start)"
        return ""

    @property
    def side_shares(self) -> tuple[float, float]:
        """Shares of full speed of the wheels on the left and on the right."""
        return self.lockstep.side_shares

    def step(self, truth: NedState, sensed: Sensed, wait: Wait) -> None:
        """Send one instant, and hear what PX4 makes of it."""
        self.send(truth, sensed)
        self.listen()
        if self.profile.lockstep:
            self._await_controls(wait)

    def send(self, truth: NedState, sensed: Sensed) -> None:
        """Send all that is due; the inertial message comes last, as it moves PX4's clock."""
        self._time_usec = STEP_USEC + round(truth.time_s * 1e6)  # PX4 takes 0 for a clock that is not set
        messages = [*self._now_and_then(sensed), *self._truth(truth)]
        messages.append(px4_messages.hil_sensor(self._time_usec, sensed))
        self._say(messages)
        self.lockstep.send(self._time_usec)

    def greet(self) -> None:
        """Send the HEARTBEAT for which a board waits before it says anything."""
        if self.profile.heartbeat:
            self._say([px4_messages.heartbeat()])

    def listen(self) -> bool:
        """Take what has come, connections included; whether controls were in it."""
        time_s = self._time_usec / 1e6
        chunks = self._transport.receive(time_s)
        peers = self._transport.peers(time_s)
        if self._peer not in peers:
            self._begin(peers[0] if peers else None)
        before = self.lockstep.controls
        for peer, data in chunks:
            if peer == self._peer:
                for message in self._parser.stream(data):
                    self._hear(message)
        return self.lockstep.controls is not before

    def wait(self, wait: Wait, seconds: float) -> float:
        """Wait for news on the link; the seconds passed."""
        return wait(self._transport.handles(), seconds)

    def _begin(self, peer: str | None) -> None:
        self.number += peer is not None
        self._peer, self._heard, self._in_hil, self._truth_usec = peer, False, False, 0
        self._parser, self._packer = Parser(), Packer(px4_messages.SYSTEM, px4_messages.COMPONENT)
        self.lockstep.restart()

    def _await_controls(self, wait: Wait) -> None:
        waited_s = 0.0
        while (patience_s := self.lockstep.patience_s) > 0.0:
            if waited_s >= patience_s - _TICK_S:
                self.lockstep.give_up()
                return
            waited_s += self.wait(wait, patience_s - waited_s)
            if self.listen():
                waited_s = 0.0

    def _now_and_then(self, sensed: Sensed) -> list[Message]:
        time_usec = self._time_usec
        messages = []
        if self.profile.heartbeat and due(time_usec, _HEARTBEAT_USEC):
            messages.append(px4_messages.heartbeat())
        if due(time_usec, px4_messages.TIME_USEC):
            messages.append(px4_messages.system_time(_EPOCH_USEC + time_usec, time_usec))
        if (fix := sensed.gnss) is not None:
            measured_usec = _EPOCH_USEC + STEP_USEC + round(fix.time_s * 1e6)
            messages.append(px4_messages.hil_gps(measured_usec, fix, self._place(fix.position_m)))
        return messages

    def _truth(self, truth: NedState) -> list[Message]:
        if not (self.profile.truth and due(self._time_usec, self._truth_usec)):
            return []
        return [px4_messages.hil_state_quaternion(self._time_usec, truth, self._place(truth.position_m))]

    def _place(self, position_m: Vector3) -> GeoPoint:
        """Where on Earth a place north-east-down of the start is."""
        north, east, down = position_m
        x, y, z = self._start_w
        return self._frame.to_geo((x + east, y + north, z - down))

    def _say(self, messages: list[Message]) -> None:
        if self._peer is not None:
            data = b"".join(self._packer.pack(message) for message in messages)
            self._transport.send(data, self._peer, self._time_usec / 1e6)

    def _hear(self, message: Message) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT":
            if message.autopilot == mavlink.MAV_AUTOPILOT_PX4:
                self._heard, self._in_hil = True, bool(message.base_mode & mavlink.MAV_MODE_FLAG_HIL_ENABLED)
        elif kind == "COMMAND_LONG":
            self._truth_usec = px4_messages.asked_interval(message, self._truth_usec)
        elif kind == "HIL_ACTUATOR_CONTROLS":
            self._heard = True
            self.lockstep.hear(px4_messages.parse_controls(message))
