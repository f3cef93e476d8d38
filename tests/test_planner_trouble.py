"""What keeps the rover out of trouble among many rocks, and how it gets out: track, fence, pieces, heights, bends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from planner import mobility, navigator, trouble
from planner.choice import turn_prices
from planner.navigator_state import place_of
from planner.obstacle_map import STEREO_DRIVE, DriveModel, belly_meets, distance_to, fence, judged, obstacles, passed_by
from planner.recovery import NUDGE_M_S, RUNGS, STRAIGHT_ON_M
from planner.room import PIT_WALLS
from planner.terrain_map import STEREO_MEMORY, empty_memory, remember, rock_at
from planner.track import NO_TRACK, STEP_M, note, way_back
from tests.planner_factory import FOOTPRINT, DiscWorld, look, pose_at
from worlds.geometry import quaternion_from_euler
from worlds.types import FloatArray, Observation, PerceivedRock, Pose, PoseEstimate

CLIMB_M = 0.10


def driven(places: list[tuple[float, float, float]]) -> FloatArray:
    """The track of a rover that was at ``places``."""
    track = NO_TRACK
    for place in places:
        track = note(track, place)
    return track


def table_of(*rocks: PerceivedRock, drive: DriveModel = DriveModel()) -> FloatArray:  # noqa: B008 - frozen
    """Obstacles that one look at rocks makes."""
    seen = Observation(0.0, rocks, np.empty((0, 0), dtype=np.str_), np.zeros((0, 0, 2)), np.zeros((0, 2)))
    memory = remember(empty_memory(np.zeros(2)), seen, np.zeros(2))
    return obstacles(memory.rocks, drive, CLIMB_M)


def one_rock(height_m: float) -> Observation:
    """A look that shows one rock whose height is known to a centimetre."""
    rock = structs.replace(rock_at((2.0, 0.0, 0.0), 0.3, height_m), height_sd_m=0.01)
    return Observation(0.0, (rock,), np.empty((0, 0), dtype=np.str_), np.zeros((0, 0, 2)), np.zeros((0, 2)))


def test_a_narrow_way_may_lead_over_what_is_hardly_too_high_at_its_price() -> None:
    model = DriveModel(squeeze_doubt=0.25)
    rocks = remember(empty_memory(np.zeros(2)), one_rock(0.1), np.zeros(2)).rocks  # a sigma below what the belly meets
    (doubt,) = belly_meets(rocks, model, CLIMB_M)
    assert 0.135 < doubt < 0.25
    table = obstacles(rocks, model, CLIMB_M, place_w=np.array([1.0, 0.0]))
    assert table[0, 6] == pytest.approx(1.0 - doubt)
    np.testing.assert_allclose(
        passed_by(table, model, squeeze=True)[0, 5:], [model.doubt_weight * doubt / (1.0 - doubt), 0.0]
    )
    surely = obstacles(rocks, DriveModel(), CLIMB_M, place_w=np.array([1.0, 0.0]))
    np.testing.assert_array_equal(passed_by(surely, DriveModel(), squeeze=True), surely)


@pytest.mark.parametrize(("height_m", "near", "far"), [(0.11, True, False), (0.14, True, True), (0.07, False, False)])
def test_far_rocks_are_hard_only_if_they_are_probably_too_high(height_m: float, near: bool, far: bool) -> None:
    # The belly meets what is 1.15 climb heights high, here 0.115 m; one sigma of a centimetre counts as one and a half.
    rocks = remember(empty_memory(np.zeros(2)), one_rock(height_m), np.zeros(2)).rocks
    hard = [obstacles(rocks, DriveModel(), CLIMB_M, place_w=np.array([x, 0.0]))[0, 6] for x in (1.0, -1.0)]
    assert hard == [near, far]


def test_a_rock_that_proved_too_high_from_near_stays_so_from_afar() -> None:
    # Judged by the distance of now, one gap was driven up to and backed out of eleven times.
    none, memory = np.empty((0, 0), dtype=np.str_), empty_memory(np.zeros(2))
    for range_m, hard in ((2.0, False), (1.2, True)):
        rock = structs.replace(rock_at((2.0, 0.0, 0.0), 0.3, 0.11, range_m=range_m), height_sd_m=0.01)
        seen = Observation(2.0 - range_m, (rock,), none, np.zeros((0, 0, 2)), np.zeros((0, 2)))
        memory = remember(memory, seen, np.array([2.0 - range_m, 0.0]))
        afar = obstacles(memory.rocks, DriveModel(), CLIMB_M, place_w=np.array([-1.0, 0.0]))
        assert bool(afar[0, 6] == 1.0) is hard


def test_the_track_grows_by_steps_and_shrinks_where_it_is_backed_out_of() -> None:
    there = [(x, 0.0, 0.0) for x in np.arange(0.0, 2.01, 0.05)]
    track = driven(there)
    assert track[-1, 0] == pytest.approx(2.0, abs=STEP_M)
    assert np.diff(track[:, 0]).min() >= STEP_M - 1e-9
    back = driven(there + [(x, 0.0, 0.0) for x in np.arange(1.95, 0.99, -0.05)])
    assert back[-1, 0] == pytest.approx(1.0, abs=STEP_M)


@given(st.floats(0.3, 4.0))
def test_the_way_back_is_as_long_as_asked_and_ends_on_the_track(most_m: float) -> None:
    track = driven([(x, 0.3 * x, 0.3) for x in np.arange(0.0, 5.0, 0.05)])
    back = way_back(track, (float(track[-1, 0]), float(track[-1, 1])), most_m)
    length = float(np.hypot(*(back[-1, :2] - track[-1, :2])))
    assert most_m - 2 * STEP_M < length <= most_m + 1e-9
    assert any(np.allclose(pose, back[-1]) for pose in track)


def test_backing_follows_a_bend_that_was_driven() -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    corner = [(0.1 * n, 0.0, 0.0) for n in range(21)] + [(2.0, 0.1 * n, np.pi / 2) for n in range(1, 6)]
    for n, pose in enumerate(corner):
        state, _ = navigator.step(state, look(DiscWorld.of([]), np.array(pose), n, None), pose_at(*pose), float(n))
    state = trouble.note_trouble(state, pose_at(*corner[-1]))
    _, decision = navigator.step(state, None, pose_at(*corner[-1]), 40.0)
    assert decision.kind == "back_up"
    assert np.abs(decision.waypoints_w[:, 0] - 2.0).max() > 0.1, "it goes round the corner, not through"
    assert decision.waypoints_w[-1, 1] < 0.1


@pytest.mark.parametrize(("rocks_m", "moved_m"), [(1.6, 1.2), (1.2, 0.25)])
def test_out_of_a_turn_in_vain_the_rover_goes_straight_as_far_as_there_is_room(rocks_m: float, moved_m: float) -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    world = DiscWorld.of([(2.0, rocks_m, 0.2), (2.0, -rocks_m, 0.2)])
    for n in range(21):
        pose = (0.1 * n, 0.0, 0.0)
        state, _ = navigator.step(state, look(world, np.array(pose), n, None), pose_at(*pose), float(n))
    turned = pose_at(2.0, 0.0, np.pi / 2)  # across the way in, between two rocks
    state = trouble.note_trouble(state, turned)
    state, decision = navigator.step(state, None, turned, 40.0)
    assert decision.kind == "back_up"
    assert decision.speed_m_s == NUDGE_M_S
    np.testing.assert_allclose(decision.waypoints_w[-1], [2.0, -moved_m - STRAIGHT_ON_M], atol=1e-9)
    assert state.manoeuvre is not None
    assert state.manoeuvre.nudge_m == moved_m
    state, decision = navigator.step(state, None, pose_at(2.0, -0.4 * moved_m, np.pi / 2), 41.0)
    assert decision.reason == "straight, no turn"
    _, decision = navigator.step(state, None, pose_at(2.0, -0.95 * moved_m, np.pi / 2), 42.0)
    assert decision.reason != "straight, no turn", "it ends where there is room, short of the end of its way"


def test_where_a_turn_was_in_vain_turns_are_dear_and_nothing_ahead_is_to_blame() -> None:
    state = navigator.begin((-10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))  # behind it: it begins with a turn
    state, _ = navigator.step(state, look(DiscWorld.of([]), np.zeros(3), 0.0, None), pose_at(0.0, 0.0, 0.0), 0.0)
    stuck = trouble.note_trouble(state, pose_at(0.0, 0.0, 0.3))
    assert not len(stuck.avoid_w)
    np.testing.assert_allclose(stuck.dug_w, [[0.0, 0.0]])
    turns = np.array([-1.0, 1.0])
    for x_m, price in ((0.2, 1.0 + PIT_WALLS), (0.6, 1.0)):
        np.testing.assert_allclose(turn_prices(place_of(stuck, pose_at(x_m, 0.0, 0.0)), turns), price)


@pytest.mark.parametrize(("apart_m", "avoided"), [(0.3, 1), (0.6, 0)])
def test_a_place_where_turns_were_in_vain_twice_is_avoided(apart_m: float, avoided: int) -> None:
    state = navigator.begin((-10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    state, _ = navigator.step(state, look(DiscWorld.of([]), np.zeros(3), 0.0, None), pose_at(0.0, 0.0, 0.0), 0.0)
    once = trouble.note_trouble(state, pose_at(0.0, 0.0, 0.3))
    twice = trouble.note_trouble(replace(once, way=state.way), pose_at(apart_m, 0.0, 0.3))
    assert len(once.avoid_w) == 0
    np.testing.assert_allclose(twice.avoid_w, [[apart_m, 0.0, 0.35]][:avoided] if avoided else np.zeros((0, 3)))


@pytest.mark.parametrize(("nose_up_rad", "avoided"), [(0.0, 0), (0.4, 1)])
def test_a_rover_held_askew_on_a_bank_was_not_turning(nose_up_rad: float, avoided: int) -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for n in range(4):
        state, _ = navigator.step(state, look(DiscWorld.of([]), np.zeros(3), 0.5 * n, None), pose_at(0, 0, 0), 0.5 * n)
    askew = Pose(np.array([0.0, 0.0, 0.165]), quaternion_from_euler(0.0, -nose_up_rad, 0.3))
    held = trouble.note_trouble(state, replace(pose_at(0.0, 0.0, 0.3, 1.6), pose=askew))
    assert (len(held.avoid_w), len(held.dug_w)) == (avoided, 1 - avoided)


def test_backing_out_that_did_nothing_is_not_tried_again() -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for n in range(21):
        pose = (0.1 * n, 0.0, 0.0)
        state, _ = navigator.step(state, look(DiscWorld.of([]), np.array(pose), n, None), pose_at(*pose), float(n))
    turned = pose_at(2.0, 0.0, 0.5)
    state, first = navigator.step(trouble.note_trouble(state, turned), None, turned, 40.0)
    state, second = navigator.step(trouble.note_trouble(state, turned), None, turned, 42.0)
    assert (first.kind, second.kind) == ("back_up", "back_up")
    np.testing.assert_allclose(first.waypoints_w[-1, 1], 0.0, atol=0.05)  # along the way in
    far_m = 1.2 + STRAIGHT_ON_M
    np.testing.assert_allclose(second.waypoints_w[-1], [2.0 - far_m * np.cos(0.5), -far_m * np.sin(0.5)], atol=1e-9)


@pytest.mark.parametrize(("slope_rad", "straight"), [(0.0, False), (0.2, True)])
def test_on_a_slope_a_rover_that_slid_round_backs_straight_down(slope_rad: float, *, straight: bool) -> None:
    def leaning(x: float, yaw: float, time_s: float) -> PoseEstimate:
        pose = Pose(np.array([x, 0.0, 0.165]), quaternion_from_euler(0.0, -slope_rad, yaw))
        return replace(pose_at(x, 0.0, yaw, time_s), pose=pose)

    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for n in range(21):
        seen = look(DiscWorld.of([]), np.array((0.1 * n, 0.0, 0.0)), n, None)
        state, _ = navigator.step(state, seen, leaning(0.1 * n, 0.0, n), n)
    slid = leaning(2.0, 0.5, 20.5)
    _, decision = navigator.step(trouble.note_trouble(state, slid), None, slid, 20.5)
    assert decision.kind == "back_up"
    far_m = 0.8 + STRAIGHT_ON_M
    end = [2.0 - far_m * np.cos(0.5), -far_m * np.sin(0.5)] if straight else [decision.waypoints_w[-1, 0], 0.0]
    np.testing.assert_allclose(decision.waypoints_w[-1], end, atol=0.05)


def test_a_nudge_in_vain_is_followed_by_one_to_the_other_side() -> None:
    # Seed 7719, CFA 15 %: "straight on" three times over, until the rover was embedded; a step back freed it.
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for n in range(21):
        seen = look(DiscWorld.of([]), np.array((0.1 * n, 1.5, 0.0)), n, None)
        state, _ = navigator.step(state, seen, pose_at(0.1 * n, 1.5, 0.0), float(n))
    here, kinds = pose_at(2.0, 1.5, 0.0), []
    for time_s in (40.0, 42.0, 44.0, 46.0):
        state, decision = navigator.step(trouble.note_trouble(state, here), None, here, time_s)
        kinds.append((decision.kind, decision.reason))
    assert kinds[0] == ("back_up", "back out of trouble")
    assert kinds[1:] == [(kind, "straight, no turn") for kind in ("back_up", "drive", "back_up")]


def test_without_room_for_a_nudge_the_ladder_goes_on() -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    world = DiscWorld.of([(2.72, 0.0, 0.2), (1.28, 0.0, 0.2)])  # close before and behind the rover
    for n in range(21):
        pose = (2.0, 0.1 * n - 2.0, np.pi / 2)  # it came from the side and turned
        state, _ = navigator.step(state, look(world, np.array(pose), n, None), pose_at(*pose), float(n))
    turned = pose_at(2.0, 0.0, 0.0)
    state, _ = navigator.step(state, look(world, np.array([2.0, 0.0, 0.0]), 22.0, None), turned, 22.0)
    state, first = navigator.step(trouble.note_trouble(state, turned), None, turned, 40.0)
    state, second = navigator.step(trouble.note_trouble(state, turned), None, turned, 42.0)
    assert first.kind == "back_up"  # along the way in, with a turn
    assert second.kind != "back_up"


def test_a_rover_that_nothing_frees_drives_on_where_there_is_a_way() -> None:
    # Seed 7729, CFA 15 %: "no path" after 86 s, although a way had been found at each look.
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (2.0, 0.0))
    here = pose_at(2.0, 0.0, 0.0)
    state, _ = navigator.step(state, look(DiscWorld.of([]), np.array([2.0, 0.0, 0.0]), 0.0, None), here, 0.0)
    spent = replace(state.ladder, rung=len(RUNGS), place_w=(2.0, 0.0), tried_w=(2.0, 0.0), back_first=True)
    before_and_behind = np.array([[2.72, 0.0, 0.05], [1.28, 0.0, 0.05]])  # it can turn, and neither nudge nor back out
    state = replace(state, ladder=spent, track_w=NO_TRACK, avoid_w=before_and_behind, way=None)
    state, decision = navigator.step(state, None, here, 1.0)
    assert decision.kind == "drive"
    assert state.end is None


def test_a_turn_in_vain_makes_no_place_of_trouble_ahead() -> None:
    state = navigator.begin((-10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))  # behind it: it begins with a turn
    here = pose_at(0.0, 0.0, 0.0)
    state, decision = navigator.step(state, look(DiscWorld.of([]), np.zeros(3), 0.0, None), here, 0.0)
    assert decision.kind == "drive"
    assert not len(trouble.note_trouble(state, here).avoid_w)
    for x in (0.0, -2.0):
        assert len(trouble.note_trouble(state, pose_at(x, 0.0, np.pi)).avoid_w) == 1


def test_only_the_last_places_of_trouble_are_avoided_and_none_for_a_manoeuvre() -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for x in range(6):
        state = trouble.note_trouble(state, pose_at(float(x), 0.0, 0.0))
    assert len(state.avoid_w) == trouble.MOST_AVOIDED
    assert state.avoid_w[-1, 0] > 5.0
    state, decision = navigator.step(state, None, pose_at(5.0, 0.0, 0.0), 1.0)
    assert decision.kind in {"back_up", "look"}
    assert len(trouble.note_trouble(state, pose_at(5.0, 0.0, 0.0)).avoid_w) == trouble.MOST_AVOIDED


@pytest.mark.parametrize(
    ("speed_m_s", "slope_rad", "tilt_rad", "goes_on"),
    [(0.16, 0.2, 0.2, True), (0.1, 0.2, 0.2, False), (0.25, 0.2, 0.6, False), (0.25, 0.0, 0.0, False)],
)
def test_a_stop_of_a_rover_that_gets_on_up_a_slope_is_no_trouble(
    speed_m_s: float, slope_rad: float, tilt_rad: float, *, goes_on: bool
) -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for n in range(9):  # two looks a second
        pose = (0.5 * n * speed_m_s, 0.0, 0.0)
        seen = look(DiscWorld.of([]), np.array(pose), 0.5 * n, None)
        climbing = Pose(np.array([pose[0], 0.0, 0.165]), quaternion_from_euler(0.0, -slope_rad, 0.0))
        state, _ = navigator.step(state, seen, replace(pose_at(*pose, 0.5 * n), pose=climbing), 0.5 * n)
    x, time_s = speed_m_s * 4.2, 4.2
    leaning = Pose(np.array([x, 0.0, 0.165]), quaternion_from_euler(0.0, -tilt_rad, 0.0))
    stopped = replace(pose_at(x, 0.0, 0.0, time_s), pose=leaning)
    _, decision = navigator.step(trouble.note_trouble(state, stopped), None, stopped, time_s)
    assert (decision.kind == "drive") is goes_on
    assert len(trouble.note_trouble(state, stopped).avoid_w) == (not goes_on)


@given(st.floats(-4.0, 9.0), st.floats(-3.0, 2.0))
def test_a_fence_is_as_near_as_the_nearest_limit(x: float, y: float) -> None:
    around = fence(((-5.0, 10.0), (-4.0, 3.0)))
    nearest = min(x + 5.0, 10.0 - x, y + 4.0, 3.0 - y)
    assert distance_to(around, np.array([x, y])).min() == pytest.approx(nearest, abs=1e-9)
    assert (around[:, 6] == 1.0).all()


def test_the_navigator_keeps_inside_its_area() -> None:
    wall = [(3.0, y, 0.25) for y in np.arange(-1.5, 6.0, 0.4)]  # the way round on the right leads over the limit
    state = navigator.begin((6.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0), area=((-8.0, 12.0), (-2.0, 9.0)))
    state, _ = navigator.step(state, look(DiscWorld.of(wall), np.zeros(3), 0.0, None), pose_at(0, 0, 0), 0.0)
    _, decision = navigator.step(state, None, pose_at(0, 0, 0), 0.5)
    assert decision.kind != "drive" or decision.waypoints_w[:, 1].min() > -1.7


def test_backing_begins_beside_the_rover_also_after_it_slid_back() -> None:
    track = NO_TRACK
    for x in np.arange(0.0, 2.05, 0.1):
        track = note(track, (float(x), 0.0, 0.0))
    slid = (1.5, 0.15)  # and turned: the last poses lie ahead of it
    poses = way_back(track, slid, 1.0)
    np.testing.assert_allclose(poses[0, :2], [1.5, 0.0], atol=0.11)
    assert (np.diff(poses[:, 0]) < 0.0).all()


def test_a_height_is_held_against_the_climb_height_with_some_of_its_error() -> None:
    sure = structs.replace(rock_at((2.0, 0.0, 0.0), 0.2, 0.09), height_sd_m=0.005)
    assert not table_of(sure)[0, 6]
    assert table_of(structs.replace(sure, height_sd_m=0.04))[0, 6]
    assert table_of(structs.replace(sure, height_m=0.11))[0, 6]


def test_a_rock_costs_by_the_probability_that_the_belly_meets_it() -> None:
    sure = structs.replace(rock_at((2.0, 0.0, 0.0), 0.2, 0.06), height_sd_m=0.005)
    vague, higher = structs.replace(sure, height_sd_m=0.02), structs.replace(sure, height_m=0.09, height_sd_m=0.013)
    weights = [table_of(rock)[0, 5] for rock in (sure, vague, higher)]
    assert weights[0] < weights[1] < weights[2]


def test_on_uneven_ground_the_belly_meets_lower_rocks() -> None:
    rock = structs.replace(rock_at((2.0, 0.0, 0.0), 0.2, 0.089), height_sd_m=0.015)
    level, uneven = (table_of(rock, drive=DriveModel(lifted_m=lifted_m)) for lifted_m in (0.0, 0.01))
    assert not level[0, 6]
    assert uneven[0, 6]


def test_a_rock_stays_what_it_was_judged_until_another_is_plainly_right() -> None:
    def now_hard(before_m: float, now_m: float) -> bool:
        heights = (before_m, now_m)
        low, then = (remember(empty_memory(np.zeros(2)), one_rock(height_m), np.zeros(2)).rocks for height_m in heights)
        before = judged(low, DriveModel(), CLIMB_M)
        table = obstacles(replace(then, judged=before.judged), DriveModel(), CLIMB_M)
        return bool(table[0, 6])

    limit_m = 1.15 * CLIMB_M - 0.01 * 1.5 * np.log(1 / 0.135 - 1) / 1.702  # where the belly meets it with 13.5 %
    assert [now_hard(h, h) for h in (limit_m - 0.001, limit_m + 0.001)] == [False, True]
    assert not now_hard(0.06, limit_m + 0.002)
    assert now_hard(0.14, limit_m - 0.002)
    assert now_hard(0.06, limit_m + 0.005)
    assert not now_hard(0.14, limit_m - 0.005)


def test_a_wheel_may_take_the_flank_of_a_low_rock_only() -> None:
    def radius(height_m: float, wheel_m: float) -> float:
        rock = structs.replace(rock_at((2.0, 0.0, 0.0), 0.3, height_m), height_sd_m=0.005)
        seen = Observation(0.0, (rock,), np.empty((0, 0), dtype=np.str_), np.zeros((0, 0, 2)), np.zeros((0, 2)))
        rocks = remember(empty_memory(np.zeros(2)), seen, np.zeros(2)).rocks
        table = obstacles(rocks, DriveModel(), CLIMB_M, wheel_width_m=wheel_m)
        assert table[0, 6]
        return float(table[0, 4])

    assert radius(0.115, 0.1) == pytest.approx(radius(0.115, 0.0) - 0.1)
    assert radius(0.2, 0.1) == radius(0.2, 0.0)


def test_a_far_rock_must_be_placed_better_to_be_hard() -> None:
    rock = structs.replace(rock_at((4.0, 0.0, 0.0), 0.4, 0.2, range_m=4.0), position_sd_m=0.2)
    seen = Observation(0.0, (rock,), np.empty((0, 0), dtype=np.str_), np.zeros((0, 0, 2)), np.zeros((0, 2)))
    rocks = remember(empty_memory(np.zeros(2)), seen, np.zeros(2)).rocks
    from_afar, from_near = (
        obstacles(rocks, DriveModel(), CLIMB_M, place_w=np.array(place)) for place in ([0.0, 0.0], [3.0, 0.0])
    )
    assert not from_afar[0, 6]
    assert from_near[0, 6]


def test_a_far_view_leaves_a_place_as_sure_as_a_near_one_made_it() -> None:
    near = structs.replace(rock_at((6.0, 0.0, 0.0), 0.3, 0.2, range_m=1.5), position_sd_m=0.04)
    far = structs.replace(rock_at((6.0, 0.0, 0.0), 0.3, 0.2, range_m=5.0), position_sd_m=0.3)
    memory, none = empty_memory(np.zeros(2)), np.empty((0, 0), dtype=np.str_)
    for n, (rock, x) in enumerate(((near, 4.5), (far, 1.0), (far, 1.0))):
        seen = Observation(float(n), (rock,), none, np.zeros((0, 0, 2)), np.zeros((0, 2)))
        memory = remember(memory, seen, np.array([x, 0.0]))
    assert len(memory.rocks) == 1
    assert memory.rocks.worst_sd_m[0] <= 0.04 + 1e-9


def test_touching_pieces_count_as_the_rock_that_they_make() -> None:
    piece, other = rock_at((2.0, 0.0, 0.0), 0.16, 0.06), rock_at((2.0, 0.17, 0.0), 0.16, 0.06)
    joined = table_of(piece, other)
    assert len(joined) == 3
    assert joined[:, 6].sum() == 1.0
    apart = table_of(piece, rock_at((2.0, 0.30, 0.0), 0.16, 0.06))
    assert not apart[:, 6].any()
    small = table_of(rock_at((2.0, 0.0, 0.0), 0.08, 0.04), rock_at((2.0, 0.08, 0.0), 0.08, 0.04))
    assert not small[:, 6].any(), "together they are still low"
    by_two_eyes = table_of(piece, other, drive=STEREO_DRIVE)
    assert len(by_two_eyes) == 2, "two eyes measure how high each of them is"
    assert not by_two_eyes[:, 6].any()


def test_a_piece_seen_from_near_by_does_not_shrink_what_was_seen_whole() -> None:
    def remembered(first_m: float) -> float:
        """Height after a view of the whole from ``first_m`` and three of a piece of it from 1.4 m."""
        whole = structs.replace(rock_at((6.0, 0.0, 0.0), 0.4, 0.12, range_m=first_m), height_sd_m=0.012)
        piece = structs.replace(rock_at((6.0, 0.0, 0.0), 0.2, 0.05, range_m=1.4), height_sd_m=0.008)
        memory, none = empty_memory(np.zeros(2)), np.empty((0, 0), dtype=np.str_)
        for n, (rock, x) in enumerate([(whole, 6.0 - first_m), *[(piece, 4.6)] * 3]):
            seen = Observation(float(n), (rock,), none, np.zeros((0, 0, 2)), np.zeros((0, 2)))
            memory = remember(memory, seen, np.array([x, 0.0]), STEREO_MEMORY)
        assert len(memory.rocks) == 1
        return float(memory.rocks.height_m[0])

    # Weights by hand: 2^-4 = 0.0625 of the whole, 3 times 0.1 * 1.4^-4 = 0.078 of the pieces.
    assert remembered(2.0) == pytest.approx((0.0625 * 0.12 + 0.078 * 0.05) / 0.1405, abs=0.001)
    assert remembered(4.0) < 0.053, "what was seen from afar only may have been two rocks"


def test_near_views_undo_many_far_ones() -> None:
    memory = empty_memory(np.zeros(2))
    far = structs.replace(rock_at((6.0, 0.0, 0.0), 0.3, 0.20, range_m=6.0), height_sd_m=0.01)
    near = structs.replace(rock_at((6.0, 0.0, 0.0), 0.2, 0.05, range_m=1.5), height_sd_m=0.01)
    outline, none = np.zeros((0, 2)), np.empty((0, 0), dtype=np.str_)
    for n in range(23):
        rock, place = (far, np.zeros(2)) if n < 20 else (near, np.array([4.5, 0.0]))
        memory = remember(memory, Observation(float(n), (rock,), none, np.zeros((0, 0, 2)), outline), place)
    assert len(memory.rocks) == 1
    assert memory.rocks.height_m[0] < 0.06


@given(st.floats(-0.6, 0.6), st.floats(0.2, 2.0))
def test_bends_keep_the_inner_wheels_rolling(bearing: float, reach: float) -> None:
    limits = mobility.Limits()
    path = np.array([[0.0, 0.0], [reach * np.cos(bearing), reach * np.sin(bearing)]])
    command, _ = mobility.follow_path(path, pose_at(0, 0, 0), FOOTPRINT, limits, mobility.Progress())
    if command.linear_m_s > 0.0:
        wheels = np.array(mobility.wheel_speeds(command.linear_m_s, command.yaw_rate_rad_s, FOOTPRINT))
        assert wheels.min() * FOOTPRINT.wheel_radius_m >= (limits.inner_share - 1e-6) * command.linear_m_s
