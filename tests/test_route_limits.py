"""Slopes of the map as obstacles of navigation, and a rover that is let off a leg round a corner of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner import navigator, route_following
from planner import route_kernels as kernels
from planner.obstacle_map import segment_clearance
from planner.route import CostMap, cost_map, plan_route
from planner.route_cost import BIN, slope_costs
from planner.route_ground import ElevationMap
from planner.route_limits import distances, forbidden, too_steep
from tests.planner_factory import FOOTPRINT, pose_at
from worlds.types import HeightField

COSTS = slope_costs("mars_sand", FOOTPRINT, "husky")
START, GOAL = (10.0, 5.0), (10.0, 35.0)


def wall(west_m: float = 0.0, east_m: float = 20.0, height_m: float = 3.0) -> ElevationMap:
    """Level ground of 40 x 40 m with a steep ridge along y = 20 between two x."""
    x, y = np.meshgrid(np.arange(41.0), np.arange(41.0))
    ridge = height_m * np.exp(-0.5 * ((y - 20.0) / 1.5) ** 2) * ((x >= west_m) & (x <= east_m))
    return ElevationMap.of(HeightField(ridge, 1.0, (0.0, 0.0)), 0.02)


def mapped(ground: ElevationMap) -> CostMap:
    return cost_map(ground, COSTS)


def test_what_is_too_steep_is_what_the_search_does_not_drive() -> None:
    rng = np.random.default_rng(5)
    heights = np.cumsum(np.cumsum(rng.normal(0.0, 0.1, (30, 40)), axis=0), axis=1)
    map_, end = mapped(ElevationMap.of(HeightField(heights, 1.0, (-3.0, 2.0)), 0.03)), (11.3, 24.1)
    steep, part, costs = too_steep(map_, end), map_.layers, map_.costs
    assert 0.1 < steep.mean() < 0.9
    for row, column in np.ndindex(*steep.shape):
        way = np.subtract(end, map_.place((row, column)))
        way = way / np.linalg.norm(way)
        rise_x, rise_y = float(part.rise_x[row, column]), float(part.rise_y[row, column])
        level = int(part.level[row, column])
        price = kernels.metre_cost(
            rise_x,
            rise_y,
            level,
            way[0],
            way[1],
            costs.along,
            costs.across,
            costs.risk,
            costs.limits,
            costs.holds_up,
            BIN,
        )
        assert steep[row, column] == np.isinf(price * map_.care[row, column])


def test_slopes_beside_the_planned_way_are_hard_and_those_at_it_only_cost() -> None:
    map_ = mapped(wall())
    way = plan_route(map_, START, GOAL).way_w
    assert way[:, 0].max() > 20.0  # round the end of the ridge
    table = forbidden(map_, START, way, GOAL, FOOTPRINT)
    hard, apart = table[:, 6] > 0.5, distances(table[:, :2], way)
    half = 0.5 * np.hypot(FOOTPRINT.length_m, FOOTPRINT.width_m)
    assert hard.any()
    assert apart[hard].min() > half + 0.25  # room to drive the way and to turn on it
    assert np.linalg.norm(table[:, :2] - GOAL, axis=1)[hard].min() > 10.0
    assert np.abs(table[hard, 1] - 20.0).max() < 4.0
    assert forbidden(mapped(wall(height_m=0.2)), START, way, GOAL, FOOTPRINT).shape == (0, 7)


def test_navigation_goes_round_a_slope_that_it_cannot_see() -> None:
    map_ = mapped(wall(west_m=8.0, east_m=12.0))
    goal, start = (10.0, 24.0), (10.5, 16.0)
    state = navigator.begin(goal, 1.0, FOOTPRINT, start)
    way = np.array([start, (3.0, 20.0), goal])  # as a route may have it
    steep = forbidden(map_, start, way, goal, FOOTPRINT)
    for table, kept in ((steep, True), (steep[:0], False)):
        state = navigator.retarget(state, goal, 1.0, table)
        state, decision = navigator.step(state, None, pose_at(*start, 0.5 * np.pi, 1.0), 1.0)
        assert decision.kind == "drive"
        away = segment_clearance(steep, decision.waypoints_w).min()
        assert (away >= 0.5 * FOOTPRINT.width_m) == kept


@pytest.mark.parametrize("step_m", [1.0, 2.4])
def test_a_rover_that_was_let_off_a_leg_before_a_corner_keeps_its_route(step_m: float) -> None:
    following = route_following.begin(wall(), COSTS, START, GOAL, 1.0)
    corner = next(number for number, leg in enumerate(following.legs) if leg.end_w[0] > 20.0)
    x, y = following.legs[corner].end_w
    following = replace(following, at=corner + 1)
    place = (x - step_m, min(y, 18.0) - 0.5)  # from there the ridge is in the straight way to the next leg's end
    plan = route_following.aimed(navigator.begin(GOAL, 1.0, FOOTPRINT, START), following, place)
    assert route_following.improved(following, plan, place).routes == ()
