"""Off a slope that cannot be backed up: down it, if the nose points there and a way leads down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner import navigator, trouble
from planner.navigator_state import Decision, NavigatorState
from tests.planner_factory import FOOTPRINT, DiscWorld, look, pose_at
from worlds.geometry import quaternion_from_euler
from worlds.types import Pose, PoseEstimate

GOAL = (10.0, 0.0)


def leaning(x_m: float, down_rad: float, time_s: float) -> PoseEstimate:
    """An estimate of a rover that looks along x, its nose down by an angle."""
    pose = Pose(np.array([x_m, 0.0, 0.165]), quaternion_from_euler(0.0, down_rad, 0.0))
    return replace(pose_at(x_m, 0.0, 0.0, time_s), pose=pose)


def driven(world: DiscWorld, down_rad: float) -> NavigatorState:
    """The state of a rover that drove two metres along x on a slope."""
    state = navigator.begin(GOAL, 0.5, FOOTPRINT, (0.0, 0.0))
    for n in range(21):
        seen = look(world, np.array([0.1 * n, 0.0, 0.0]), n, None)
        state, _ = navigator.step(state, seen, leaning(0.1 * n, down_rad, n), n)
    return state


def after_trouble(state: NavigatorState, here: PoseEstimate) -> tuple[NavigatorState, Decision]:
    """What is decided where the rover was stopped."""
    return navigator.step(trouble.note_trouble(state, here), None, here, here.time_s)


@pytest.mark.parametrize(
    ("slope_deg", "nose_down_deg", "kind"),
    [
        (20.0, 20.0, "drive"),
        (20.0, -20.0, "back_up"),  # it was climbing: the way back leads down
        (8.0, 8.0, "back_up"),  # so much it climbs
        (0.0, 20.0, "back_up"),  # a rock under its rear wheels, or a hole before it
    ],
)
def test_a_stopped_rover_goes_down_what_it_could_not_back_up(slope_deg: float, nose_down_deg: float, kind: str) -> None:
    state = driven(DiscWorld.of([]), float(np.copysign(np.deg2rad(slope_deg), nose_down_deg)))
    _, decision = after_trouble(state, leaning(2.0, float(np.deg2rad(nose_down_deg)), 21.0))
    assert decision.kind == kind
    if kind == "drive":
        assert decision.reason == "down the slope"
        assert decision.waypoints_w[-1, 0] > 5.0
        np.testing.assert_allclose(decision.waypoints_w[:, 1], 0.0, atol=0.06)  # places lie on cells of 0.1 m


def test_ground_that_the_map_forbids_does_not_hold_it_on_the_slope() -> None:
    state = driven(DiscWorld.of([]), 0.38)
    wall = np.array([[3.5, y, 3.5, y, 0.5, 1.0, 1.0] for y in np.arange(-8.0, 8.1, 0.5)])
    _, decision = after_trouble(replace(state, forbidden=wall), leaning(2.0, 0.38, 21.0))
    assert decision.reason == "down the slope"


def test_the_way_down_leads_round_a_rock() -> None:
    state = driven(DiscWorld.of([(3.6, 0.15, 0.3)]), 0.35)
    _, decision = after_trouble(state, leaning(2.0, 0.35, 21.0))
    assert decision.reason == "down the slope"
    assert decision.waypoints_w[:, 1].min() < -0.3


def test_where_rocks_wall_the_slope_it_backs_out_as_ever() -> None:
    world = DiscWorld.of([(3.0, y, 0.3) for y in np.arange(-6.0, 6.1, 0.5)])
    _, decision = after_trouble(driven(world, 0.35), leaning(2.0, 0.35, 21.0))
    assert decision.reason != "down the slope"


def test_what_was_in_vain_is_not_tried_again_at_the_same_place() -> None:
    here = leaning(2.0, 0.35, 21.0)
    state, first = after_trouble(driven(DiscWorld.of([]), 0.35), here)
    state, second = after_trouble(state, replace(here, time_s=23.0))
    assert (first.reason, second.kind) == ("down the slope", "back_up")
    _, elsewhere = after_trouble(state, leaning(2.3, 0.35, 25.0))
    assert elsewhere.reason == "down the slope"
