from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner import navigator, trouble
from planner.choice import Choice
from tests.planner_factory import FOOTPRINT, DiscWorld, look, pose_at, rock_field, traverse

WALL = [(6.0, float(y), 0.3) for y in np.arange(-7, 7.1, 0.5)]


def test_open_ground_takes_one_straight_line() -> None:
    run = traverse(DiscWorld.of([]), (10.0, 0.0))
    assert run.end == "arrived"
    assert run.length_m < 10.0
    assert run.missions <= 4


@pytest.mark.parametrize("seed", range(8))
def test_rock_fields_of_cfa_5_percent_are_crossed(seed: int) -> None:
    world = rock_field(0.05, 20.0, np.random.default_rng(seed))
    run = traverse(world, (20.0, 0.0), rng=np.random.default_rng(1000 + seed))
    assert run.end == "arrived"
    assert run.collisions == 0
    assert run.length_m < 20.0 * 1.35


@pytest.mark.parametrize(("sd_m", "away_m"), [(0.02, 1.35), (0.1, 1.3), (3.0, 1.2)])
def test_a_rover_that_is_unsure_of_its_place_goes_farther_into_the_goal(sd_m: float, away_m: float) -> None:
    # Radius 1.5: nine tenths of it, two sigmas inside it, four fifths of it.
    begun = navigator.begin((10.0, 0.0), 1.5, FOOTPRINT, (0.0, 0.0))

    def kind(distance_m: float) -> str:
        unsure = replace(pose_at(10.0 - distance_m, 0.0, 0.0), position_sd_m=sd_m)
        return navigator.step(begun, None, unsure, 0.0)[1].kind

    assert (kind(away_m - 0.01), kind(away_m + 0.01) == "arrived") == ("arrived", False)


def test_the_same_twice() -> None:
    world = rock_field(0.05, 8.0, np.random.default_rng(5))
    first, second = (traverse(world, (8.0, 0.0), rng=np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first.track, second.track)


def test_the_gap_of_a_wall_is_found() -> None:
    world = DiscWorld.of([disc for disc in WALL if abs(disc[1] - 4.0) > 0.9])
    run = traverse(world, (12.0, 0.0))
    assert run.end == "arrived"
    assert run.collisions == 0


def test_a_dead_end_is_left() -> None:
    u = [(6.0, float(y), 0.3) for y in np.arange(-2.5, 2.6, 0.5)]
    u += [(float(x), side, 0.3) for x in np.arange(1.5, 6.1, 0.5) for side in (-2.5, 2.5)]
    run = traverse(DiscWorld.of(u), (12.0, 0.0))
    assert run.end == "arrived"
    assert run.collisions == 0


def test_a_walled_goal_is_given_up_with_a_reason() -> None:
    ring = [(8 + 1.6 * np.cos(a), 1.6 * np.sin(a), 0.3) for a in np.linspace(0, 2 * np.pi, 24)]
    run = traverse(DiscWorld.of(ring), (8.0, 0.0))
    assert run.end == "no_path"
    assert "enclose" in run.reason
    assert run.collisions == 0
    assert run.sim_time_s < 150.0
    again = navigator.step(run.state, None, pose_at(*run.track[-1]), 999.0)
    assert again[1].kind == "no_path"


def test_a_goal_inside_a_rock_ends_without_an_exception() -> None:
    run = traverse(DiscWorld.of([(6.0, 0.0, 0.8)]), (6.0, 0.0))
    assert run.end == "no_path"
    assert run.collisions == 0


def test_a_goal_behind_is_reached() -> None:
    run = traverse(DiscWorld.of([(-4.0, 0.3, 0.3)]), (-8.0, 0.0))
    assert run.end == "arrived"
    assert run.collisions == 0


def test_a_free_way_is_kept() -> None:
    world = DiscWorld.of([(4.0, 0.1, 0.3)])
    state = navigator.begin((20.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    state, first = navigator.step(state, look(world, np.zeros(3), 0.0, None), pose_at(0, 0, 0), 0.0)
    _, second = navigator.step(state, look(world, np.zeros(3), 0.5, None), pose_at(0.05, 0, 0), 0.5)
    assert first.changed
    assert not second.changed
    assert second.waypoints_w is first.waypoints_w
    assert len(first.candidates) >= 2
    assert 0.0 <= first.risk <= 1.0


def on_its_way(wall: list[tuple[float, float, float]], x_m: float) -> tuple[bool, str]:
    """Whether a rover keeps its straight way when a wall across it is seen from a place 10 m before the goal."""
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for x in np.arange(0.0, x_m, 0.25):
        state, _ = navigator.step(state, look(DiscWorld.of([]), np.array([x, 0, 0]), x, None), pose_at(x, 0, 0), x)
    seen = look(DiscWorld.of(wall), np.array([x_m, 0, 0]), 9.0, None)
    _, decision = navigator.step(state, seen, pose_at(x_m, 0, 0), 9.0)
    return not decision.changed, decision.kind


def test_a_way_that_is_blocked_far_off_is_kept_until_it_is_near() -> None:
    # Round the wall by either side costs about as much from here as from 2 m nearer to it.
    wall = [(7.0, float(y), 0.3) for y in np.arange(-1.5, 1.6, 0.5)]
    assert on_its_way(wall, 1.0) == (True, "drive")
    assert on_its_way(wall, 5.5) != (True, "drive")


def test_a_way_that_leads_on_is_kept_where_the_search_finds_none(monkeypatch: pytest.MonkeyPatch) -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    none = Choice(None, 0.0, (), (), detour=True, squeeze=True, enclosed=True, reason="no row is free")
    state, first = navigator.step(state, look(DiscWorld.of([]), np.zeros(3), 0.0, None), pose_at(0, 0, 0), 0.0)
    monkeypatch.setattr(navigator, "choose", lambda *_args, **_named: none)
    _, kept = navigator.step(state, look(DiscWorld.of([]), np.zeros(3), 0.5, None), pose_at(0.05, 0, 0), 0.5)
    assert kept.waypoints_w is first.waypoints_w
    assert not kept.changed
    rock = look(DiscWorld.of([(1.5, 0.0, 0.3)]), np.zeros(3), 0.5, None)
    assert navigator.step(state, rock, pose_at(0.05, 0, 0), 0.5)[1].kind != "drive"
    assert navigator.step(state, None, pose_at(0.05, 0, 1.0), 0.5)[1].kind != "drive"


def test_a_way_is_left_by_a_rover_that_strays_towards_a_rock() -> None:
    # The way leads past the rock, which is met only as the rover points now, 0.2 m beside its way.
    def kept(heading_rad: float) -> bool:
        state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
        state, _ = navigator.step(state, look(DiscWorld.of([]), np.zeros(3), 0.0, None), pose_at(0, 0, 0), 0.0)
        seen = look(DiscWorld.of([(1.2, 0.75, 0.2)]), np.zeros(3), 0.5, None)
        return not navigator.step(state, seen, pose_at(0.4, 0.2, heading_rad), 0.5)[1].changed

    assert kept(0.0)
    assert not kept(0.5)


def test_no_picture_yet_is_no_reason_to_fail() -> None:
    state = navigator.begin((5.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    assert navigator.step(state, None, pose_at(0, 0, 0), 0.0)[1].kind == "drive"


def test_trouble_ahead_is_backed_out_of_and_avoided() -> None:
    state = navigator.begin((10.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    for x in np.arange(0.0, 3.0, 0.25):
        state, _ = navigator.step(state, look(DiscWorld.of([]), np.array([x, 0, 0]), x, None), pose_at(x, 0, 0), x)
    state = trouble.note_trouble(state, pose_at(2.75, 0, 0))
    state, decision = navigator.step(state, None, pose_at(2.75, 0, 0), 3.5)
    assert decision.kind == "back_up"
    assert decision.waypoints_w[0, 0] - decision.waypoints_w[-1, 0] == pytest.approx(0.8, abs=0.2)
    _, onward = navigator.step(state, None, pose_at(1.9, 0, 0), 5.0)
    assert onward.kind == "drive"
    assert abs(np.interp(3.5, onward.waypoints_w[:, 0], onward.waypoints_w[:, 1])) > 0.5


def test_a_dead_end_deeper_than_the_view_is_left_again() -> None:
    deep = [(13.0, float(y), 0.3) for y in np.arange(-2.5, 2.6, 0.5)]
    deep += [(float(x), side, 0.3) for x in np.arange(1.5, 13.1, 0.5) for side in (-2.5, 2.5)]
    run = traverse(DiscWorld.of(deep), (18.0, 0.0), time_limit_s=300.0)
    assert run.track[:, 0].max() > 5.0
    assert run.end == "arrived"
    assert run.collisions == 0
