"""However teleoperation ends, over a bad link: the wheels stand still within the configured time and 50 ms."""

from __future__ import annotations

import pytest

from tests.stick_trials import ENDINGS, run_trial


@pytest.mark.parametrize("numbers", [range(60), pytest.param(range(1000), marks=pytest.mark.slow)], ids=["60", "1000"])
def test_the_wheels_stand_still_in_time(numbers: range) -> None:
    trials = [run_trial(number) for number in numbers]
    assert [trial for trial in trials if not trial.in_time] == []
    assert sum(trial.drove for trial in trials) >= 0.97 * len(trials)  # some are too short for a link that bad
    assert {trial.ending for trial in trials} == set(ENDINGS)
