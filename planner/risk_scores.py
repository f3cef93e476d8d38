"""How good forecasts of events are: Brier score, calibration error, and the line that calibrates them.

Brier, Monthly Weather Review 78(1), 1950; expected calibration error over bins of the forecast; a line through the
logits after Platt, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from worlds.types import BoolArray, FloatArray

EVENTS = ("rollover", "immobilised", "fails", "astray")
BINS = 10
LEAST = 0.005  # a forecast from a few hundred rollouts is never surer than that


@dataclass(frozen=True)
class Scores:
    """Scores of forecasts."""

    ece: float  # mean distance of forecast and frequency over bins, weighted by their counts
    brier: float
    base: float  # Brier score of always forecasting the frequency of the event

    @property
    def skill(self) -> float:
        """Share of the base's Brier score that is gone; 0 where the event always or never happens."""
        return 1.0 - self.brier / self.base if self.base > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Reliability:
    """Bins that hold forecasts."""

    forecast: FloatArray  # (bins,) mean
    happened: FloatArray  # (bins,) frequency
    count: FloatArray  # (bins,)


@dataclass(frozen=True)
class Line:
    """Calibration: logit of the answer = slope x logit of the forecast + offset."""

    slope: float = 1.0
    offset: float = 0.0

    def applied(self, forecasts: FloatArray) -> FloatArray:
        """Forecasts (N,), calibrated."""
        return np.asarray(1.0 / (1.0 + np.exp(-(self.slope * logit(forecasts) + self.offset))))


def logit(forecasts: FloatArray) -> FloatArray:
    """Logarithm of the odds, of forecasts held within 0.5 and 99.5 %."""
    held = np.clip(forecasts, LEAST, 1.0 - LEAST)
    return np.asarray(np.log(held / (1.0 - held)))


def scores(forecasts: FloatArray, happened: BoolArray) -> Scores:
    """Scores of forecasts (N,) against what happened (N,)."""
    bins, rate = reliability(forecasts, happened), float(np.mean(happened))
    ece = float((bins.count * np.abs(bins.forecast - bins.happened)).sum() / bins.count.sum())
    return Scores(ece, float(np.mean((forecasts - happened) ** 2)), rate * (1.0 - rate))


def reliability(forecasts: FloatArray, happened: BoolArray, bins: int = BINS) -> Reliability:
    """Forecasts in bins of equal width; empty bins are left out."""
    which = np.minimum((forecasts * bins).astype(np.int64), bins - 1)
    count = np.bincount(which, minlength=bins).astype(np.float64)
    held = count > 0.0
    sums = [np.bincount(which, values.astype(np.float64), minlength=bins)[held] for values in (forecasts, happened)]
    return Reliability(sums[0] / count[held], sums[1] / count[held], count[held])


def fit_line(forecasts: FloatArray, happened: BoolArray) -> Line:
    """The line of the greatest likelihood, held to a slope of 0.1 to 3 so that few events cannot turn it over."""
    odds, sign = logit(forecasts), np.where(happened, 1.0, -1.0)

    def loss(line: FloatArray) -> float:
        return float(np.logaddexp(0.0, -sign * (line[0] * odds + line[1])).sum())

    slope, offset = minimize(loss, [1.0, 0.0], method="L-BFGS-B", bounds=[(0.1, 3.0), (-5.0, 5.0)]).x
    return Line(float(slope), float(offset))
