from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import obstacle_map as om
from planner import row_kernels as kernels
from planner.choice import Models, Place, choose
from planner.field_kernels import cost_to_go, metre_costs
from planner.goal_field import STEP_M, GoalField, field_ground, goal_field
from planner.ground_cells import (
    VIEW_ERROR,
    GroundCells,
    Source,
    View,
    driven_view,
    empty_cells,
    nearest_views,
    take_in,
)
from planner.map_kernels import Layer
from planner.room import FREE, STEP_RAD, turn_range, turning
from planner.row_search import RowSearch, Task, search
from planner.terrain_map import RockMemory, empty_memory, remember, rock_at
from tests.planner_factory import FOOTPRINT
from worlds.types import FloatArray, GroundPlane, Observation, PerceivedRock

DRIVE = om.DriveModel()
NEED = DRIVE.need_m(FOOTPRINT)
CELLS = empty_cells(np.zeros(2))
SEEN = take_in(CELLS, driven_view(np.zeros(3), 3.0, 0.0))


def table(*discs: tuple[float, float, float]) -> FloatArray:
    rows = [[x, y, x, y, radius, 1.0, 1.0] for x, y, radius in discs]
    return np.array(rows).reshape(-1, 7)


def find(discs: FloatArray, goal: tuple[float, float] = (20.0, 0.0), heading: float = 0.0) -> RowSearch:
    frame = om.Frame2((0.0, 0.0), float(np.arctan2(goal[1], goal[0])))

    def end_cost(points: FloatArray) -> FloatArray:
        distance: FloatArray = np.linalg.norm(points - goal, axis=1)
        return 3.0 * distance  # the end counts most

    return search(discs, CELLS, Task(frame, float(np.hypot(*goal)), heading, NEED, end_cost), DRIVE)


@given(st.lists(st.booleans(), min_size=1, max_size=120), st.data())
@settings(deadline=None)
def test_divide_and_conquer_finds_each_maximal_free_space(free: list[bool], data: st.DataObject) -> None:
    column = data.draw(st.integers(0, len(free) - 1))
    spaces = kernels.free_spaces(np.array(free, dtype=np.float64), column)
    padded = np.array([False, *free, False])
    starts = np.flatnonzero(~padded[:-1] & padded[1:])
    ends = np.flatnonzero(padded[:-1] & ~padded[1:]) - 1
    np.testing.assert_array_equal(spaces, np.stack([starts, ends], axis=1).reshape(-1, 2))


def test_open_ground_is_crossed_straight() -> None:
    found = find(table())
    best = found.candidates[0]
    assert found.blocked_row is None
    np.testing.assert_allclose(best.waypoints_w[:, 1], 0.0, atol=1e-9)
    assert best.waypoints_w[-1, 0] == pytest.approx(7.2)
    assert np.linalg.norm(np.diff(best.waypoints_w, axis=0), axis=1).max() <= 1.5 + 1e-9


def test_a_rock_ahead_gives_a_way_on_either_side() -> None:
    found = find(table((4.0, 0.05, 0.3)))
    sides = {float(np.sign(c.waypoints_w[np.argmin(abs(c.waypoints_w[:, 0] - 4.0)), 1])) for c in found.candidates}
    assert sides == {-1.0, 1.0}
    assert found.candidates[0].cost <= found.candidates[1].cost


def test_a_wall_is_told_by_its_row_and_a_gap_is_found() -> None:
    wall = [(4.0, y, 0.25) for y in np.arange(-6.0, 6.1, 0.4)]
    blocked = find(table(*wall))
    assert blocked.blocked_row is not None
    assert blocked.rows_m[blocked.blocked_row] == pytest.approx(4.0 - 0.25 - NEED, abs=0.45)
    assert not blocked.candidates[0].complete
    gap = find(table(*(disc for disc in wall if abs(disc[1] - 1.6) > 0.75)))
    assert gap.blocked_row is None
    way = gap.candidates[0].waypoints_w
    assert np.interp(4.0, way[:, 0], way[:, 1]) == pytest.approx(1.6, abs=0.25)


def test_a_near_goal_is_the_end_of_the_way() -> None:
    best = find(table((1.5, 0.0, 0.2)), goal=(3.0, 0.0)).candidates[0]
    np.testing.assert_allclose(best.waypoints_w[-1], [3.0, 0.0], atol=1e-9)


def test_a_goal_inside_a_rock_is_approached_as_far_as_it_goes() -> None:
    best = find(table((3.0, 0.0, 0.5)), goal=(3.0, 0.0)).candidates[0]
    assert best.clearance_m >= NEED - 0.03
    assert np.hypot(*(best.waypoints_w[-1] - [3.0, 0.0])) < 0.5 + NEED + 0.5


def test_the_rover_may_leave_a_rock_that_it_stands_beside() -> None:
    found = find(table((0.1, 0.45, 0.1)))
    assert found.blocked_row is None
    assert (found.candidates[0].waypoints_w[:, 1] <= 0.05).all()


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(st.floats(0.9, 9), st.floats(-5, 5), st.floats(0.05, 0.5)), max_size=25),
    st.floats(-np.pi, np.pi),
)
def test_every_way_keeps_its_distance(discs: list[tuple[float, float, float]], direction: float) -> None:
    obstacles = table(*discs)
    turned = om.in_frame(obstacles, om.Frame2((0.0, 0.0), -direction))
    found = find(turned, goal=(20 * np.cos(direction), 20 * np.sin(direction)), heading=direction)
    leaving = om.let_leave(turned, np.zeros(2), NEED)
    for candidate in found.candidates:
        # Distances are checked at 0.1 m steps, so a corner of a rock may lie a little nearer between two.
        assert om.segment_clearance(leaving, candidate.waypoints_w).min() >= NEED - 0.04
        np.testing.assert_allclose(candidate.waypoints_w[0], 0.0, atol=1e-9)


def test_a_turn_without_room_is_not_begun() -> None:
    beside = table((0.42, 0.52, 0.1))
    right, left = turn_range(beside, SEEN, np.zeros(2), 0.0, FOOTPRINT)
    assert left < np.deg2rad(20)
    assert right < -np.deg2rad(60)
    assert turn_range(table(), SEEN, np.zeros(2), 0.0, FOOTPRINT) == (-np.pi, np.pi)


def test_a_turn_on_a_slope_needs_room_downhill() -> None:
    below = table((0.0, -0.9, 0.1))  # out of reach of a body that turns where it stands
    assert turn_range(below, SEEN, np.zeros(2), 0.0, FOOTPRINT) == (-np.pi, np.pi)
    right, left = turn_range(below, SEEN, np.zeros(2), 0.0, FOOTPRINT, (0.0, -0.18))  # 10 degrees
    assert -np.pi < right < -np.deg2rad(40)
    assert np.deg2rad(40) < left < np.pi
    assert turn_range(below, SEEN, np.zeros(2), 0.0, FOOTPRINT, (0.0, 0.18)) == (-np.pi, np.pi)


def test_distance_to_a_long_rock_is_to_its_axis_less_its_half_width() -> None:
    long = np.array([[1.0, -1.0, 1.0, 1.0, 0.2, 1.0, 1.0]])
    assert om.distance_to(long, np.zeros(2)) == pytest.approx([0.8])
    assert om.segment_clearance(long, np.array([[0.0, 0.0], [2.0, 0.0]])) == pytest.approx([-0.2])
    grid = om.obstacle_grid(long, (0.0, 0.5), (0.0, 0.5), (6, 6))
    assert grid.clearance_m[0, 0] == pytest.approx(0.8)
    assert grid.hill[5, 0] == pytest.approx((1 - 0.3) ** 2)


def field_of(obstacles: FloatArray, place: FloatArray, goal: FloatArray, cells: GroundCells) -> GoalField:
    return goal_field(obstacles, field_ground(cells, place), place, goal, 0.5, NEED, DRIVE)


def test_the_field_leads_out_of_a_u() -> None:
    u = [(3.0, y, 0.3) for y in np.arange(-2, 2.1, 0.5)]
    u += [(x, side, 0.3) for x in np.arange(0, 3.1, 0.5) for side in (-2.0, 2.0)]
    field = field_of(table(*u), np.array([1.5, 0.0]), np.array([8.0, 0.0]), CELLS)
    way = field.way(np.array([1.5, 0.0]), 20.0)
    assert way[:, 0].min() < -0.3
    assert np.linalg.norm(way[-1] - [8.0, 0.0]) < 0.5
    costs = field.at(way)
    assert (np.diff(costs) <= 1e-9).all()


def test_the_field_of_a_walled_goal_is_infinite() -> None:
    ring = [(6 + np.cos(a), np.sin(a), 0.3) for a in np.linspace(0, 2 * np.pi, 20)]
    field = field_of(table(*ring), np.zeros(2), np.array([6.0, 0.0]), CELLS)
    assert np.isinf(field.at(np.zeros((1, 2)))).all()
    assert len(field.way(np.zeros(2), 5.0)) == 0


@pytest.mark.parametrize("bearing_deg", range(0, 360, 30))
def test_a_rover_in_the_berth_of_a_rock_is_not_walled_in_by_the_cells(bearing_deg: float) -> None:
    place = np.array([0.07, 0.07])  # as far as can be from the middle of a cell
    away = NEED - 0.05 + 0.3
    rock = place + away * np.array([np.cos(np.deg2rad(bearing_deg)), np.sin(np.deg2rad(bearing_deg))])
    field = field_of(table((*rock, 0.3)), place, np.array([8.0, 0.0]), CELLS)
    assert field.at(place[None])[0] < 20.0
    assert len(field.way(place, 1.0)) > 1


def test_a_far_gap_that_seems_too_narrow_is_worth_a_look_and_a_near_one_is_not() -> None:
    # A wall with one gap, too narrow by 0.08 m on both sides, in 12 m of rocks: round it is far.
    side = NEED - 0.08 + 0.3
    wall = [(4.0, y, 0.3) for end in (-1.0, 1.0) for y in end * np.arange(side, 12.0, 0.5)]
    far, near = (field_of(table(*wall), np.array([x, 0.0]), np.array([8.0, 0.0]), CELLS) for x in (0.0, 3.0))
    assert np.abs(far.way(np.zeros(2), 20.0)[:, 1]).max() < 0.2
    # Unseen ground costs 1.5 a metre. Doubted by 0.08 of 0.12 m, 4 m away all of it, a metre of gap costs 6.7 more.
    assert 12.0 < far.at(np.zeros((1, 2)))[0] < 12.0 + 6.7
    assert near.at(np.array([[3.0, 0.0]]))[0] > 20.0
    closed = [*wall, (4.0, 0.0, 0.3)]
    shut = field_of(table(*closed), np.zeros(2), np.array([8.0, 0.0]), CELLS)
    assert shut.at(np.zeros((1, 2)))[0] > 20.0
    assert DRIVE.doubt_m(np.array([0.0, 1.5, 2.5, 9.0])) == pytest.approx([0.0, 0.0, 0.06, 0.12])


def test_a_gap_that_proved_too_narrow_from_near_stays_so_for_who_backs_out() -> None:
    side = NEED - 0.08 + 0.3
    wall = [(4.0, y, 0.3) for end in (-1.0, 1.0) for y in end * np.arange(side, 12.0, 0.5)]
    plane = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    square = np.array([[0.0, -3.0], [6.0, -3.0], [6.0, 3.0], [0.0, 3.0]])

    def seen_from(x_m: float) -> GroundCells:
        return take_in(CELLS, View(np.array([x_m, 0.0]), (square,), plane, VIEW_ERROR, 0.0, Source.CAMERA))

    def cost(cells: GroundCells) -> float:
        field = field_of(table(*wall), np.zeros(2), np.array([8.0, 0.0]), cells)
        return float(field.at(np.zeros((1, 2)))[0])

    assert cost(seen_from(0.5)) < 16.0
    assert cost(seen_from(3.2)) > 20.0


def test_places_never_seen_are_as_far_off_as_they_are_and_others_as_near_as_they_were_seen() -> None:
    plane = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    square = np.array([[1.0, -0.5], [2.0, -0.5], [2.0, 0.5], [1.0, 0.5]])
    cells = take_in(CELLS, View(np.array([1.5, 0.0]), (square,), plane, VIEW_ERROR, 0.0, Source.CAMERA))
    away = nearest_views(cells, np.array([-2.0, 0.0]), np.array([0.0, 0.0]), 0.75, (3, 1))
    assert away[:, 0] == pytest.approx([2.0, 2.75, 0.0], abs=0.05)  # the second is 0.25 m beside the square


def test_ground_unseen_costs_as_much_as_what_was_seen() -> None:
    shape = (1, 4)
    unseen = np.array([[0.0, 0.0, 0.0, 1.0]], dtype=np.float32)
    clear = np.array([[5.0, 5.0, 0.0, 5.0]], dtype=np.float32)
    hill, flat = np.array([[0.0, 2.0, 0.0, 0.0]], dtype=np.float32), np.zeros(shape, dtype=np.float32)
    prices = (1.0, 1.0, (0.5, 2.0), 1.0, 10.0)

    def costs(hill: Layer) -> tuple[FloatArray, float]:
        return metre_costs(clear, hill, unseen, flat, flat, 0.4, 0.3, (1.5, 3.5, 0.12), prices)

    cost, fresh = costs(hill)
    # A metre of what was seen costs 1 and 3, and one cell is blocked: 3 / (1 + 1/3 + 0).
    assert cost[0] == pytest.approx([1.0, 3.0, np.inf, 2.25])
    assert fresh == pytest.approx(2.25)
    assert costs(flat)[1] == pytest.approx(1.5)  # never less than the price of not knowing
    assert costs(np.full(shape, 99.0, dtype=np.float32))[1] == pytest.approx(
        3.0
    )  # nor so much that nothing is looked at


def test_cells_of_the_field_stay_where_they_are_while_the_rover_moves() -> None:
    goal = np.array([8.0, 0.0])
    here, there = (
        field_of(table((4.0, 0.0, 0.3)), np.array(place), goal, CELLS) for place in ((0.0, 0.0), (0.31, -0.17))
    )
    shift = (there.origin_w - here.origin_w) / STEP_M
    assert shift == pytest.approx(np.round(shift), abs=1e-6)


def test_rocks_hold_the_wheels_of_a_turn_by_their_heights_once_these_get_there() -> None:
    body = replace(FOOTPRINT, climb_height_m=0.1)
    # Wheels at (+-0.26, +-0.29) m, 0.11 m wide. A rock between the front wheels, 0.38 m ahead, is met by the right one
    # in a turn to the left, after some 20 degrees, and by the left one in a turn to the right.
    ahead, under_the_belly, far = (rock_at((x, 0.0, 0.0), 0.06, 0.06) for x in (0.42, 0.05, 0.9))
    flat, beside = rock_at((0.0, 0.4, 0.0), 0.1, 0.025), rock_at((0.26, 0.40, 0.0), 0.1, 0.04)
    turns = np.deg2rad([0.0, 10.0, 90.0, -90.0])

    def heights(*rocks: PerceivedRock) -> FloatArray:
        return turning(remembered(*rocks), np.zeros(2), 0.0, body).heights(turns)

    assert heights() == pytest.approx([0.0, 0.0, 0.0, 0.0])
    assert heights(ahead, under_the_belly, far, flat) == pytest.approx([0.0, 0.0, 0.6, 0.6])
    at_once = heights(beside)  # it leans against the left front wheel
    assert at_once[[0, 2, 3]] == pytest.approx([0.0, 0.4, 0.4])
    assert 0.1 < at_once[1] < 0.4


def test_a_turn_reaches_as_far_as_rocks_hardly_hold_it() -> None:
    body = replace(FOOTPRINT, climb_height_m=0.1)
    held = turning(remembered(rock_at((0.26, 0.40, 0.0), 0.1, 0.08)), np.zeros(2), 0.0, body)
    right, left = held.reach(0.4)
    assert (held.heights(np.array([right, left])) <= 0.4).all()
    assert (held.heights(np.array([right - STEP_RAD, left + STEP_RAD])) > 0.4).all()
    assert FREE.reach(0.4)[1] == pytest.approx(np.pi)


def remembered(*rocks: PerceivedRock) -> RockMemory:
    """Rocks seen once."""
    seen = Observation(0.0, rocks, np.empty((0, 0), dtype=np.str_), np.zeros((0, 0, 2)), np.zeros((0, 2)))
    return remember(empty_memory(np.zeros(2)), seen, np.array([-2.0, 0.0])).rocks


@pytest.mark.parametrize(("heading_deg", "side"), [(60.0, 1.0), (-60.0, -1.0)])
def test_a_way_round_sets_out_to_the_side_that_the_rover_looks_to(heading_deg: float, side: float) -> None:
    # A wall across the way is as long to both sides, but for a hair.
    wall = table(*((2.5, y - 0.02 * side, 0.3) for y in np.arange(-2.0, 2.1, 0.4)))
    place = Place((0.0, 0.0), float(np.deg2rad(heading_deg)), (6.0, 0.0), 0.5)
    memory = replace(empty_memory(np.zeros(2)), cells=SEEN)
    found = choose(memory, wall, place, Models(FOOTPRINT), detour=False)
    assert found.way is not None
    way = found.way.waypoints_w
    assert side * way[np.abs(way[:, 1]).argmax(), 1] > 0.5


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.5))
def test_the_field_is_that_of_dijkstra(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    cost = np.where(rng.random((12, 9)) < share, np.inf, rng.uniform(1.0, 4.0, (12, 9)))
    seeds = np.full(cost.shape, np.inf)
    seeds[6, 4], cost[6, 4] = 0.0, 1.0
    found, onward = cost_to_go(cost, seeds, 0.5)
    np.testing.assert_allclose(found, relaxed(cost, seeds, 0.5))
    assert (onward.ravel()[np.isfinite(found).ravel() & (found.ravel() > 0)] >= 0).all()


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.4), st.floats(0.0, 3.0), st.floats(0.0, 0.5))
def test_a_search_for_one_place_is_right_as_far_as_it_was_asked_for(
    seed: int, blocked: float, slack: float, share: float
) -> None:
    rng = np.random.default_rng(seed)
    cost = np.where(rng.random((20, 25)) < blocked, np.inf, rng.uniform(1.0, 4.0, (20, 25)))
    seeds = np.full(cost.shape, np.inf)
    seeds[:, 24] = rng.uniform(0.0, 3.0, 20)
    place, step = (9, 3), 0.5
    cost[place] = 1.0
    whole, _ = cost_to_go(cost, seeds, step)
    found, onward = cost_to_go(cost, seeds, step, place, (slack, share, np.inf))
    away = np.abs(np.indices(cost.shape) - np.array(place)[:, None, None])
    least = whole + step * (away.max(axis=0) + (np.sqrt(2.0) - 1.0) * away.min(axis=0))
    asked = least <= whole[place] * (1.0 + share) + slack
    np.testing.assert_allclose(found[asked], whole[asked])
    assert (found >= whole - 1e-9).all()
    assert (onward[np.isfinite(found) & ~np.isfinite(seeds)] >= 0).all()
    # A most that is less than the place's cost ends the search before it gets there.
    if np.isfinite(whole[place]) and whole[place] > least[np.isfinite(least)].min() + 0.5:
        early, _ = cost_to_go(cost, seeds, step, place, (slack, share, float(least[np.isfinite(least)].min())))
        assert np.isfinite(early).sum() < np.isfinite(whole).sum()


def relaxed(cost: FloatArray, seeds: FloatArray, step: float) -> FloatArray:
    """The same by lowering all cells until nothing changes."""
    best = np.pad(seeds, 1, constant_values=np.inf)
    price = np.pad(cost, 1, constant_values=np.inf)
    shifts = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    for _ in range(cost.size):
        before = best.copy()
        for i, j in shifts:
            there, beyond = np.roll(before, (i, j), (0, 1)), np.roll(price, (i, j), (0, 1))
            open_ = np.isfinite(np.roll(price, i, 0)) & np.isfinite(np.roll(price, j, 1)) & np.isfinite(price)
            total = there + 0.5 * step * np.hypot(i, j) * (price + beyond)
            best = np.where(open_, np.minimum(best, total), best)
        if np.array_equal(best, before):
            break
    return best[1:-1, 1:-1]


def test_a_goal_far_away_costs_the_field_no_more_work() -> None:
    rng = np.random.default_rng(0)
    rocks = rng.uniform(-13.0, 13.0, (120, 2))
    rocks = rocks[np.hypot(*rocks.T) > 1.2]
    obstacles = table(*((x, y, 0.25) for x, y in rocks))
    fields = [
        field_of(obstacles, np.zeros(2), np.array([away, 0.0]), CELLS)
        for away in (60.0, 400.0)  # beyond 80 m the search once did not end within minutes
    ]
    near, far = (float(field.at(np.zeros((1, 2)))[0]) for field in fields)
    # All that is beyond the square is charged as unseen ground, half as much again as its length.
    assert far - near == pytest.approx(1.5 * 340.0, rel=2e-3)


def test_a_narrow_gap_is_preferred_only_if_it_is_worth_the_turn_towards_it() -> None:
    # A corridor that is open ahead and has a gap for squeezing at its rear end, where the goal lies.
    half_gap = DRIVE.need_m(FOOTPRINT, squeeze=True) + 0.03 + 0.3
    sides = [(x, y, 0.3) for x in np.arange(-2.5, 2.1, 0.3) for y in (-1.8, 1.8)]
    end = [(-2.5, sign * y, 0.3) for sign in (-1.0, 1.0) for y in np.arange(half_gap, 1.9, 0.3)]
    memory = replace(empty_memory(np.zeros(2)), cells=SEEN)

    def first(slope_deg: float) -> float:
        place = Place((0.0, 0.0), 0.0, (-6.0, 0.0), 0.5, slope_deg=slope_deg)
        found = choose(memory, table(*sides, *end), place, Models(FOOTPRINT), detour=True)
        assert found.way is not None
        return float(found.way.waypoints_w[1, 0])

    assert first(0.0) < 0.0
    assert first(25.0) > 0.0  # turns are dear on slopes
