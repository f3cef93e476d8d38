"""Our world as the physics of ArduPilot Rover: a servo packet in, one step of the traverse, the state out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, Self

from rover_sim.driven_rover import STEPS_PER_S
from rover_sim.errors import LinkError
from rover_sim.hil.ardupilot_imu import ToldMotion
from rover_sim.hil.ardupilot_json import ServoPacket, side_shares, state_message
from rover_sim.hil.lockstep import Datagram, Lockstep, Peer, Request
from rover_sim.hil.session import NOBODY, Driven, End, Watchers
from rover_sim.hil.states import NedSampler
from rover_sim.outcome import Reason
from rover_sim.sim.faults import stall_s
from rover_sim.traverse import Traverse

# A packet that crossed its reply has the next one right behind it: the autopilot paces itself by pauses of 5 to 10 ms.
GRACE_S = 0.05
_RATE_SLACK_HZ = 2  # it rounds, and creeps by 1 Hz a step
_LOOK_S = 0.25  # how often a wish to stop is looked at while nothing comes


class Port(Protocol):
    """Where servo packets come in, as `servo_port.ServoPort`."""

    def wait(self, seconds: float) -> bool:
        """Wait for a datagram, at most so long; True if there is one."""
        ...

    def take(self) -> list[Datagram]:
        """All datagrams that have come, oldest first."""
        ...

    def send(self, data: bytes, peer: Peer) -> None:
        """Send a reply."""
        ...


@dataclass(frozen=True)
class Clockwork:
    """The wall clock of the one who waits."""

    now_s: Callable[[], float]
    pause: Callable[[float], None]  # for so many seconds
    patience_s: float  # silence after which there is no autopilot


class ArduPilotSession:
    """One traverse under an autopilot outside; it begins anew whenever the autopilot does. A context manager."""

    def __init__(
        self,
        port: Port,
        lockstep: Lockstep,
        begin: Callable[[], Driven],
        clockwork: Clockwork,
        watchers: Watchers = NOBODY,
    ) -> None:
        self._port, self._lockstep, self._clockwork = port, lockstep, clockwork
        self._begin, self._watchers = begin, watchers
        self._pending: list[Datagram] = []
        self._reply = b""
        self._started_s = 0.0
        self._restarts = self._repeated = 0
        self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.traverse.close()

    @property
    def traverse(self) -> Traverse:
        """The traverse, which is another one after a restart of the autopilot."""
        return self._driven.traverse

    def run(self) -> dict[str, Any]:
        """Serve until the traverse ends and return its summary, with how the link did under ``hil``.

        Raises LinkError if no autopilot asks for a first step, KeyboardInterrupt if that is no longer waited for.
        """
        ended: End | None = None
        while ended is None:
            request = self._next_request()
            ended = self._loss() if request is None else self._serve(request)
        summary = self.traverse.summary(*ended, wall_time_s=self._clockwork.now_s() - self._started_s)
        return {**summary, "hil": self._figures()}

    def _figures(self) -> dict[str, Any]:
        return {
            "autopilot": "ardupilot",
            "steps": self._steps,
            "restarts": self._restarts,
            "replies_repeated": self._repeated,
            "datagrams_dropped": dict(self._lockstep.dropped),
        }

    def _start(self) -> None:
        self._driven = self._begin()
        self._sampler = NedSampler(self.traverse.simulation)
        self._told = ToldMotion(self.traverse.world)
        self._steps = 0

    def _next_request(self) -> Request | None:
        """The next request; None after a wish to stop, or long silence."""
        heard_s = self._clockwork.now_s()
        while True:
            datagrams, self._pending = self._pending + self._port.take(), []
            request = self._lockstep.hear(datagrams, self._clockwork.now_s())
            for note in self._lockstep.take_notes():
                self._watchers.say(note)
            if request is not None and not (request.repeated and self._port.wait(GRACE_S)):
                return request
            if self._watchers.stopped() or self._clockwork.now_s() - heard_s >= self._clockwork.patience_s:
                return None
            if request is None:
                self._port.wait(_LOOK_S)

    def _loss(self) -> End:
        """The end that silence or a wish to stop makes."""
        if self._watchers.stopped():
            if self._steps == 0:
                raise KeyboardInterrupt
            return Reason.ABORTED, "interrupted"
        if self._steps == 0:
            raise LinkError(f"no autopilot has asked for a step of the physics in {self._clockwork.patience_s:g} s")
        return (
            Reason.LINK_LOST,
            f"the autopilot has not asked for a step of the physics in {self._clockwork.patience_s:g} s",
        )

    def _serve(self, request: Request) -> End | None:
        """Answer one request; the end, if its step brought one."""
        ended = None
        if request.restarted:
            self._watchers.say("the autopilot began anew, and the traverse with it")
            self._restarts += 1
            self.traverse.close()
            self._start()
        if request.repeated:
            self._repeated += 1
        else:
            ended = self._step(request.packet)
        if self._reply:
            self._pending = self._lockstep.answer(request, self._port.take())
            self._port.send(self._reply, request.peer)
        return ended

    def _step(self, packet: ServoPacket) -> End | None:
        """One step of the traverse, and the reply that tells of it; none where the state cannot be told."""
        if self._steps == 0:
            self._greet(packet)
        before_s = self.traverse.simulation.time_s
        self._driven.outputs.set(*side_shares(packet))
        looked, ended = self.traverse.step(self._watchers.on_sight)
        self._steps += 1
        state = self._sampler.sample()
        late_s = stall_s(self.traverse.world.scenario.event, before_s, state.time_s)
        if late_s > 0.0:
            self._clockwork.pause(late_s)
        try:
            self._reply = state_message(state.time_s, self._told.of(state))
        except ValueError:
            self._reply = b""
            return Reason.ERROR, "the physics gave a number that is not finite; the autopilot was not told"
        if looked:
            self._watchers.show(self.traverse.status())
            if self._watchers.stopped():
                return Reason.ABORTED, "interrupted"
        return ended

    def _greet(self, packet: ServoPacket) -> None:
        """The first packet: time counts from here, and it shows how the autopilot was started."""
        self._started_s = self._clockwork.now_s()
        if packet.frame_count > 0 and self._restarts == 0:
            text = (
                f"the autopilot had been running, for {packet.frame_count} steps, and its rover now jumps to the start"
            )
            self._watchers.say(f"{text}: restart it if it does not get ready")
        if abs(packet.frame_rate_hz - STEPS_PER_S) > _RATE_SLACK_HZ:
            text = f"the autopilot expects {packet.frame_rate_hz} steps a second and gets {STEPS_PER_S}"
            self._watchers.say(f"{text}: start it with --rate {STEPS_PER_S}")
