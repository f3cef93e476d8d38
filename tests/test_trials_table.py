"""Trial suites: table, statistics, worlds, oracle and the pool, each on its own."""

from __future__ import annotations

import os
import sqlite3
import threading
from collections.abc import Callable
from functools import partial
from math import hypot, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rover_sim.errors import InputError
from rover_sim.parallel import Lost, in_processes
from rover_sim.report.trials_report import page, report
from rover_sim.sim.rover import load_rover
from rover_sim.trials.course import Course, CourseMaps, course_scenario, score
from rover_sim.trials.drive import lost, trial_figures, violations
from rover_sim.trials.oracle import oracle_length_m
from rover_sim.trials.statistics import figures, wilson
from rover_sim.trials.store import NAME, open_store
from rover_sim.trials.suites import EYES, NAV, trials_of
from rover_sim.trials.trial import Row, Trial
from tests.data import data_path
from worlds.build import build_world
from worlds.scenario import Goal, Obstacle, Rocks, Scenario, Terrain

LENGTH_M = 10.0


def _row(
    number: int,
    *,
    success: bool = True,
    oracle_m: float | None = LENGTH_M,
    reason: str = "goal",
    version: str = "0.1.0",
) -> Row:
    metrics: dict[str, Any] = {
        "oracle_length_m": oracle_m,
        "spl": 0.8 if success else 0.0,
        "violations": [],
        "distance_m": 12.0,
    }
    return Row(f"k{number}", "nav", {"cfa": 0.1}, number, success, reason, metrics, None, 1.0, version)


@pytest.mark.parametrize(
    ("successes", "count", "low", "high"),
    # By hand from (p + z2/2n +- z sqrt(p q / n + z2/4n2)) / (1 + z2/n).
    [(0, 0, 0.0, 1.0), (9, 10, 0.5958, 0.9821), (0, 10, 0.0, 0.2775), (198, 200, 0.9643, 0.9973)],
)
def test_wilson_interval(successes: int, count: int, low: float, high: float) -> None:
    assert wilson(successes, count) == pytest.approx((low, high), abs=1e-4)


def test_rows_come_back_as_they_were_written_and_the_last_of_a_key_counts(tmp_path: Path) -> None:
    with open_store(tmp_path, resume=False) as store:
        store.add(_row(1))
        store.add(_row(2))
        store.add(_row(1, success=False, reason="timeout"))
        assert store.rows() == [_row(2), _row(1, success=False, reason="timeout")]
    with open_store(tmp_path, resume=True) as store:
        assert len(store.rows()) == 2


def test_a_table_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    with open_store(tmp_path, resume=False) as store:
        store.add(_row(1))
    with pytest.raises(InputError, match="--resume"), open_store(tmp_path, resume=False):
        pass


def test_a_table_of_another_version_is_refused(tmp_path: Path) -> None:
    with open_store(tmp_path, resume=False) as store:
        store.add(_row(1, version="0.0.1"))
    with pytest.raises(InputError, match=r"version 0\.0\.1, this is"), open_store(tmp_path, resume=True):
        pass


def test_other_columns_and_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / NAME
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE trials(key TEXT PRIMARY KEY, outcome TEXT)")
    connection.close()
    with pytest.raises(InputError, match="other columns, key, outcome"), open_store(tmp_path, resume=True):
        pass
    path.write_text("no database")
    with pytest.raises(InputError, match="not a table of trials"), open_store(tmp_path, resume=True):
        pass


def test_figures_tell_refusals_from_failures() -> None:
    refusal = _row(2, success=False, oracle_m=None, reason="no_path")
    refusal = Row(**{**vars(refusal), "metrics": {**refusal.metrics, "refused": True}})
    crash = lost(Trial("nav", {"cfa": 0.1}, 3, Scenario(name="x")), "its process died with exit code 1")
    found = figures([_row(1), refusal, crash])
    assert (found["n"], found["successes"], found["reachable"], found["refused"], found["errors"]) == (3, 1, 1, 1, 1)
    assert found["reasons"] == {"goal": 1, "no_path": 1, "error": 1}
    assert found["means"]["distance_m"] == 12.0


def test_report_page_escapes_and_links() -> None:
    row = _row(1, success=False, reason="collision")
    row = Row(**{**vars(row), "key": "a<b>", "metrics": {**row.metrics, "run_folder": "runs/a", "violations": ["tip"]}})
    text = page(report([row], 2), [row])
    assert "a&lt;b&gt;" in text
    assert 'href="runs/a/map.png"' in text
    assert "not complete: 1 of 2" in text
    assert "http" not in text  # nothing is fetched from anywhere


def test_spl_score_and_violations_by_hand() -> None:
    summary = {
        "success": True,
        "reason": "goal",
        "distance_m": 12.5,
        "sim_time_s": 20.0,
        "collisions": 1,
        "event_counts": {"high_centred": 0},
    }
    trace = {"velocity_w": np.array([[1.0, 0.0, -1.5]])}
    trial = Trial("obstacle-course", {}, 0, Scenario(name="x", gravity_m_s2=9.81), reference_m=12.0)
    found = trial_figures(trial, summary, trace, 10.0)
    assert found["spl"] == 0.8
    assert found["score"] == pytest.approx(6.0 / 20.0)
    assert found["violations"] == ["collision", "drop"]  # 1.5 m/s is a fall of 0.115 m
    assert violations({**summary, "collisions": 0}, {"velocity_w": np.zeros((2, 3))}, 9.81) == []


@pytest.mark.parametrize(
    ("time_s", "success", "expected"), [(5.0, True, 0.5), (15.0, True, 0.4), (90.0, True, 0.125), (15.0, False, 0.0)]
)
def test_benchmark_score(time_s: float, expected: float, *, success: bool) -> None:
    assert score(12.0, time_s, success=success) == pytest.approx(expected)  # the optimal time is 6 s


def _walled(gap_m: float) -> Scenario:
    """A wall of pillars along x = 5, with a gap whose middle lies at y = 3."""
    spots = np.arange(-4.8, 4.81, 0.1)
    pillars = tuple(
        Obstacle(kind="cylinder", position_m=(5.0, float(y)), radius_m=0.05, height_m=1.0)
        for y in spots
        if abs(y - 3.0) > gap_m / 2 + 0.05
    )
    return Scenario(
        name="wall",
        terrain=Terrain(kind="flat", size_m=(14.0, 9.6), resolution_m=0.1),
        rocks=Rocks(cfa=0.0),
        obstacle=pillars,
        goal=Goal(position_m=(10.0, 0.0), radius_m=0.5),
    )


def test_the_oracle_goes_through_the_gap_and_knows_when_it_is_too_narrow() -> None:
    footprint = load_rover("husky").footprint()
    wide = oracle_length_m(build_world(_walled(1.5), 0), footprint)
    taut = hypot(5.0, 3.0 - 0.75 + footprint.width_m / 2)  # along the near edge of the gap, nearly
    assert wide == pytest.approx(2 * taut - 0.5, rel=0.02)
    assert oracle_length_m(build_world(_walled(0.5), 0), footprint) is None


def test_the_oracle_of_an_empty_map_is_the_straight_line() -> None:
    scenario = Scenario(
        name="empty", terrain=Terrain(kind="flat"), rocks=Rocks(cfa=0.0), goal=Goal(position_m=(10.0, 2.0))
    )
    length = oracle_length_m(build_world(scenario, 0), load_rover("husky").footprint())
    assert length == pytest.approx(hypot(10.0, 2.0) - 0.5, abs=0.06)


def test_course_worlds_are_those_of_the_benchmark() -> None:
    maps = CourseMaps.read(data_path("worlds"))
    lengths = [maps.course(number).reference_m for number in maps.numbers]
    assert len(lengths) == 200
    assert min(lengths) > 10.0
    assert max(lengths) < 13.8
    assert np.mean(lengths) == pytest.approx(11.42, abs=0.1)
    clear = [
        np.linalg.norm(course.path_m[:, None] - course.cylinders_m[None], axis=2).min()
        for course in map(maps.course, maps.numbers)
    ]
    assert min(clear) > 0.14  # the reference way runs from cell to free cell: places and cells fit together


def test_a_course_is_the_world_that_was_given() -> None:
    course = Course(7, np.array([[-2.0, 6.0], [-3.0, 7.5]]), np.array([[-2.25, 3.0], [-2.25, 13.0]]))
    world = build_world(course_scenario(course, laser=True), 0)
    assert [cylinder.position_w[:2] for cylinder in world.cylinders] == [(-2.0, 6.0), (-3.0, 7.5)]
    assert world.scenario.sensors.laser
    assert len(world.rocks) == 0
    yaw = 2.0 * np.arctan2(world.start.quaternion_w[2], world.start.quaternion_w[3])
    assert yaw == pytest.approx(pi / 2)


def test_nav_cells_and_keys_are_unique_and_slopes_turn_with_the_seed() -> None:
    trials = trials_of("nav", {"cfa": (0.05, 0.1)}, range(3), None)
    assert len({trial.key for trial in trials}) == len(trials) == 2 * len(NAV["slope_deg"]) * len(NAV["soil"]) * 3
    assert trials[0].key == "nav/cfa=0.05/slope_deg=0/soil=firm/seed=0"
    assert len({trial.scenario.terrain.slope_azimuth_deg for trial in trials}) == 3


def test_nav_drives_with_the_stereo_pair_where_asked() -> None:
    trials = trials_of("nav", {"cfa": (0.05,), "soil": ("firm",), "slope_deg": (0.0,), "sensors": EYES}, [0], None)
    assert [trial.key.split("/")[-2] for trial in trials] == ["soil=firm", "sensors=stereo"]
    assert [trial.scenario.sensors.stereo for trial in trials] == [False, True]


def test_routes_are_driven_with_the_stereo_pair_where_asked() -> None:
    trials = trials_of("route", {"ground": ("hills",), "distance_m": (100.0,), "sensors": EYES}, [0], None)
    assert [trial.key for trial in trials] == [
        "route/ground=hills/distance_m=100/seed=0",
        "route/ground=hills/distance_m=100/sensors=stereo/seed=0",
    ]
    assert [trial.scenario.sensors.stereo for trial in trials] == [False, True]


@pytest.mark.parametrize(
    ("suite", "chosen", "words"),
    [
        ("nab", {}, "nab: no such suite; allowed: nav, obstacle-course"),
        ("nav", {"rocks": (1.0,)}, "--cells rocks: .* allowed: cfa, slope_deg, soil"),
        ("nav", {"cfa": (0.9,)}, "--cells: rocks.cfa = 0.9: allowed are 0 to 0.3"),
        ("nav", {"cfa": ("many",)}, "--cells cfa=many: must be a number"),
        ("nav", {"sensors": ("laser",)}, "--cells sensors=laser: allowed are camera and stereo"),
        ("nav", {"soil": ("mud",)}, "unknown soil; allowed: .*loose_sand"),
        ("obstacle-course", {}, "--worlds: the suite obstacle-course needs"),
        ("demo", {"cfa": (0.1,)}, "--cells cfa: a scenario is one cell"),
    ],
)
def test_wrong_suites_and_cells_are_named(suite: str, chosen: dict[str, tuple[float | str, ...]], words: str) -> None:
    with pytest.raises(InputError, match=words):
        trials_of(suite, chosen, range(1), None)


def test_wrong_folders_of_worlds_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        CourseMaps.read(tmp_path / "none")
    with pytest.raises(InputError, match=r"no barn_\*\.npz in it"):
        CourseMaps.read(tmp_path)
    (tmp_path / "barn_0.npz").write_text("text")
    with pytest.raises(InputError, match="cannot be read"):
        CourseMaps.read(tmp_path)
    np.savez(tmp_path / "barn_0.npz", cyl_0=np.zeros((1, 2)))
    with pytest.raises(InputError, match="some are missing"):
        CourseMaps.read(tmp_path)
    np.savez(tmp_path / "barn_0.npz", cyl_0=np.zeros((1, 2)), path_0=np.zeros((1, 2)))
    with pytest.raises(InputError, match="holds worlds 0 to 0"):
        CourseMaps.read(tmp_path).course(3)


def _double(value: int) -> int:
    return 2 * value


def _die() -> int:
    os._exit(7)


def _hang() -> int:
    threading.Event().wait()
    return 0


def _fail() -> int:
    raise ValueError("first line\nsecond")


def test_a_crash_a_hang_and_an_error_cost_one_task_each() -> None:
    tasks: list[Callable[[], int]] = [partial(_double, 1), _die, partial(_double, 2), _hang, partial(_double, 3), _fail]
    results = dict(in_processes(tasks, 2, timeout_s=1.0))
    assert [results[place] for place in (0, 2, 4)] == [2, 4, 6]
    texts = [found.text for place in (1, 3, 5) if isinstance(found := results[place], Lost)]
    assert texts == ["its process died with exit code 7", "ended after 1 s of wall time", "ValueError: first line"]
