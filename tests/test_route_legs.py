from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import ndimage

from planner import navigator, route_following
from planner.navigator_state import Decision, NavigatorState
from planner.route import CostMap, Place, cost_map, plan_route, way_cost
from planner.route_cost import slope_costs
from planner.route_following import CLEAR_M, Following
from planner.route_ground import ElevationMap
from planner.route_marks import LegModel, landmarks, legs
from tests.planner_factory import FOOTPRINT, pose_at
from worlds.types import FloatArray, HeightField

COSTS = slope_costs("mars_sand", FOOTPRINT, "husky")
START, GOAL = (5.0, 30.0), (75.0, 30.0)


def bumps(*tops: tuple[float, float, float]) -> HeightField:
    """Level ground of 80 x 60 m with bumps of 1.5 m about (x, y) of some heights."""
    x, y = np.meshgrid(np.arange(81.0), np.arange(61.0))
    heights = np.zeros(x.shape)
    for east, north, height in tops:
        heights += height * np.exp(-0.5 * ((x - east) ** 2 + (y - north) ** 2) / 1.5**2)
    return HeightField(heights, 1.0, (0.0, 0.0))


def mapped(field: HeightField) -> CostMap:
    return cost_map(ElevationMap.of(field, 0.02), COSTS)


def test_distinct_places_are_the_tops_of_bumps_and_the_highest_comes_first() -> None:
    found = landmarks(ElevationMap.of(bumps((20.0, 40.0, 0.6), (50.0, 20.0, 1.2)), 0.02))
    assert [mark.position_w[:2] for mark in found] == [(50.0, 20.0), (20.0, 40.0)]
    assert 0.5 < found[0].height_m < 1.2  # the mean of the surroundings has some of the bump in it
    assert landmarks(ElevationMap.of(bumps(), 0.02)) == ()


def test_legs_make_up_the_route_and_are_as_long_as_asked() -> None:
    map_ = mapped(bumps((40.0, 30.0, 3.0), (20.0, 40.0, 0.6)))
    route, model = plan_route(map_, START, GOAL), LegModel(length_m=(8.0, 20.0))
    cut = legs(map_, route, landmarks(map_.ground), model)
    assert sum(leg.length_m for leg in cut) == pytest.approx(route.length_m)
    assert sum(leg.cost for leg in cut) == pytest.approx(route.cost, rel=0.02)
    assert cut[-1].end_w == GOAL
    assert all(leg.length_m <= 21.0 for leg in cut)
    assert all(leg.length_m >= 7.0 for leg in cut[:-1])


def test_a_leg_can_be_driven_straight_at_about_its_cost() -> None:
    map_ = mapped(bumps((40.0, 30.0, 4.0)))
    cut = legs(map_, plan_route(map_, START, GOAL), ())
    ends = [START, *(leg.end_w for leg in cut)]
    for start, leg in zip(ends, cut, strict=False):
        assert way_cost(map_, np.array([start, leg.end_w])) <= LegModel().straight * leg.cost * (1 + 1e-9)


def test_a_leg_ends_where_a_landmark_is_seen_best() -> None:
    field = bumps((22.0, 40.0, 1.0))
    map_ = mapped(field)
    first = legs(map_, plan_route(map_, START, GOAL), landmarks(map_.ground))[0]
    assert first.landmark is not None
    assert first.landmark.position_w[:2] == (22.0, 40.0)
    assert first.end_w[0] == pytest.approx(22.0, abs=1.0)


def test_a_landmark_behind_a_wall_is_none() -> None:
    field = bumps((22.0, 44.0, 1.0))
    field.heights_m[37:39, :45] += 3.0
    map_ = mapped(field)
    marks = tuple(mark for mark in landmarks(map_.ground) if mark.position_w[:2] == (22.0, 44.0))
    assert marks
    assert all(leg.landmark is None for leg in legs(map_, plan_route(map_, START, GOAL), marks))


def started(field: HeightField, goal: Place = GOAL, error_m: float = 0.02) -> tuple[Following, NavigatorState]:
    following = route_following.begin(ElevationMap.of(field, error_m), COSTS, START, goal, 1.0)
    return following, route_following.aimed(navigator.begin(goal, 1.0, FOOTPRINT, START), following, START)


def test_navigation_is_sent_from_leg_to_leg_and_in_the_end_to_the_goal() -> None:
    following, plan = started(bumps((22.0, 40.0, 1.0)))
    assert plan.goal_w == following.legs[0].end_w
    for number, leg in enumerate(following.legs[:-1]):
        following, plan, decision = route_following.step(following, plan, None, pose_at(*leg.end_w, 0.0, 1.0), number)
        assert following.at == number + 1
        assert plan.goal_w == (following.legs[number + 1].end_w if number + 2 < len(following.legs) else GOAL)
        assert decision.kind == "drive"
    assert plan.goal_radius_m == 1.0
    _, _, decision = route_following.step(following, plan, None, pose_at(*GOAL, 0.0, 1.0), 100.0)
    assert decision.kind == "arrived"


def test_a_leg_that_was_passed_aside_is_over() -> None:
    following, plan = started(bumps())
    beyond = 0.5 * (following.legs[0].end_w[0] + following.legs[1].end_w[0])
    following, _, _ = route_following.step(following, plan, None, pose_at(beyond, 34.0, 0.0, 1.0), 1.0)
    assert following.at == 1


def refused(following: Following, plan: NavigatorState, place: Place) -> tuple[Following, NavigatorState, Decision]:
    ended = replace(plan, end=Decision("no_path", "rocks all over"))
    return route_following.step(following, ended, None, pose_at(*place, 0.0, 1.0), 1.0)


def near(way: FloatArray, discs: FloatArray) -> float:
    dense = np.concatenate([np.linspace(a, b, 40) for a, b in pairwise(way)])
    apart = np.linalg.norm(dense[:, None] - discs[None, :, :2], axis=2)
    return float(apart.min())


def test_a_refused_leg_is_gone_round_and_no_other_route_is_cheaper_for_it() -> None:
    following, plan = started(bumps())
    other, plan, decision = refused(following, plan, START)
    assert decision.kind == "drive"
    assert plan.end is None
    assert other.reasons == ("rocks all over",)
    assert other.routes == (following.route,)
    assert other.route.cost > following.route.cost
    assert near(other.route.way_w, other.blocked_w) > 0.9
    assert np.linalg.norm(other.blocked_w[:, :2] - START, axis=1).min() > CLEAR_M


def test_where_no_other_way_is_left_both_reasons_are_told() -> None:
    x = np.arange(81.0)
    walls = HeightField(np.zeros((61, 81)), 1.0, (0.0, 0.0))
    walls.heights_m[:28, (x > 10) & (x < 70)] = 8.0
    walls.heights_m[33:, (x > 10) & (x < 70)] = 8.0
    following, plan = started(walls)
    _, plan, decision = refused(following, plan, (14.0, 30.0))
    assert decision.kind == "no_path"
    assert decision.reason.startswith("rocks all over; and over the map: no way keeps to 15 deg up")
    assert plan.end is decision


def test_after_eight_other_routes_the_rover_gives_up() -> None:
    following, plan = started(bumps())
    _, plan = route_following.given_up(replace(following, refusals=8), plan, START, "stuck")
    assert plan.end is not None
    assert plan.end.reason == "stuck, after 8 other routes"


def test_a_refused_route_ends_the_plan_before_it_begins() -> None:
    _, plan = started(bumps(), goal=(200.0, 30.0))
    assert plan.end is not None
    assert plan.end.kind == "no_path"
    assert "the goal (200.0, 30.0) m is not on the map" in plan.end.reason


def seen(plan: NavigatorState, heights_m: FloatArray, sd_m: float = 0.03) -> NavigatorState:
    """The plan of a rover that has seen all of its window; heights (CELLS, CELLS)."""
    cells = plan.memory.cells
    layer = np.full(cells.height_m.shape, sd_m**2, dtype=np.float32)
    told = replace(
        cells,
        height_m=heights_m.astype(np.float32),
        variance_m2=layer,
        source=np.ones(layer.shape, dtype=np.uint8),
    )
    return replace(plan, memory=replace(plan.memory, cells=told))


def test_a_ridge_that_the_map_did_not_have_is_gone_round_once_it_is_seen() -> None:
    following, plan = started(bumps(), error_m=0.3)
    cells = plan.memory.cells
    x = cells.origin_w[0] + 0.05 * (np.arange(448) + 0.5)
    y = cells.origin_w[1] + 0.05 * (np.arange(448) + 0.5)
    ridge = 3.0 * np.exp(-0.5 * ((x[None, :] - 12.0) / 1.2) ** 2) * (np.abs(y[:, None] - 30.0) < 6.0)
    after = route_following.improved(following, seen(plan, ridge), START)
    map_ = route_following.driven_map(after)
    assert len(after.routes) == 1
    assert "makes another way cheaper" in after.reasons[0]
    assert np.isinf(way_cost(map_, following.route.way_w))
    assert np.isfinite(way_cost(map_, after.route.way_w))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_seen_never_makes_the_way_that_is_left_dearer(seed: int) -> None:
    following, plan = started(bumps((40.0, 30.0, 3.0)))
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (448, 448))
    hills = 2.0 * ndimage.gaussian_filter(noise, 30) / ndimage.gaussian_filter(noise, 30).std()
    after = route_following.improved(following, seen(plan, hills), START)
    map_ = route_following.driven_map(after)
    old, new = (way_cost(map_, np.array([START, *(leg.end_w for leg in one.legs)])) for one in (following, after))
    assert new <= old * (1 + 1e-9)
