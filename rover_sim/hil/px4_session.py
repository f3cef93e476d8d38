"""Our world as the simulator of PX4: sensors out, controls in, one step of the traverse; at 250 Hz."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any, Self

from rover_sim.errors import LinkError
from rover_sim.hil.px4_messages import STEP_USEC
from rover_sim.hil.px4_peer import Px4Peer, Wait
from rover_sim.hil.session import NOBODY, Driven, End, Watchers
from rover_sim.hil.states import NedSampler
from rover_sim.outcome import Reason
from rover_sim.pacing import Beat, WallClock
from rover_sim.sim.faults import stall_s
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensor_suite import SensorSuite
from rover_sim.traverse import Traverse

STEPS_PER_S = 1_000_000 // STEP_USEC
_LOOK_S = 0.25  # how often a wish to stop is looked at while nothing comes
_GREETING_S = 1.0


@dataclass(frozen=True)
class Clockwork:
    """Wall time, passed in."""

    wait: Wait  # for news
    left_s: Callable[[float], float]  # wall time left of the step that is over now, of so much that it is to take
    patience_s: float  # without a PX4
    speed: float = 1.0  # of the wall clock, for a PX4 that keeps step; any other is given its time


class Px4Session:
    """One traverse under a PX4; it begins anew whenever PX4 does. A context manager, which closes the traverse."""

    def __init__(
        self,
        begin: Callable[[], Driven],
        meet: Callable[[Driven], Px4Peer],
        clockwork: Clockwork,
        watchers: Watchers = NOBODY,
    ) -> None:
        """``meet``: opens the link, once the world is ready: a PX4 that has connected wants to be served."""
        self._begin, self._clockwork, self._watchers = begin, clockwork, watchers
        self._beat, self._met, self._served = Beat(), 0, 0
        self._start()
        try:
            self._peer = meet(self._driven)
        except BaseException:
            self.traverse.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.traverse.close()

    @property
    def traverse(self) -> Traverse:
        """The traverse, which is another one after a restart of PX4."""
        return self._driven.traverse

    def run(self) -> dict[str, Any]:
        """Serve until the traverse ends and return its summary, with how the link did under ``hil``.

        Raises LinkError if no PX4 comes, KeyboardInterrupt if it is no longer waited for.
        """
        ended: End | None = None
        while ended is None:
            ended = self._step() if self._serves else self._await_px4()
        summary = self.traverse.summary(*ended, wall_time_s=self._clock.elapsed_s())
        return {**summary, "hil": self.figures}

    @property
    def _serves(self) -> bool:
        """Whether the PX4 that was met is still there; another may have come at once."""
        return self._peer.connected and self._peer.number == self._served

    def _start(self) -> None:
        self._driven = self._begin()
        self._sensors = SensorSuite(self.traverse.world)
        self._sampler = NedSampler(self.traverse.simulation)
        self._steps, self._told_s = 0, 0.0  # told last: simulated time

    def _meet_px4(self) -> None:
        """A PX4 has shown itself; where another has driven before, the traverse begins anew."""
        self._met, self._served = self._met + 1, self._peer.number
        if self._steps > 0:
            self._watchers.say("PX4 began anew, and the traverse with it")
            self.traverse.close()
            self._start()
        self._clock = WallClock()

    def _await_px4(self) -> End | None:
        """Wait until a PX4 has shown itself; the end that its absence or a wish to stop makes."""
        self._driven.outputs.set(0.0, 0.0)
        self._beat.pause()
        waited_s, greeting_s, said = 0.0, 0.0, ""
        while True:
            self._peer.listen()
            if not (lacks := self._peer.lacks):
                self._meet_px4()
                return None
            if lacks != said:
                said = lacks
                self._watchers.say(f"waiting for {lacks}")
            if self._watchers.stopped():
                return self._stop()
            if waited_s >= self._clockwork.patience_s:
                return self._loss(lacks)
            if waited_s >= greeting_s:
                self._peer.greet()
                greeting_s += _GREETING_S
            waited_s += self._peer.wait(self._clockwork.wait, min(_LOOK_S, self._clockwork.patience_s - waited_s))

    def _stop(self) -> End:
        if self._steps == 0:
            raise KeyboardInterrupt
        return Reason.ABORTED, "interrupted"

    def _loss(self, lacks: str) -> End:
        text = f"waited {self._clockwork.patience_s:g} s for {lacks}"
        if self._steps == 0:
            raise LinkError(text)
        return Reason.LINK_LOST, text

    def _step(self) -> End | None:
        """One exchange with PX4, and one step of the traverse under what it said."""
        traverse, watchers = self.traverse, self._watchers
        truth = self._sampler.sample()
        if not _is_finite(truth):
            return Reason.ERROR, "the physics gave a number that is not finite; PX4 was not told"
        if (late_s := stall_s(traverse.world.scenario.event, self._told_s, truth.time_s)) > 0.0:
            self._clockwork.wait((), late_s)
        self._told_s = truth.time_s
        self._beat.tick()
        self._peer.step(truth, self._sensors.read(truth), self._clockwork.wait)
        if not self._serves:
            return None  # the world stands still until there is a PX4 again
        self._driven.outputs.set(*self._peer.side_shares)
        looked, ended = traverse.step(watchers.on_sight)
        self._steps += 1
        if looked:
            watchers.show(traverse.status())
            if watchers.stopped():
                return self._stop()
        speed = self._clockwork.speed if self._peer.lockstep.keeps_step else 1.0
        if (left_s := self._clockwork.left_s(1.0 / (STEPS_PER_S * speed))) > 0.0:
            self._clockwork.wait((), left_s)
        return ended

    @property
    def figures(self) -> dict[str, Any]:
        """How the link has done: JSON."""
        slip = self._peer.lockstep.slip
        return {
            "autopilot": "px4",
            "steps": self._steps,
            "restarts": max(0, self._met - 1),
            "lockstep": asdict(slip) if self._peer.profile.lockstep else None,
            "beat": self._beat.figures(),
        }


def _is_finite(truth: NedState) -> bool:
    return all(map(isfinite, (*truth.position_m, *truth.velocity_m_s, *truth.quaternion, *truth.rate_rad_s)))


def figures_text(figures: dict[str, Any]) -> str:
    """The same in a line."""
    beat, slip = figures["beat"], figures["lockstep"]
    if beat is None:
        return "no step was made"
    text = f"{beat['rate_hz']:.1f} steps a second, {beat['median_ms']:.2f} ms apart in the median, "
    text += f"p99 {beat['p99_ms']:.2f}, longest {beat['longest_ms']:.1f}"
    if slip is None:
        return text
    return f"{text}; {slip['late']} of {slip['answers']} answers late, by {slip['most_steps']} steps at most"
