"""The suite ``route``: its cells, its oracle, a refusal and a short traverse through the whole loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from rover_sim.errors import InputError
from rover_sim.trials.drive import drive
from rover_sim.trials.suites import Choices, trials_of
from tests.data import data_path
from worlds.route_table import RouteTable
from worlds.scenario import Goal, Rocks, Terrain


def test_cells_and_keys_are_unique_and_goals_lie_in_every_direction() -> None:
    trials = trials_of("route", {}, range(2), None)
    assert len({trial.key for trial in trials}) == 3 * 3 * 2
    for trial in trials:
        start, goal = trial.scenario.rover.start_m, trial.scenario.goal.position_m
        assert np.hypot(*np.subtract(goal, start)) == pytest.approx(trial.cell["distance_m"], abs=0.01)
    assert len({trial.scenario.rover.heading_deg for trial in trials}) == 2


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"ground": ("swamp",)}, "--cells ground=swamp: allowed are crater, dunes, wall, hills, swells, yard"),
        ({"ground": ("yard",), "distance_m": (20.0,)}, "--cells ground=yard: needs --worlds"),
    ],
)
def test_wrong_cells_are_named(chosen: Choices, words: str) -> None:
    with pytest.raises(InputError, match=words):
        trials_of("route", chosen, range(1), None)


def test_wrong_folders_and_distances_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--worlds .*: no marsyard2022_hm.tif in it"):
        trials_of("route", {}, range(1), tmp_path)
    (tmp_path / "marsyard2022_hm.tif").touch()
    with pytest.raises(InputError, match=r"distance_m=100: the real map allows up to 30"):
        trials_of("route", {"distance_m": (100.0,)}, range(1), tmp_path)


def test_a_wall_is_refused_at_once_and_counts_as_a_refusal(tmp_path: Path) -> None:
    (trial,) = trials_of("route", {"ground": ("wall",), "distance_m": (100.0,)}, [1], None)
    row = drive(trial, tmp_path, "none")
    assert row.reason == "no_path"
    assert row.metrics["refused"]
    assert row.metrics["refused_at_once"]
    assert row.metrics["distance_m"] < 0.1
    told = ("oracle_length_m", "oracle_cost", "cost_ratio", "planned_over_best", "driven_over_best")
    assert [row.metrics[name] for name in told] == [None] * len(told)
    assert row.metrics["way"] == "none"


def test_a_crater_is_gone_round_leg_by_leg(tmp_path: Path) -> None:
    (trial,) = trials_of("route", {"ground": ("crater",), "distance_m": (100.0,)}, [0], None)
    terrain = Terrain(
        kind="crater", size_m=(34.0, 30.0), resolution_m=0.1, roughness_m=0.03, feature_size_m=9.0, relief_m=2.0
    )
    scenario = msgspec.structs.replace(
        trial.scenario,
        terrain=terrain,
        rocks=Rocks(cfa=0.0),  # they are the navigator's matter
        rover=msgspec.structs.replace(trial.scenario.rover, start_m=(-8.0, 0.0), heading_deg=45.0),
        goal=Goal(position_m=(8.0, 0.0), radius_m=1.0, time_limit_s=120.0),
        route=RouteTable(error_m=0.05, leg_m=(4.0, 8.0), radius_m=1.5),
    )
    row = drive(replace(trial, scenario=scenario), tmp_path, "all")
    assert row.reason == "goal", row.metrics["detail"]
    assert row.metrics["cost_ratio"] < 1.15
    assert row.metrics["way"] == "within"
    assert row.metrics["planned_over_best"] == row.metrics["cost_ratio"]
    assert 0.95 < row.metrics["driven_over_best"] < 1.5
    assert row.metrics["route"]["legs_driven"] == len(row.metrics["route"]["legs"]) - 1
    assert row.metrics["max_tilt_deg"] < 16.0  # the crater's side has more than 30 deg
    assert (tmp_path / str(row.metrics["run_folder"]) / "map.png").exists()


def test_the_real_map_is_a_cell() -> None:
    (trial,) = trials_of("route", {}, [3], data_path("worlds"))
    assert trial.cell == {"ground": "yard", "distance_m": 30.0}
    assert trial.scenario.terrain.kind == "dem"
