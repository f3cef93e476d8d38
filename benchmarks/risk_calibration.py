"""Risk forecasts against what happened: drives with the whole physics, scores and the reliability diagram.

    OMP_NUM_THREADS=1 uv run python -m benchmarks.risk_calibration [--drives 600] [--rollouts 100] [--folder DIR]
        [--picture FILE.png]

The drives (`risk_drives.py`) and their forecasts go to two files of the folder, a row each, and a run goes on where the
last one ended. Two of five drives are for calibration: a line through the logits is fitted on them. All figures are of
the other three but for the first 40 drives, by which the model was made: the forecast as it is and with that line.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.risk_drives import Outcome, as_row, drive, make_drive
from planner.risk import Vehicle, forecast
from planner.risk_scores import EVENTS, Line, fit_line, reliability, scores
from rover_sim.report.reliability_plot import draw_reliability
from worlds.types import BoolArray, FloatArray

FOLDER = Path("runs/risk")
STREAM = 7702
ASTRAY_M = 0.25  # from the way
TRAINING = 2  # of five drives
SEEN = 40  # drives that the model was made by, and that are not tested on


@dataclass(frozen=True)
class Predicted:
    """The forecast of one drive."""

    number: int
    rollover: float
    immobilised: float
    fails: float
    astray: float  # farther from the way than ASTRAY_M
    lateral_mean_m: float
    lateral_p95_m: float


def predict(number: int, rollouts: int) -> Predicted:
    """The forecast of a drive, by what is believed of it."""
    plan = make_drive(number)
    rover, gravity = plan.rover, plan.world.scenario.gravity_m_s2
    vehicle = Vehicle(
        rover.footprint(), rover.wheel_shape(), rover.mass_kg, rover.centre_of_mass_b, rover.wheel.stiffness_N_m
    )
    rng = np.random.default_rng([STREAM, number])
    found = forecast(plan.way_w, plan.map, plan.error, plan.prior, vehicle, gravity, rng, rollouts)
    chances = found.rollover.probability, found.immobilised.probability, found.fails.probability
    astray = float((found.lateral_m > ASTRAY_M).mean())
    return Predicted(number, *chances, astray, found.lateral_mean_m, found.lateral_p95_m)


def resumed(path: Path, count: int, made: Callable[[int], dict[str, Any]]) -> list[dict[str, Any]]:
    """The first ``count`` rows: those of the file, and the others made now."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = path.read_text("utf-8") if path.is_file() else ""
    done: dict[int, dict[str, Any]] = {row["number"]: row for row in map(json.loads, text.splitlines())}
    with path.open("a", encoding="utf-8") as file:
        for number in range(count):
            if number not in done:
                done[number] = made(number)
                file.write(json.dumps(done[number]) + "\n")
                file.flush()
    return [done[number] for number in range(count)]


def happened(outcome: Outcome) -> dict[str, bool]:
    """What came true of a drive."""
    fails = outcome.rollover or outcome.immobilised
    return dict(zip(EVENTS, (outcome.rollover, outcome.immobilised, fails, outcome.lateral_m > ASTRAY_M), strict=True))


def report(name: str, forecasts: FloatArray, came: BoolArray, line: Line) -> None:
    """Print the scores of one event."""
    for kind, values in (("as it is", forecasts), ("calibrated", line.applied(forecasts))):
        score = scores(values, came)
        print(
            f"{name:12s} {kind:11s} n {len(came)} forecast {values.mean():.3f} happened {came.mean():.3f} "
            f"ECE {score.ece:.3f} Brier {score.brier:.4f} base {score.base:.4f} skill {100.0 * score.skill:.0f} %"
        )


def main() -> None:
    """Drive and forecast what is missing, then print and draw."""
    parser = argparse.ArgumentParser(description="Risk forecasts against what happened.")
    parser.add_argument("--drives", type=int, default=600)
    parser.add_argument("--rollouts", type=int, default=100)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--picture", type=Path, help="PNG of the reliability diagram")
    arguments = parser.parse_args()
    count, folder = arguments.drives, arguments.folder
    rows = resumed(folder / "drives.jsonl", count, lambda number: as_row(drive(make_drive(number))))
    found = [
        Predicted(**row)
        for row in resumed(
            folder / "forecasts.jsonl", count, lambda number: asdict(predict(number, arguments.rollouts))
        )
    ]
    outcomes = [Outcome(**row) for row in rows]
    training = np.array([number % 5 < TRAINING for number in range(count)])
    testing = ~training & (np.arange(count) >= SEEN)
    curves = {}
    for name in EVENTS:
        forecasts = np.array([getattr(row, name) for row in found])
        came = np.array([happened(outcome)[name] for outcome in outcomes])
        line = fit_line(forecasts[training], came[training])
        report(name, forecasts[testing], came[testing], line)
        print(f"{'':12s} logit {line.slope:.2f} x + {line.offset:.2f}")
        curves[name] = {
            "as it is": reliability(forecasts[testing], came[testing]),
            "calibrated": reliability(line.applied(forecasts[testing]), came[testing]),
        }
    tested = [(row, outcome) for row, outcome, test in zip(found, outcomes, testing, strict=True) if test]
    inside = np.mean([outcome.lateral_m <= row.lateral_p95_m for row, outcome in tested])
    mean, was = (
        float(np.mean(values)) for values in ([r.lateral_mean_m for r, _ in tested], [o.lateral_m for _, o in tested])
    )
    print(f"largest distance from the way: forecast {mean:.3f} m, was {was:.3f} m; {100 * inside:.0f} % below p95")
    if arguments.picture:
        draw_reliability(curves, arguments.picture)


if __name__ == "__main__":
    main()
