"""A way that begins with a bend instead of a turn on the spot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from planner import navigator
from planner.choice import Place
from planner.first_bend import MOST_BEND_RAD, RADIUS_M, SPACING_M, begin_with_bend, bends_onto
from planner.ground_cells import driven_view
from planner.terrain_map import remember
from tests.planner_factory import FOOTPRINT, DiscWorld, look, pose_at
from worlds.geometry import wrap_angle
from worlds.types import FloatArray


def standing(heading_rad: float = 0.0) -> Place:
    return Place((0.0, 0.0), heading_rad, (9.0, 0.0), 0.5)


def length(way_w: FloatArray) -> float:
    return float(np.hypot(*np.diff(way_w, axis=0).T).sum())


def test_a_bend_to_the_left_worked_by_hand() -> None:
    # The circle's middle is (0, R). Seen from it the target lies at (R, 2 m), so a quarter of it leads straight there.
    target = np.array([RADIUS_M, RADIUS_M + 2.0])
    (bent,) = bends_onto(np.array([[0.0, 0.0], target]), standing())
    np.testing.assert_allclose(bent[-2], [RADIUS_M, RADIUS_M], atol=1e-9)
    np.testing.assert_allclose(bent[-1], target)
    np.testing.assert_allclose(np.hypot(bent[:-1, 0], bent[:-1, 1] - RADIUS_M), RADIUS_M)


@given(st.floats(-3.1, 3.1), st.floats(2.8, 6.0), st.floats(-3.1, 3.1))
def test_a_bend_begins_along_the_heading_and_leaves_along_its_tangent(
    bearing: float, far_m: float, heading: float
) -> None:
    assume(abs(wrap_angle(bearing - heading)) > 0.6)  # else nothing is gained by a bend
    way = np.array([[0.0, 0.0], [far_m * np.cos(bearing), far_m * np.sin(bearing)]])
    for bent in bends_onto(way, standing(heading)):
        steps = np.diff(bent, axis=0)
        turns = np.diff(np.unwrap(np.concatenate([[heading], np.arctan2(steps[:, 1], steps[:, 0])])))
        assert np.abs(turns).max() <= SPACING_M / RADIUS_M + 1e-9  # no turn on the spot anywhere
        assert np.abs(turns[np.abs(turns) > 1e-9]).sum() <= MOST_BEND_RAD + 1e-6
        assert (turns > -1e-9).all() or (turns < 1e-9).all()
        np.testing.assert_array_equal(bent[-1], way[-1])


def test_the_cheapest_free_bend_is_taken_if_it_is_cheaper() -> None:
    way = np.array([[0.0, 0.0], [2.0, 4.0]])
    bent = begin_with_bend(way, standing(), lambda _: True, lambda each: 0.0 if len(each) > 2 else 1.0)
    assert len(bent) > 2
    assert bent[:, 0].max() > 1.0, "it bends ahead of the rover"
    assert begin_with_bend(way, standing(), lambda _: False, length) is way
    assert begin_with_bend(way, standing(), lambda _: True, length) is way, "the straight way is the shortest"


@pytest.mark.parametrize(("rocks", "bends"), [([], True), ([(1.1, 0.2, 0.2)], False)])
def test_the_rover_bends_where_there_is_room_and_turns_where_there_is_none(
    rocks: list[tuple[float, float, float]], *, bends: bool
) -> None:
    world = DiscWorld.of(rocks)
    state = replace(navigator.begin((0.0, 8.0), 0.5, FOOTPRINT, (0.0, 0.0)), slope_rad=0.17)  # turns are dear there
    known = remember(state.memory, None, np.zeros(2), standing=driven_view(np.zeros(3), 4.0, 0.0))
    state = replace(state, memory=known)
    _, decision = navigator.step(state, look(world, np.zeros(3), 0.0, None), pose_at(0.0, 0.0, 0.0), 0.0)
    assert decision.kind == "drive"
    begin = decision.waypoints_w[1] - decision.waypoints_w[0]
    assert (abs(np.arctan2(begin[1], begin[0])) < 0.3) == bends
