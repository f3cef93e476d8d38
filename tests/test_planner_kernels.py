"""Compiled loops of the planner beside what they stand for, by NumPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from planner.choice import dense
from planner.field_kernels import seed_costs, values_at, way_onward
from planner.map_kernels import at_places
from planner.obstacle_map import MAX_CLEARANCE_M, obstacle_grid
from planner.room import STEP_RAD, Turning
from worlds.types import FloatArray

ANGLES = np.arange(37.0) * STEP_RAD
SEED = st.integers(0, 2**32 - 1)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float64, (2, 37), elements=st.floats(0.0, 3.0)), arrays(np.float64, 20, elements=st.floats(-3.1, 3.1)))
def test_heights_met_lie_between_those_of_the_steps(met: FloatArray, turns: FloatArray) -> None:
    right, left = (np.interp(np.abs(turns), ANGLES, side) for side in met)
    np.testing.assert_allclose(Turning(met).heights(turns), np.where(turns < 0.0, right, left), atol=1e-12)
    np.testing.assert_array_equal(Turning(met).heights(ANGLES), met[1])  # at the steps themselves, both ends included
    np.testing.assert_array_equal(Turning(met).heights(-ANGLES[1:]), met[0, 1:])


@settings(max_examples=20, deadline=None)
@given(SEED)
def test_places_have_the_clearance_and_the_hill_of_the_cells_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 4.0, (30, 2))
    table = np.column_stack(
        [start, start + rng.normal(0.0, 0.2, (30, 2)), rng.uniform(-0.1, 0.4, 30), rng.uniform(0.1, 5.0, 30)]
    )
    table = np.column_stack([table, rng.random(30) < 0.5])
    grid = obstacle_grid(table, (0.0, 4.0), (0.0, 4.0), (41, 41))
    cells = rng.integers(0, 41, (60, 2))
    clearance, hill = at_places(table, (0.1 * cells).astype(np.float64), MAX_CLEARANCE_M)
    np.testing.assert_allclose(clearance, grid.clearance_m[cells[:, 0], cells[:, 1]], atol=1e-6)
    np.testing.assert_allclose(hill, grid.hill[cells[:, 0], cells[:, 1]], rtol=1e-5, atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(arrays(np.float64, (4, 2), elements=st.floats(-5.0, 5.0)), st.floats(0.1, 1.0))
def test_dense_ways_keep_their_corners_and_leave_no_gap(way: FloatArray, spacing_m: float) -> None:
    points = dense(way, spacing_m)
    assert np.hypot(*np.diff(points, axis=0).T).max() <= spacing_m + 1e-9
    assert all((np.abs(points - corner).max(axis=1) < 1e-12).any() for corner in way)


def test_the_search_starts_about_a_goal_inside_and_from_the_border_for_one_beyond() -> None:
    cost, low = np.ones((9, 7)), np.zeros(2)
    cost[4, 3] = np.inf
    seeds = seed_costs(cost, low, 0.5, np.array([2.0, 1.5]), 0.5, 0.0)
    assert sorted(map(tuple, np.argwhere(np.isfinite(seeds)).tolist())) == [(3, 3), (4, 2), (4, 4), (5, 3)]
    np.testing.assert_array_equal(seeds[np.isfinite(seeds)], 0.5)
    border = seed_costs(cost, low, 0.5, np.array([10.0, 1.0]), 0.5, 2.0)
    assert np.isfinite(border).sum() == 2 * 9 + 2 * 7 - 4
    assert border[8, 2] == 2.0 * 6.0


def test_a_field_is_read_at_the_nearest_cell_and_nowhere_outside() -> None:
    field = np.arange(12.0).reshape(4, 3)
    places = np.array([[1.0, 1.0], [1.24, 0.76], [2.49, 1.99], [2.51, 1.0], [0.74, 1.0], [1.0, 2.3]])
    np.testing.assert_array_equal(
        values_at(field, np.array([1.0, 1.0]), 0.5, places), [0.0, 0.0, 11.0, 9.0, np.inf, np.inf]
    )


def test_a_way_goes_on_from_cell_to_cell_as_far_as_asked() -> None:
    onward = np.array([[1, 4, -1], [-1, 8, -1], [-1, -1, -1]], dtype=np.int32)  # (0, 0), (0, 1), (1, 1), (2, 2)
    assert way_onward(onward, (0, 0), 0.5, 9.0).tolist() == [[0, 0], [0, 1], [1, 1], [2, 2]]
    assert way_onward(onward, (0, 0), 0.5, 0.9).tolist() == [[0, 0], [0, 1], [1, 1]]
