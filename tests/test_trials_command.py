"""The trials command as a user meets it."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from rover_sim import __version__, parallel
from rover_sim.cli import main
from rover_sim.commands.trials import _cells, _seeds
from rover_sim.trials.trial import Row

SHORT = """
name = "short"
[terrain]
kind = "flat"
size_m = [12.0, 10.0]
resolution_m = 0.1
[rocks]
cfa = 0.0
[soil]
preset = "firm"
[goal]
position_m = [2.0, 0.5]
time_limit_s = 60.0
[sensors]
laser = true
[camera]
rate_hz = 0.0
"""
METRICS = {"oracle_length_m": 2.0, "spl": 1.0, "violations": []}
COLUMNS = ["key", "suite", "cell", "seed", "success", "reason", "metrics", "error", "wall_time_s", "version"]


def _trials(out: Path, *arguments: str) -> int:
    scenario = out.parent / "short.toml"
    scenario.write_text(SHORT)
    return main(["trials", str(scenario), "--out", str(out), *arguments])


@pytest.mark.timeout(400)  # two spawned processes that import everything: slow where others load the machine
def test_trials_leave_table_and_report_and_go_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert _trials(out, "--seeds", "1", "--workers", "1") == 0
    assert _trials(out, "--seeds", "2", "--workers", "1", "--resume", "--keep", "all") == 0
    assert "1 of 2 are done" in capsys.readouterr().err
    connection = sqlite3.connect(out / "results.sqlite")
    cursor = connection.execute("SELECT * FROM trials ORDER BY seed")
    assert [column[0] for column in cursor.description] == COLUMNS
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in cursor]
    connection.close()
    assert [(row["seed"], row["success"], row["reason"], row["error"]) for row in rows] == [
        (0, 1, "goal", None),
        (1, 1, "goal", None),
    ]
    metrics = json.loads(rows[1]["metrics"])
    assert {"distance_m", "sim_time_s", "spl", "oracle_length_m", "violations", "version"} <= metrics.keys()
    assert metrics["spl"] > 0.8
    report = json.loads((out / "report.json").read_text())
    (cell,) = report["cells"]
    assert (report["complete"], cell["n"], cell["successes"], cell["rate"]) == (True, 2, 2, 1.0)
    assert 0.3 < cell["wilson_low"] < cell["wilson_high"] == 1.0
    assert (out / "runs" / "short_scenario-short_seed-1" / "map.png").stat().st_size > 0
    assert not (out / "runs" / "short_scenario-short_seed-0").exists()
    assert not list(out.glob(".trial-*"))
    assert (out / "report.html").read_text().startswith("<!doctype html>")
    assert _trials(out, "--seeds", "1") == 2
    assert "--resume" in capsys.readouterr().err


def test_an_interrupted_suite_keeps_its_rows_and_leaves_a_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"

    def stopped(_tasks: object, _workers: int, _timeout_s: float) -> Iterator[tuple[int, Row | parallel.Lost]]:
        (out / ".trial-of-one-under-way").mkdir()
        yield (
            3,
            Row(
                "short/scenario=short/seed=3",
                "short",
                {"scenario": "short"},
                3,
                True,
                "goal",
                METRICS,
                None,
                1.0,
                __version__,
            ),
        )
        yield 1, parallel.Lost("its process died with exit code 9")
        raise KeyboardInterrupt

    monkeypatch.setattr(parallel, "in_processes", stopped)
    assert _trials(out, "--seeds", "5") == 130
    report = json.loads((out / "report.json").read_text())
    assert (report["complete"], report["planned"]) == (False, 5)
    assert report["total"]["reasons"] == {"goal": 1, "error": 1}
    assert "died with exit code 9" in (out / "report.html").read_text()
    assert not list(out.glob(".trial-*"))
    assert "1 of 2" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nab"], "no such suite"),
        (["obstacle-course"], "--worlds"),
        (["obstacle-course", "--worlds", "/nowhere"], "/nowhere: no such folder"),
        (["nav", "--cells", "cfa"], "give NAME=VALUE"),
        (["nav", "--seeds", "0"], "1 to 100000 seeds"),
        (["nav", "--seeds", "x"], "give a number of seeds"),
        (["nav", "--workers", "0"], "1 to 256"),
    ],
)
def test_wrong_input_is_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(["trials", *arguments, "--out", str(tmp_path / "out")])
    except SystemExit as end:
        code = int(end.code or 0)
    said = capsys.readouterr().err
    assert code == 2
    assert said.count("\n") == 1
    assert words in said
    assert not (tmp_path / "out").exists()


def test_seeds_and_cells_are_numbers_lists_or_spans() -> None:
    assert list(_seeds("3")) == [0, 1, 2]
    assert list(_seeds("5:7")) == [5, 6]
    assert _cells("cfa=0.05,0.1") == ("cfa", (0.05, 0.1))
    assert _cells("world=0:12:6") == ("world", (0.0, 6.0))
    assert _cells("soil=firm") == ("soil", ("firm",))
