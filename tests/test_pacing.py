"""Steps kept to wall time, and how steady they were, on a clock that the test moves."""

from __future__ import annotations

import pytest

from rover_sim import pacing


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def perf_counter(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(pacing, "time", made)
    return made


def test_a_step_that_was_done_early_has_time_left(clock: Clock) -> None:
    pace = pacing.Pace(forgiven_s=0.01)
    clock.now_s += 0.001
    assert pace.left_s(0.004) == pytest.approx(0.003)
    clock.now_s += 0.003
    assert pace.left_s(0.002) == pytest.approx(0.002), "a step may be given another length"


def test_a_little_lateness_is_made_good(clock: Clock) -> None:
    pace = pacing.Pace(forgiven_s=0.01)
    clock.now_s += 0.010
    assert pace.left_s(0.004) == pytest.approx(-0.006)
    clock.now_s += 0.001
    assert pace.left_s(0.004) == pytest.approx(-0.003)
    clock.now_s += 0.001
    assert pace.left_s(0.004) == pytest.approx(0.0)


def test_much_lateness_is_given_up(clock: Clock) -> None:
    pace = pacing.Pace(forgiven_s=0.01)
    clock.now_s += 1.0
    assert pace.left_s(0.004) == 0.0
    assert pace.left_s(0.004) == pytest.approx(0.004)


def test_the_beat_tells_rate_and_intervals_but_not_of_pauses(clock: Clock) -> None:
    beat = pacing.Beat()
    assert beat.figures() is None
    beat.tick()
    for interval_s in (0.004, 0.004, 0.004, 0.008):
        clock.now_s += interval_s
        beat.tick()
    beat.pause()
    clock.now_s += 60.0
    beat.tick()
    assert beat.figures() == {"rate_hz": 200.0, "median_ms": 4.0, "p99_ms": 8.0, "longest_ms": 8.0}
