"""A small cell of the suite ``nav`` at CFA 10 %, the whole loop: rendered camera, planner, link, soil and rocks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from rover_sim.trials.drive import drive
from rover_sim.trials.suites import Choices, trials_of

CELL: Choices = {"cfa": (0.1,), "slope_deg": (0.0,), "soil": ("mars_sand",)}
GOAL_M = (8.0, 0.0)  # nearer than the suite's 20 m, to be driven in seconds


@pytest.mark.timeout(300)  # from a clean checkout everything that the loop needs is compiled first
@pytest.mark.parametrize("seed", [100, 102])
def test_the_rover_reaches_the_goal_and_breaks_no_limit(seed: int, tmp_path: Path) -> None:
    (trial,) = trials_of("nav", CELL, [seed], None)
    goal = msgspec.structs.replace(trial.scenario.goal, position_m=GOAL_M, time_limit_s=120.0)
    near = replace(trial, scenario=msgspec.structs.replace(trial.scenario, goal=goal))
    row = drive(near, tmp_path, "none")
    assert row.reason == "goal", row.metrics["detail"]
    assert row.metrics["violations"] == []
    assert row.metrics["path_inefficiency"] < 1.0
