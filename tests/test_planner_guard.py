"""The guard that keeps the belly off rocks straight ahead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner import navigator
from planner.choice import Place
from planner.guard import free_turn, runs_onto
from planner.recovery import Manoeuvre, _first_tight, _over_rock
from tests.planner_factory import FOOTPRINT, DiscWorld, look, pose_at
from worlds.types import FloatArray

BODY = replace(FOOTPRINT, length_m=1.0, width_m=0.8)  # 0.9 of half the width: what is 0.36 m to a side is met
HERE = np.zeros(2)
ALL_ROUND = (-np.pi, np.pi)


def rock(x_m: float, y_m: float, radius_m: float = 0.1) -> FloatArray:
    return np.array([[x_m, y_m, x_m, y_m, radius_m, 1.0, 1.0]])


@pytest.mark.parametrize(
    ("x_m", "y_m", "met"),
    [
        (0.94, 0.0, True),  # its near side is 0.34 m before the body, 0.35 are watched
        (0.96, 0.0, False),
        (0.8, 0.45, True),  # 0.09 m beside that
        (0.8, 0.47, False),
        (0.45, 0.0, False),  # under the body already
        (-0.8, 0.0, False),
    ],
)
def test_a_rock_is_met_where_the_belly_goes_as_worked_by_hand(x_m: float, y_m: float, *, met: bool) -> None:
    assert runs_onto(rock(x_m, y_m), HERE, 0.0, BODY) is met
    assert runs_onto(rock(-x_m, -y_m), HERE, np.pi, BODY) is met, "backing up is the same the other way round"


def test_a_long_rock_is_met_by_any_part_of_it() -> None:
    long = np.array([[0.8, 0.2, 0.8, 1.4, 0.05, 1.0, 1.0]])
    assert runs_onto(long, HERE, 0.0, BODY)
    long[:, [1, 3]] += 0.25
    assert not runs_onto(long, HERE, 0.0, BODY)


@given(x=st.floats(0.0, 1.5), y=st.floats(-0.8, 0.8), heading=st.floats(-3.0, 3.0))
def test_what_is_met_does_not_depend_on_side_or_direction(x: float, y: float, heading: float) -> None:
    cos, sin = np.cos(heading), np.sin(heading)
    turned = rock(x * cos - y * sin, x * sin + y * cos)
    middle = abs(abs(y) - 0.46) < 1e-6 or abs(x - 0.5) < 1e-6  # on the very rim rounding decides
    assert middle or runs_onto(rock(x, y), HERE, 0.0, BODY) == runs_onto(rock(x, -y), HERE, 0.0, BODY)
    assert middle or runs_onto(rock(x, y), HERE, 0.0, BODY) == runs_onto(turned, HERE, heading, BODY) or x > 0.9


def test_the_least_turn_clears_the_rock_on_the_side_of_the_way() -> None:
    ahead = rock(1.0, 0.1)
    for wanted in (-0.3, 0.3):
        turn = free_turn(ahead, HERE, 0.0, wanted, ALL_ROUND, BODY)
        assert turn is not None
        assert turn * wanted > 0.0
        assert not runs_onto(ahead, HERE, turn, BODY, 0.9)
    assert free_turn(ahead, HERE, 0.0, 0.3, (-0.1, 0.1), BODY) is None, "no room to turn"
    other = free_turn(ahead, HERE, 0.0, 0.3, (-np.pi, 0.1), BODY)
    assert other is not None
    assert other < 0.0, "without room on the side of the way, the other side"


def test_a_rover_before_a_rock_turns_then_steps_back_then_goes_on() -> None:
    # Its way leads past the rock on the right, but it was driven straight on: path following failed.
    world = DiscWorld.of([(2.9, 0.5, 0.2)])
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for n in range(20):
        pose = (0.1 * n, 0.0, 0.0)
        state, decision = navigator.step(state, look(world, np.array(pose), n, None), pose_at(*pose), float(n))
        assert "rock ahead" not in decision.reason
    reasons = []
    for time_s in (30.0, 60.0, 90.0, 120.0):  # each in vain: the rover stays where it is
        state, decision = navigator.step(state, None, pose_at(2.05, 0.0, 0.0), time_s)
        reasons.append(decision.reason)
    assert reasons[:2] == ["turn from a rock ahead", "back from a rock ahead"]
    assert all("rock ahead" not in reason for reason in reasons[2:]), "what was in vain is not done again"


@pytest.mark.parametrize(("yaw_rad", "goes_on"), [(0.0, True), (np.pi, False)])
def test_backing_ends_before_a_rock_straight_behind(yaw_rad: float, *, goes_on: bool) -> None:
    world = DiscWorld.of([(3.2, 1.0, 0.2)])
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    state, _ = navigator.step(state, look(world, np.zeros(3), 0.0, None), pose_at(0.0, 0.0, 0.0), 0.0)
    way = np.array([[2.3, 1.0], [4.3, 1.0]])
    state = replace(state, way=None, manoeuvre=Manoeuvre("back_up", "back out", (2.3, 1.0), 1.0, way_w=way))
    _, decision = navigator.step(state, None, pose_at(2.3, 1.0, yaw_rad), 1.5)
    assert (decision.reason == "back out") is goes_on, "0.9 m to the east; facing it, it would turn first"


def test_a_way_back_is_tight_where_a_rock_is_nearer_than_half_the_body() -> None:
    poses = np.array([[2.0 - 0.1 * n, 0.0, 0.0] for n in range(21)])
    place = Place((2.0, 0.0), 0.0, (10.0, 0.0), 0.5)
    # The body is 0.8 m wide: 0.41 m from the middle to the rock's edge is room enough, 0.39 is not.
    assert _first_tight(poses, rock(1.0, 0.51), place, BODY) == len(poses)
    assert _first_tight(poses, rock(1.05, 0.49), place, BODY) in {9, 10}, "from the leg that passes it on"
    beside = rock(2.0, 0.45)  # what it stands beside already it may leave
    assert _first_tight(poses, beside, place, BODY) == len(poses)


@pytest.mark.parametrize(("x_m", "y_m", "over"), [(0.4, 0.3, True), (0.6, 0.0, False), (0.0, 0.5, False)])
def test_the_body_stands_over_doubtful_rocks_within_its_outline(x_m: float, y_m: float, *, over: bool) -> None:
    doubtful = rock(x_m, y_m)
    doubtful[:, 5:] = 5.0, 0.0  # not hard, but dear
    pose = np.array([0.0, 0.0, 0.0])
    assert _over_rock(pose, doubtful, BODY) is over
    doubtful[:, 5] = 0.5
    assert not _over_rock(pose, doubtful, BODY)
