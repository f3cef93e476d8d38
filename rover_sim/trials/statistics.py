"""From rows to figures: success with its interval, means, reasons, a line a cell."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from rover_sim.trials.trial import Row

OF_SUCCESSES = ("path_inefficiency", "sim_time_s", "distance_m")  # means over successes only; others over all
NOT_AVERAGED = ("wall_time_s", "world")


def wilson(successes: int, count: int) -> tuple[float, float]:
    """95 % score interval of a rate (Wilson, JASA 22, 1927); (0, 1) for no trials."""
    if count == 0:
        return 0.0, 1.0
    z2 = 1.959964**2
    middle = (successes + z2 / 2) / (count + z2)
    half = z2**0.5 / (count + z2) * (successes * (count - successes) / count + z2 / 4) ** 0.5
    return max(middle - half, 0.0), min(middle + half, 1.0)


def cells(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """The figures of each cell, in the order in which the cells first came."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(json.dumps([row.suite, row.cell]), []).append(row)
    return [{"suite": group[0].suite, "cell": dict(group[0].cell), **figures(group)} for group in groups.values()]


def figures(rows: Sequence[Row]) -> dict[str, Any]:
    """Count, successes and their interval, violations, refusals, reasons and means of some rows."""
    successes = sum(row.success for row in rows)
    low, high = wilson(successes, len(rows))
    broken = Counter(kind for row in rows for kind in row.metrics.get("violations", ()))
    reachable = [row for row in rows if row.error is None and row.metrics["oracle_length_m"] is not None]
    return {
        "n": len(rows),
        "successes": successes,
        "rate": successes / len(rows) if rows else 0.0,
        "wilson_low": low,
        "wilson_high": high,
        "reachable": len(reachable),
        "refused": sum(bool(row.metrics.get("refused")) for row in rows),
        "safety_violations": sum(bool(row.metrics.get("violations")) for row in rows),
        "violations": dict(broken),
        "reasons": dict(Counter(row.reason for row in rows).most_common()),
        "errors": sum(row.error is not None for row in rows),
        "means": means(rows),
    }


def means(rows: Iterable[Row]) -> dict[str, float]:
    """Mean of every numeric metric, over the rows that have it; of `OF_SUCCESSES` over successes only."""
    values: dict[str, list[float]] = {}
    for row in rows:
        for name, value in row.metrics.items():
            numeric = isinstance(value, int | float) and not isinstance(value, bool)
            if numeric and name not in NOT_AVERAGED and (row.success or name not in OF_SUCCESSES):
                values.setdefault(name, []).append(float(value))
    return {name: sum(found) / len(found) for name, found in values.items()}
