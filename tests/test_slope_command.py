from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from rover_sim import parallel
from rover_sim.cli import main
from rover_sim.commands.slope import parse_slopes
from rover_sim.parallel import run_tasks
from rover_sim.slope import campaign
from rover_sim.slope.campaign import Campaign, Point, Task, of_kind
from rover_sim.slope.rig import SlopePoint

ROW_KEYS = {
    "soil",
    "gravity_m_s2",
    "rover",
    "direction",
    "slope_deg",
    "slip",
    "sinkage_m",
    "drawbar_N",
    "power_W",
    "stalled",
    "embedded",
    "band",
    "inside",
}
QUICK = ["slope", "--soil", "firm", "--slopes", "0,10", "--speed", "0.6", "--workers", "1", "--out"]


@pytest.mark.parametrize(
    ("text", "slopes"),
    [
        ("0:30:5", (0, 5, 10, 15, 20, 25, 30)),
        ("0:1:0.3", (0, 0.3, 0.6, 0.9)),
        ("17.5", (17.5,)),
        ("0,10,17.5", (0, 10, 17.5)),
        ("5:5:1", (5,)),
    ],
)
def test_slopes_are_spans_or_lists(text: str, slopes: tuple[float, ...]) -> None:
    assert parse_slopes(text) == pytest.approx(slopes)


@pytest.mark.parametrize(
    "text",
    ["", ",", "a", "0:30", "0:30:0", "30:0:5", "0:60:5", "-5,5", "5,5", "nan", "0:inf:5", "0:1e9:1e-9", "0:45:0.1"],
)
def test_slopes_that_cannot_be_are_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="FROM:TO:STEP"):
        parse_slopes(text)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--soil", "mud"], ["--soil 'mud'", "loose_sand"]),
        (["--rover", "tank"], ["--rover 'tank'", "husky"]),
        (["--speed", "3"], ["--speed 3", "1.02 m/s"]),
    ],
)
def test_wrong_input_is_one_line(
    arguments: Sequence[str], words: Sequence[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["slope", *arguments, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert all(word in said for word in words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "arguments", [["--gravity", "-1"], ["--gravity", "nan"], ["--load", "x"], ["--workers", "0"], ["--slopes", "9:1:1"]]
)
def test_wrong_numbers_name_the_option(arguments: Sequence[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["slope", *arguments])
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    assert arguments[0] in said
    assert said.count("\n") == 1


def test_a_campaign_leaves_table_report_and_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(campaign, "IMPOSED_SLIPS", (0.05, 0.5))
    monkeypatch.setattr(campaign, "RADII_IN_TRACKS", (0.0, 4.0))
    assert main([*QUICK, str(tmp_path)]) == 0
    report = json.loads((tmp_path / "slope.json").read_text())
    assert report["complete"] is True
    assert [(row["direction"], row["slope_deg"]) for row in report["rows"]] == [
        (direction, slope_deg) for direction in ("up", "down", "across") for slope_deg in (0.0, 10.0)
    ]
    for row in report["rows"]:
        assert set(row) >= ROW_KEYS
        assert (row["band"] is None) == (row["inside"] is None)
    assert [axis["axis"] for axis in report["tilt_table"]] == ["lateral", "uphill", "downhill"]
    assert report["turning"][0]["drift_m"] <= 0.10
    assert {"slip", "pull_N", "pull_per_weight"} <= set(report["drawbar"][0])
    assert all(curve["source"] and curve["confidence"] for curve in report["published"])
    _check_table(tmp_path / "slope.csv", report["rows"])
    assert (tmp_path / "slope.png").read_bytes().startswith(b"\x89PNG")
    said = capsys.readouterr().out
    assert "2 of 2 points with a published band inside it" in said


def _check_table(path: Path, rows: list[dict[str, Any]]) -> None:
    with path.open(newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(rows)
    for cells, row in zip(table, rows, strict=True):
        assert float(cells["slip"]) == row["slip"]
        assert cells["inside"] == ("" if row["inside"] is None else str(row["inside"]).lower())
        assert (cells["band_low"], cells["band_high"]) == tuple(map(str, row["band"] or ("", "")))


def _point(slope_deg: float, *, inside: bool | None = True) -> SlopePoint:
    band = None if inside is None else (0.0, 1.0)
    return SlopePoint("firm", 9.81, "husky", "up", slope_deg, 0.1, 0.0, 0.0, 0.0, 0.0, False, False, band, inside)


def test_an_interrupted_campaign_keeps_what_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(_tasks: Sequence[Task], _workers: int) -> Iterator[tuple[int, Point]]:
        yield 1, _point(10.0, inside=False)
        yield 0, _point(0.0)
        raise KeyboardInterrupt

    (tmp_path / "slope.png").write_bytes(b"old")
    monkeypatch.setattr(parallel, "run_tasks", stopped)
    assert main([*QUICK, str(tmp_path)]) == 130
    report = json.loads((tmp_path / "slope.json").read_text())
    assert report["complete"] is False
    assert [row["slope_deg"] for row in report["rows"]] == [0.0, 10.0]
    assert report["turning"] == []
    assert (tmp_path / "slope.png").read_bytes().startswith(b"\x89PNG")
    assert "1 of 2 points with a published band inside it; outside: firm 10 deg" in capsys.readouterr().out


def test_points_come_in_the_order_of_their_tasks() -> None:
    points: dict[int, Point] = {2: _point(20.0), 0: _point(0.0), 1: _point(10.0)}
    assert [point.slope_deg for point in of_kind(points, SlopePoint)] == [0.0, 10.0, 20.0]


def test_processes_measure_the_same_as_this_one() -> None:
    tasks = Campaign(("firm",), (0.0, 10.0), ("up",), 9.81, "husky", 0.0, 0.6).tasks()[:2]
    alone = dict(run_tasks(tasks, 1))
    assert dict(run_tasks(tasks, 2)) == alone
    assert len(alone) == 2
