"""When the simulator waits for PX4's controls, and how many steps the two have drifted apart.

PX4's clock is the time of the last HIL_SENSOR. It answers a step that makes its controllers run with one
HIL_ACTUATOR_CONTROLS and any other step with nothing, so there is no step whose answer is sure to come.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from statistics import median_low

from rover_sim.hil.px4_messages import STEP_USEC, Controls

WAIT_S = 0.010  # for the controls of a step
# Once a step has gone on without its controls, the next one waits longer before the two drift further apart; PX4's
# own time-out for silence is ten times this.
LATE_S = 0.100
SILENT_S = 0.004  # a step of a PX4 that has stopped answering: the world goes on as fast as the wall clock
STALE_USEC = 200_000  # controls that came longer ago turn no wheel
_RHYTHM = 15  # answers from which the pause between two is told


@dataclass(frozen=True)
class Slip:
    """How well simulator and PX4 kept step; a step is 4 ms."""

    steps: int = 0  # sent to an armed PX4 in lockstep
    answers: int = 0
    given_up: int = 0  # waits that ended without controls
    late: int = 0  # answers that came after the next step had been sent, once PX4 had caught up
    most_steps: int = 0  # that lay between a step and its late answer


class Lockstep:
    """The rhythm of one PX4's answers; counts go on when it is restarted."""

    def __init__(self) -> None:
        self.slip = Slip()
        self.restart()

    def restart(self) -> None:
        """A new PX4: nothing is known of it."""
        self.controls: Controls | None = None
        self._sent_usec = self._heard_usec = 0  # on our clock: a board has its own
        self._silent = False  # a long wait was in vain
        self._in_step = False  # has worked off what was sent before it was waited for
        self._gaps: deque[int] = deque(maxlen=_RHYTHM)

    def send(self, time_usec: int) -> None:
        """A step has been sent."""
        self._sent_usec = time_usec
        if self.keeps_step:
            self.slip = replace(self.slip, steps=self.slip.steps + 1)

    def hear(self, controls: Controls) -> None:
        """Controls have come."""
        before, self.controls, self._silent = self.controls, controls, False
        self._heard_usec = self._sent_usec
        if not self.keeps_step:
            self._in_step = False
            return
        if before is not None and before.armed and controls.time_usec == before.time_usec:
            return  # a second message for one step is no second answer
        self._count(self._steps_since(controls))
        if before is not None and before.armed and controls.time_usec > before.time_usec:
            self._gaps.append(max(1, (controls.time_usec - before.time_usec) // STEP_USEC))

    def give_up(self) -> None:
        """The wait for controls has ended without them."""
        self._silent = self._late_steps >= 1
        self.slip = replace(self.slip, given_up=self.slip.given_up + 1)

    @property
    def patience_s(self) -> float:
        """How long to wait for controls before the next step; 0 where none are due.

        Only an armed PX4 in lockstep is waited for, after its first controls: before, it may have nothing to say.
        """
        if not self.keeps_step or self._late_steps < 0:
            return 0.0
        if self._silent:
            return SILENT_S
        return WAIT_S if self._late_steps == 0 else LATE_S

    @property
    def side_shares(self) -> tuple[float, float]:
        """Shares of full speed of left and right side; none without fresh controls."""
        if self.controls is None or self._sent_usec - self._heard_usec > STALE_USEC:
            return 0.0, 0.0
        return self.controls.side_shares

    @property
    def keeps_step(self) -> bool:
        """Whether PX4 is in lockstep, armed, and heard."""
        return self.controls is not None and self.controls.armed and self.controls.lockstep

    @property
    def _late_steps(self) -> int:
        """Steps since the one whose answer is due; below 0 where none is."""
        if self.controls is None:
            return -1
        return self._steps_since(self.controls) - (median_low(self._gaps) if self._gaps else 1)

    def _count(self, behind: int) -> None:
        """An answer has come, so many steps late."""
        slip = replace(self.slip, answers=self.slip.answers + 1)
        if self._in_step:
            slip = replace(slip, late=slip.late + (behind > 0), most_steps=max(slip.most_steps, behind))
        self.slip, self._in_step = slip, self._in_step or behind == 0

    def _steps_since(self, controls: Controls) -> int:
        return max(0, self._sent_usec - controls.time_usec) // STEP_USEC
