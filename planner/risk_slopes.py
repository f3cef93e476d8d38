"""How likely a slope stops the rover or carries it off, soil unknown; and a price on that in the cost of a metre."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians, tan

import numpy as np

from planner.risk import Vehicle
from planner.risk_prior import SoilPrior, draw_soils
from planner.risk_soil import slips, traction
from planner.route_cost import BIN, BINS, SlopeCosts, SlopeLimits, expected
from worlds.types import FloatArray

SOILS = 100


@dataclass(frozen=True, eq=False)
class SlopeHazard:
    """Probability that a slope is more than the soil bears, a row for each of `planner.route_cost.ERRORS`."""

    along: FloatArray  # (levels, 2 BINS + 1), from steep down to steep up
    across: FloatArray  # (levels, BINS + 1)


def slope_hazard(
    prior: SoilPrior,
    vehicle: Vehicle,
    gravity_m_s2: float,
    rng: np.random.Generator,
    limits: SlopeLimits | None = None,
) -> SlopeHazard:
    """The share of the prior's soils in which slip, skid or slip angle pass their limits on steady slopes."""
    limits = limits or SlopeLimits()
    load_N = 0.25 * vehicle.mass_kg * gravity_m_s2
    curves = traction(draw_soils(prior, SOILS, rng), vehicle.wheel, load_N, gravity_m_s2).curves
    rises, leans = BIN * np.arange(-BINS, BINS + 1), BIN * np.arange(BINS + 1)
    along = np.array([[slips(curve, rise, 0.0, 0.0)[0] for rise in rises] for curve in curves])
    across = np.array([[slips(curve, 0.0, lean, 0.0)[1] for lean in leans] for curve in curves])
    over = np.where(rises > 0.0, along > limits.slip, along < -limits.skid).mean(axis=0)
    carried = (np.abs(across) > tan(radians(limits.slip_angle_deg))).mean(axis=0)
    return SlopeHazard(expected(over, mirrored=False), expected(carried, mirrored=True))


def priced(costs: SlopeCosts, hazard: SlopeHazard, price_m: float) -> SlopeCosts:
    """Costs in which a metre that surely fails costs ``price_m`` metres of level ground more."""
    return replace(costs, along=costs.along + price_m * hazard.along, across=costs.across + price_m * hazard.across)
