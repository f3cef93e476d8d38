"""Forecasts of risk against what happened, over the rows of a suite: scores, and the bins of a reliability diagram."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from planner.risk_scores import Reliability, reliability, scores
from rover_sim.trials.trial import Row
from worlds.types import BoolArray, FloatArray

LEAST = 20  # forecasts with an outcome, for figures to be told
EVENTS = ("fails", "immobilised", "rollover")
OF = ("leg", "route")
Pairs = tuple[FloatArray, BoolArray]


def pairs(rows: Sequence[Row]) -> dict[str, Pairs]:
    """Forecasts (N,) and what happened (N,), by what of and which event, as in ``leg fails``.

    Legs and routes count that were driven to their end or failed; a refused route has no outcome, nor has a run that
    was ended by a rock or by time.
    """
    found: dict[str, Pairs] = {}
    for one in OF:
        told = [item for row in rows for item in _told(row, one)]
        for event in EVENTS:
            forecasts = np.array([item[event] for item in told], dtype=np.float64)
            happened = np.array([bool(item["happened"][event]) for item in told], dtype=bool)
            found[f"{one} {event}"] = forecasts, happened
    return found


def figures(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """Scores of each kind of forecast of which there are at least `LEAST`; the base is always to say the rate."""
    return {name: _scored(*found) for name, found in pairs(rows).items() if len(found[0]) >= LEAST}


def curves(rows: Sequence[Row]) -> dict[str, dict[str, Reliability]]:
    """The bins of each kind of forecast that has enough of them, and that came true at least once."""
    return {
        name: {f"{len(forecasts)} forecasts": reliability(forecasts, happened)}
        for name, (forecasts, happened) in pairs(rows).items()
        if len(forecasts) >= LEAST and happened.any()
    }


def _told(row: Row, one: str) -> Iterator[dict[str, Any]]:
    """The forecasts of a row that have an outcome."""
    risk = row.metrics.get("risk")
    if risk is None:
        return
    for item in risk["legs"] if one == "leg" else [risk["route"]]:
        if item["happened"] is not None and item["happened"]["fails"] is not None:
            yield item


def _scored(forecasts: FloatArray, happened: BoolArray) -> dict[str, float]:
    score = scores(forecasts, happened)
    return {
        "n": len(forecasts),
        "forecast": round(float(forecasts.mean()), 4),
        "happened": round(float(happened.mean()), 4),
        "brier": round(score.brier, 4),
        "base": round(score.base, 4),
        "skill": round(score.skill, 4),
        "ece": round(score.ece, 4),
    }
