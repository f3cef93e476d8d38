"""The risk of a route before it is driven: a forecast of each leg and of the whole, and the limit on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.risk import ROLLOUTS, Chance, Forecast, Vehicle, forecasts, joined
from planner.risk_prior import MapError, SoilPrior
from planner.risk_slopes import SlopeHazard, slope_hazard
from planner.route import Place
from planner.route_marks import Leg
from worlds.types import FloatArray, HeightField

_HAZARD = 1  # last word of the seed


@dataclass(frozen=True, eq=False)
class RiskModel:
    """What forecasts of a route are made from, beside the map, and how much risk is allowed."""

    error: MapError
    prior: SoilPrior
    vehicle: Vehicle
    gravity_m_s2: float
    seed: tuple[int, ...]
    limit: float | None = None  # of the probability that the rest of a route fails; None: none
    rollouts: int = ROLLOUTS

    @property
    def hazard(self) -> SlopeHazard:
        """How likely slopes fail in the soils that may lie there."""
        rng = np.random.default_rng([*self.seed, _HAZARD])
        return slope_hazard(self.prior, self.vehicle, self.gravity_m_s2, rng)


@dataclass(frozen=True, eq=False)
class RouteRisk:
    """The forecasts of a route's legs and of all of them together."""

    ways_w: tuple[FloatArray, ...]  # of each leg, (2, 2): navigation drives legs straight
    legs: tuple[Forecast, ...]
    whole: Forecast

    @property
    def riskiest(self) -> int:
        """Number of the leg that fails most likely, from 0; the first of equals."""
        return int(np.argmax([leg.fails.probability for leg in self.legs]))

    def within(self, limit: float | None) -> bool:
        """Whether the route fails no more likely than a limit."""
        return limit is None or self.whole.fails.probability <= limit


def route_risk(model: RiskModel, ground: HeightField, start_w: Place, legs: Sequence[Leg], number: int) -> RouteRisk:
    """The risk of legs (one at least) driven from a place over the believed map; ``number`` tells draws apart."""
    ends = [np.asarray(start_w), *(np.asarray(leg.end_w) for leg in legs)]
    ways = tuple(np.array(pair) for pair in pairwise(ends))
    rng = np.random.default_rng([*model.seed, 0, number])
    found = forecasts(ways, ground, model.error, model.prior, model.vehicle, model.gravity_m_s2, rng, model.rollouts)
    return RouteRisk(ways, found, joined(found))


def in_words(risk: RouteRisk) -> str:
    """One sentence: how likely the route fails, and where most of all."""
    text = f"fails with a probability of {percent(risk.whole.fails)}"
    if len(risk.legs) == 1 or risk.whole.fails.probability == 0.0:
        return text
    (x, y), (end_x, end_y) = risk.ways_w[risk.riskiest]
    worst = percent(risk.legs[risk.riskiest].fails)
    leg = f"leg {risk.riskiest + 1}, ({x:.1f}, {y:.1f}) to ({end_x:.1f}, {end_y:.1f}) m"
    return f"{text}, most likely on {leg}: {worst}"


def percent(chance: Chance) -> str:
    """A probability and its interval."""
    return f"{100 * chance.probability:.0f} % ({100 * chance.low:.0f} to {100 * chance.high:.0f})"
