from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner import navigator
from planner import risk_kernels as kernels
from planner.risk import Forecast, Vehicle, clipped, forecasts, joined, summarise
from planner.risk_prior import MapError, SoilPrior, SoilSpread
from planner.risk_slopes import SlopeHazard, priced, slope_hazard
from planner.route import Refusal, way_cost
from planner.route_cost import BIN, BINS, ERRORS, SlopeCosts, slope_costs
from planner.route_following import MOST_REPLANS, Following, begin, blocked, driven_map, improved, least_risky
from planner.route_ground import ElevationMap
from planner.route_marks import LegModel
from planner.route_risk import RiskModel
from rover_sim.sim.rover import load_rover
from worlds.errors import InputError
from worlds.soil import soil_preset
from worlds.types import FloatArray, HeightField

MARS = 3.71
ROVER = load_rover("husky")
FOOTPRINT = ROVER.footprint()
VEHICLE = Vehicle(FOOTPRINT, ROVER.wheel_shape(), ROVER.mass_kg, ROVER.centre_of_mass_b, ROVER.wheel.stiffness_N_m)
PRIOR = SoilPrior((soil_preset("mars_sand"),), (1.0,))
COSTS = slope_costs("mars_sand", FOOTPRINT, "husky")
START, GOAL = (4.0, 20.0), (36.0, 20.0)


def results(ends: list[int], arcs: list[float], lateral: list[float]) -> Forecast:
    table = np.zeros((len(ends), kernels.RESULTS))
    table[:, kernels.END], table[:, kernels.ARC], table[:, kernels.LATERAL] = ends, arcs, lateral
    return summarise(table)


def test_a_route_fails_on_the_first_leg_that_does() -> None:
    arrived, over, stuck = kernels.ARRIVED, kernels.ROLLOVER, kernels.IMMOBILISED
    first = results([arrived, over, arrived, stuck], [8.0, 3.0, 8.0, 5.0], [0.1, 0.2, 0.3, 0.4])
    second = results([arrived, stuck, stuck, arrived], [6.0, 1.0, 2.0, 6.0], [0.2, 0.9, 0.1, 0.9])
    whole = joined([first, second])
    assert whole.ends.tolist() == [arrived, over, stuck, stuck]
    assert whole.arcs_m.tolist() == [14.0, 3.0, 10.0, 5.0]
    assert whole.lateral_m.tolist() == [0.2, 0.2, 0.3, 0.4]
    assert (whole.rollover.probability, whole.immobilised.probability, whole.fails.probability) == (0.25, 0.5, 0.75)


def ridge(height_m: float, low_end_m: float = 30.0) -> HeightField:
    """Level ground of 40 x 40 m with a ridge along x = 20 as far as a y, where it runs out."""
    x, y = np.meshgrid(np.arange(41.0), np.arange(41.0))
    fade = 1.0 / (1.0 + np.exp((y - low_end_m) / 1.5))
    return HeightField(height_m * np.exp(-0.5 * ((x - 20.0) / 4.0) ** 2) * fade, 1.0, (0.0, 0.0))


def model(limit: float | None = None, spread: SoilSpread | None = None) -> RiskModel:
    prior = replace(PRIOR, spread=spread) if spread is not None else PRIOR
    return RiskModel(MapError(0.03, 1.2, 0.01), prior, VEHICLE, MARS, (7,), limit, 60)


def begun(ground: HeightField, limit: float | None = None, costs: SlopeCosts = COSTS) -> Following:
    cut = LegModel(length_m=(8.0, 20.0))
    return begin(ElevationMap.of(ground, 0.02), costs, START, GOAL, 1.0, leg_model=cut, risk_model=model(limit))


def test_each_leg_and_the_whole_have_a_forecast_that_is_the_same_again() -> None:
    first, again = (begun(ridge(1.6)).risk for _ in range(2))
    assert first is not None
    assert again is not None
    assert len(first.legs) == len(first.ways_w) == len(begun(ridge(1.6)).legs)
    each = [leg.fails.probability for leg in first.legs]
    assert max(each) <= first.whole.fails.probability <= sum(each)
    assert first.riskiest == int(np.argmax(each))
    np.testing.assert_array_equal(first.whole.arcs_m, again.whole.arcs_m)
    np.testing.assert_array_equal(first.ways_w[0][0], START)
    np.testing.assert_array_equal(first.ways_w[-1][1], GOAL)


def test_legs_share_the_soil_so_a_rollout_fails_on_all_of_equal_legs_or_none() -> None:
    axis = np.arange(0.0, 41.0)
    slope = HeightField(np.tile(np.tan(np.radians(14.5)) * axis, (41, 1)), 1.0, (0.0, 0.0))
    ways = [np.array([[5.0, y], [15.0, y]]) for y in (10.0, 30.0)]
    one, two = forecasts(ways, slope, MapError(0.0, 1.0), PRIOR, VEHICLE, MARS, np.random.default_rng(1), 80)
    assert 0.1 < one.fails.probability < 0.9
    assert float(np.mean(one.ends == two.ends)) > 0.9
    assert joined([one, two]).fails.probability < one.fails.probability + 0.1


def test_the_ground_beside_a_way_is_clipped_and_its_gaps_are_filled() -> None:
    heights = np.arange(200.0).reshape(10, 20)
    heights[4, 8] = np.nan
    part = clipped(HeightField(heights, 0.5, (-1.0, 2.0)), np.array([[2.0, 3.5], [3.0, 4.0]]), 0.5)
    assert part.origin_m == (1.5, 3.0)
    assert part.heights_m.shape == (4, 5)
    assert part.heights_m[0].tolist() == [45.0, 46.0, 47.0, 48.0, 49.0]
    assert part.heights_m[2, 3] in {87.0, 89.0, 68.0, 108.0}
    outside = clipped(HeightField(heights, 0.5, (-1.0, 2.0)), np.array([[50.0, 50.0], [60.0, 50.0]]), 0.5)
    assert outside.heights_m.shape == (2, 2)


def test_without_a_model_there_is_no_forecast() -> None:
    plain = begin(ElevationMap.of(ridge(1.0), 0.02), COSTS, START, GOAL, 1.0)
    assert plain.risk is None
    assert least_risky(plain) is None


def test_over_the_limit_the_ridge_is_gone_round() -> None:
    straight = begun(ridge(1.75))
    assert straight.risk is not None
    over = straight.risk.whole.fails.probability
    assert over > 0.2
    assert straight.route.way_w[:, 1].max() < 28.0
    limited = begun(ridge(1.75), limit=0.1)
    assert limited.route.refusal is None
    assert limited.risk is not None
    assert limited.risk.within(0.1)
    assert limited.route.way_w[:, 1].max() > 28.0
    assert limited.risks[0] is not None
    assert limited.risks[0].whole.fails.probability == over
    assert "risk.limit = 0.1" in limited.reasons[0]
    assert len(limited.routes) == len(limited.risks) == len(limited.reasons) <= MOST_REPLANS


def test_a_ridge_without_an_end_is_refused_with_its_probability() -> None:
    refused = begun(ridge(1.75, low_end_m=1e3), limit=0.1)
    assert refused.route.refusal is Refusal.TOO_RISKY
    assert refused.legs == ()
    least = least_risky(refused)
    assert least is not None
    share = f"{100 * least.whole.fails.probability:.0f} %"
    assert f"fails with a probability of {share}" in refused.route.reason
    assert "risk.limit = 0.1" in refused.route.reason


def test_a_leg_that_is_given_up_gets_another_forecast_and_none_over_the_limit() -> None:
    first = begun(ridge(1.75), limit=0.6)
    assert first.route.refusal is None
    other = blocked(first, START, "a wall of rocks")
    assert other.risk is not None
    assert other.risk is not first.risk
    assert other.risk.within(0.6)
    assert len(other.risk.legs) == len(other.legs)
    never = blocked(begun(ridge(1.75)), START, "a wall of rocks")
    assert never.risk is not None


def test_news_never_lead_to_a_route_over_the_limit() -> None:
    # Round the ridge, as the limit wants it; costs of before the limit would lead over it.
    limited = replace(begun(ridge(1.3), limit=0.02), costs=COSTS)
    plan = navigator.begin(GOAL, 1.0, FOOTPRINT, START)
    after = improved(limited, plan, START)
    assert after.route is limited.route
    assert improved(replace(limited, risk_model=None), plan, START).route is not limited.route


def test_steeper_slopes_are_likelier_too_much_and_the_price_shows_in_the_cost() -> None:
    hazard = slope_hazard(PRIOR, VEHICLE, MARS, np.random.default_rng(3))
    sure = hazard.along[0]
    assert np.all(np.diff(sure[BINS:]) >= 0.0)
    assert np.all(np.diff(sure[: BINS + 1]) <= 0.0)
    assert np.all(np.diff(hazard.across[0]) >= 0.0)
    level, steep = BINS, BINS + int(np.tan(np.radians(25.0)) / BIN)
    assert sure[level] == 0.0
    assert sure[steep] == pytest.approx(1.0)
    dear = priced(COSTS, hazard, 50.0)
    assert dear.along[0, level] == COSTS.along[0, level]
    assert dear.along[0, steep] == pytest.approx(COSTS.along[0, steep] + 50.0)
    assert dear.up_deg == COSTS.up_deg


def test_a_price_makes_ways_over_slopes_dearer_and_level_ones_not() -> None:
    levels = len(ERRORS)
    along = np.tile(np.where(np.arange(2 * BINS + 1) == BINS, 0.0, 0.5), (levels, 1))
    hazard = SlopeHazard(along, np.zeros((levels, BINS + 1)))
    ground = ridge(1.0)
    plain, dear = (
        driven_map(begin(ElevationMap.of(ground, 0.0), costs, START, GOAL, 1.0))
        for costs in (COSTS, priced(COSTS, hazard, 20.0))
    )
    over, beside = np.array([START, GOAL]), np.array([[2.0, 2.0], [2.0, 38.0]])
    assert way_cost(dear, over) > way_cost(plain, over) + 20.0
    assert way_cost(dear, beside) == pytest.approx(way_cost(plain, beside), rel=0.05)


@pytest.mark.parametrize(
    ("soils", "weights", "says"),
    [(1, (1.0, 1.0), "1 soils and 2 weights"), (1, (0.0,), "sum of the weights"), (1, (-1.0,), "weight = -1")],
)
def test_contradictory_priors_are_named(soils: int, weights: tuple[float, ...], says: str) -> None:
    prior = SoilPrior((soil_preset("firm"),) * soils, weights)
    way: FloatArray = np.array([[4.0, 4.0], [9.0, 4.0]])
    with pytest.raises(InputError, match=says):
        forecasts([way], ridge(0.0), MapError(0.0, 1.0), prior, VEHICLE, MARS, np.random.default_rng(0), 2)
