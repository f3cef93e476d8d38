from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rover_sim.report import trials_report
from rover_sim.trials.reliability import LEAST, curves, figures, pairs
from rover_sim.trials.trial import Row


def forecast(fails: float, happened: bool | None) -> dict[str, Any]:
    """Of a leg or a route that fails by getting stuck, or does not."""
    came = None if happened is None else {"fails": happened, "immobilised": happened, "rollover": False}
    return {"fails": fails, "immobilised": fails, "rollover": 0.0, "happened": came}


def row(number: int, route: dict[str, Any], legs: Sequence[dict[str, Any]]) -> Row:
    metrics = {
        "risk": {"route": route, "legs": list(legs)},
        "oracle_length_m": 30.0,
        "distance_m": 31.0,
        "violations": [],
    }
    return Row(f"k{number}", "route", {"ground": "hills"}, number, True, "goal", metrics, None, 1.0, "1")


def rows() -> list[Row]:
    """Twenty routes of a forecast of a quarter, five of which failed, with two legs each; none of the second fails."""
    return [
        row(n, forecast(0.25, n % 4 == 0), [forecast(0.2, n % 4 == 0), forecast(0.0, happened=False)])
        for n in range(LEAST)
    ]


def test_forecasts_are_scored_by_hand() -> None:
    found = figures(rows())
    route = found["route fails"]
    # A quarter forecast and a quarter came: (5 x 0.75^2 + 15 x 0.25^2) / 20 = 0.1875, the base's own; calibrated.
    assert (route["n"], route["forecast"], route["happened"]) == (20, 0.25, 0.25)
    assert route["brier"] == route["base"] == pytest.approx(0.1875)
    assert (route["skill"], route["ece"]) == (0.0, 0.0)
    legs = found["leg fails"]
    assert (legs["n"], legs["forecast"], legs["happened"]) == (40, 0.1, 0.125)
    # 5 x 0.8^2 + 15 x 0.2^2 over 40 legs, against 0.125 x 0.875.
    assert legs["brier"] == pytest.approx((5 * 0.64 + 15 * 0.04) / 40, abs=1e-4)
    assert legs["base"] == pytest.approx(0.1094, abs=1e-4)
    assert found["leg rollover"]["brier"] == 0.0
    curve = curves(rows())["leg fails"]["40 forecasts"]
    np.testing.assert_allclose(curve.forecast, [0.0, 0.2])
    np.testing.assert_allclose(curve.happened, [0.0, 0.25])
    assert "leg rollover" not in curves(rows())  # a straight line along the bottom says nothing


def test_what_has_no_outcome_does_not_count() -> None:
    refused = row(100, forecast(0.9, None), [])
    unfinished = row(101, forecast(0.5, None), [forecast(0.5, happened=True), forecast(0.5, None)])
    plain = Row("p", "nav", {}, 0, True, "goal", {"risk": None}, None, 1.0, "1")
    lost = Row("e", "route", {}, 0, False, "error", {}, "crashed", 0.0, "1")
    found = pairs([refused, unfinished, plain, lost])
    assert len(found["route fails"][0]) == 0
    assert found["leg fails"][0].tolist() == [0.5]
    assert not figures([refused, unfinished])
    assert not curves([refused, unfinished])


def test_the_report_has_scores_and_the_diagram(tmp_path: Path) -> None:
    content = trials_report.write(tmp_path, rows(), LEAST)
    assert content["reliability"]["route fails"]["brier"] == 0.1875
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Risk forecasts" in page
    assert '<img src="reliability.png"' in page
    assert (tmp_path / "reliability.png").read_bytes()[:4] == b"\x89PNG"


def test_few_rows_have_neither(tmp_path: Path) -> None:
    content = trials_report.write(tmp_path, rows()[:5], 5)
    assert content["reliability"] == {}
    assert "reliability.png" not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert not (tmp_path / "reliability.png").exists()
