"""Lockstep with PX4 in memory: a strict double, real sensor models, and time that only waiting moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from rover_sim.hil.px4_lockstep import LATE_S, SILENT_S, WAIT_S, Lockstep
from rover_sim.hil.px4_messages import Controls
from rover_sim.hil.px4_peer import Px4Peer
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensed import Sensed
from rover_sim.sim.sensor_suite import SensorSuite
from tests.px4_checks import ViolationError
from tests.px4_double import MemoryPx4, Outputs, Px4Double, armed_from, resting
from tests.sim_factory import make_world, slope
from worlds.types import World

STEPS_PER_S = 250


def standing(step: int) -> NedState:
    """A rover that stands level, facing north."""
    return NedState(step / STEPS_PER_S, (0, 0, 0), (0, 0, 0), (1, 0, 0, 0), (0, 0, 0), (0, 0, -9.80665))


def controls(time_usec: int, share: float) -> Controls:
    return Controls(time_usec, (share,) * 16, armed=True, lockstep=True)


class Rig:
    """A simulator's end with sensors, stepped by hand, no faster than the clock of the link."""

    def __init__(self, link: MemoryPx4, *, gnss: bool = True) -> None:
        self.world: World = make_world(slope(0.0), gnss=gnss)
        self.link, self.suite = link, SensorSuite(self.world)
        self.peer = Px4Peer(link, LocalFrame(self.world.origin), (0.0, 0.0, 0.0), "memory")
        self.step_number = 0
        self.peer.listen()

    def run(self, seconds: float, spoil: Callable[[Sensed], Sensed] = lambda sensed: sensed) -> None:
        for _ in range(round(seconds * STEPS_PER_S)):
            truth = standing(self.step_number)
            self.peer.step(truth, spoil(self.suite.read(truth)), self.link.wait)
            self.step_number += 1
            self.link.now_s = max(self.link.now_s, self.step_number / STEPS_PER_S)


def test_a_minute_in_lockstep_without_slip_at_the_rates_that_px4_wants() -> None:
    """The double itself checks every message, its rates among them."""
    px4 = Px4Double(armed_from(1.0, 0.5, 0.25))
    link = MemoryPx4(px4, latency_s=0.002)
    rig = Rig(link)
    rig.run(60.0)
    believed, slip = px4.checks.believed, rig.peer.lockstep.slip
    assert (believed.sensors, believed.fixes) == (15_000, 300)
    assert believed.truths == pytest.approx(12_000, abs=2)
    assert rig.peer.side_shares == (0.25, 0.5)
    assert slip.answers == pytest.approx(59 * STEPS_PER_S, abs=2)
    assert slip.given_up == link.most_pending == 0
    assert (slip.late, slip.most_steps) == (0, 0)  # but for the first of an armed PX4, for which nobody waited
    assert link.now_s == pytest.approx(60.0)


def test_nobody_waits_for_a_px4_that_is_not_armed() -> None:
    link = MemoryPx4(Px4Double(resting), latency_s=0.001)
    Rig(link).run(2.0)
    assert link.waited_s == []


def test_nobody_waits_for_a_px4_without_lockstep() -> None:
    link = MemoryPx4(Px4Double(armed_from(0.0, 0.5, 0.5), lockstep=False))
    Rig(link).run(2.0)
    assert link.waited_s == []


def test_the_wait_for_a_step_is_no_longer_than_ten_milliseconds() -> None:
    """PX4 falls silent while armed: one short wait, one longer one, then the world goes on without it."""
    px4 = Px4Double(armed_from(0.0, 0.5, 0.5), silent_usec=((1_000_000, 2_000_000),))
    link = MemoryPx4(px4)
    rig = Rig(link)
    rig.run(1.5)
    waits = [seconds for seconds in link.waited_s if seconds > 0.0]
    assert waits[:2] == pytest.approx([WAIT_S, LATE_S])
    assert waits[2:] == pytest.approx([SILENT_S] * len(waits[2:]))
    assert rig.peer.side_shares == (0.0, 0.0)  # what PX4 said last is old
    rig.run(1.0)
    assert rig.peer.side_shares == (0.5, 0.5)
    assert rig.peer.lockstep.slip.most_steps <= 1


@pytest.mark.parametrize("period_usec", [8000, 10_000, 20_000])
def test_steps_that_run_no_controller_are_not_waited_for(period_usec: int) -> None:
    """PX4's rover controllers run every 10 ms: 3 of 5 steps bring no controls, and cost little once that is known."""
    px4 = Px4Double(armed_from(0.0, 0.5, 0.5), period_usec=period_usec)
    link = MemoryPx4(px4, latency_s=0.0005)
    rig = Rig(link)
    rig.run(4.0)
    assert rig.peer.lockstep.slip.most_steps <= 1
    assert link.now_s < 5.0, "much slower than real time"


def test_a_px4_slower_than_the_wait_is_one_step_behind_and_no_more() -> None:
    """15 ms a step: ten are waited, then the next step is sent, and no third before the answer to the first."""
    link = MemoryPx4(Px4Double(armed_from(0.0, 0.5, 0.5)), latency_s=lambda answers: 0.015 if answers > 10 else 0.0)
    rig = Rig(link)
    rig.run(4.0)
    assert rig.peer.lockstep.slip.most_steps <= 1
    assert link.most_pending <= 1


def test_a_px4_that_hangs_for_a_moment_is_caught_up_with() -> None:
    """Half a second once: the world goes on alone, then waits until PX4 has worked off what it missed."""
    link = MemoryPx4(Px4Double(armed_from(0.0, 0.5, 0.5)), latency_s=lambda answers: 0.5 if answers == 100 else 0.0005)
    rig = Rig(link)
    rig.run(1.4)
    before = rig.peer.lockstep.slip
    rig.run(1.0)
    assert rig.peer.lockstep.slip.late == before.late
    assert rig.peer.side_shares == (0.5, 0.5)


def test_a_second_message_for_one_step_is_no_late_answer() -> None:
    """Its outputs may be told in two messages; the newest counts, the step was answered by the first."""
    lockstep = Lockstep()
    for step in range(1, 20):
        lockstep.send(4000 * step)
        lockstep.hear(controls(4000 * step, 0.1))
        if step == 10:
            lockstep.send(4000 * 11)
            lockstep.hear(controls(4000 * 10, 0.3))
            assert lockstep.side_shares == (0.3, 0.3)
    assert (lockstep.slip.late, lockstep.slip.most_steps) == (0, 0)


def test_px4_restarts_and_is_served_anew() -> None:
    """The wheels stop with the old one; the new one's clock begins at our time and it is asked for nothing old."""
    link = MemoryPx4(Px4Double(armed_from(0.0, 0.5, 0.5)))
    rig = Rig(link)
    rig.run(2.0)
    assert rig.peer.side_shares == (0.5, 0.5)
    link.disconnect()
    rig.peer.listen()
    assert (rig.peer.connected, rig.peer.lacks, rig.peer.side_shares) == (False, "PX4 at memory", (0.0, 0.0))
    px4 = Px4Double(armed_from(1.0, 0.1, 0.2))
    link.connect(px4)
    rig.peer.listen()
    rig.run(2.0)
    assert rig.peer.lacks == ""
    assert rig.peer.side_shares == pytest.approx((0.2, 0.1))
    assert px4.checks.believed.sensors == 2 * STEPS_PER_S


def test_truth_is_told_only_where_it_is_asked_for() -> None:
    px4 = Px4Double(asks_truth=False)
    Rig(MemoryPx4(px4)).run(1.0)
    assert px4.checks.believed.truths == 0


def test_a_rover_without_receiver_sends_no_fixes() -> None:
    px4 = Px4Double(gnss=False)
    Rig(MemoryPx4(px4), gnss=False).run(1.0)
    assert px4.checks.believed.fixes == 0


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (lambda sensed: replace(sensed, magnetometer=None), "no magnetometer"),
        (lambda sensed: replace(sensed, barometer=None), "no barometer"),
        (lambda sensed: replace(sensed, gnss=None), "no HIL_GPS"),
        (lambda sensed: replace(sensed, imu=replace(sensed.imu, specific_force_m_s2=(0, 0, 9.8))), "z is down"),
    ],
)
def test_the_double_finds_what_is_missing(spoil: Callable[[Sensed], Sensed], text: str) -> None:
    with pytest.raises(ViolationError, match=text):
        Rig(MemoryPx4(Px4Double())).run(2.0, spoil)


def test_the_double_finds_a_step_of_the_wrong_length() -> None:
    rig = Rig(MemoryPx4(Px4Double()))
    rig.run(0.1)
    rig.step_number += 1
    with pytest.raises(ViolationError, match="a step of 8000 us"):
        rig.run(0.1)


def test_outputs_are_those_of_the_controller() -> None:
    rig = Rig(MemoryPx4(Px4Double(lambda _: Outputs(True, -1.0, 1.0))))
    rig.run(0.1)
    assert rig.peer.side_shares == (1.0, -1.0)
