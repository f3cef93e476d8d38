"""The fence as the autopilot keeps it: geometry, breaches, and where "return" leads."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.autopilot.fence import NO_FENCE_M, Circle, Fence, Polygon
from rover_sim.autopilot.mission import DriveTo, Mission, ReturnHome, SetSpeed, Wait
from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.autopilot.safety_parameters import ARDUPILOT_SAFETY, PX4_SAFETY
from rover_sim.autopilot.track import Track
from tests.test_autopilot_mission import Drive

SQUARE = Polygon(np.array([(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)]), inclusion=True)
PIT = Circle((2.0, 0.0), 0.5, inclusion=False)
NOTCHED = Polygon(np.array([(0, 0), (4, 0), (4, 4), (2, 1), (0, 4)], dtype=float), inclusion=True)  # not convex


def fenced(*areas: Polygon | Circle, **parameters: float) -> Drive:
    drive = Drive()
    drive.autopilot.fence.fence = Fence(areas)
    for name, value in {"FENCE_ENABLE": 1.0, **parameters}.items():
        assert drive.autopilot.parameters.set(name, value)
    return drive


FENCED = fenced(NOTCHED, FENCE_TYPE=4).autopilot


def test_depth_in_a_polygon_that_is_not_convex() -> None:
    assert NOTCHED.depth_m(1.0, 0.5) == pytest.approx(0.5)
    assert NOTCHED.depth_m(2.0, 2.0) == pytest.approx(-1.0 / math.hypot(1.0, 1.5), abs=1e-9)  # in the notch
    assert NOTCHED.depth_m(5.0, 0.0) == pytest.approx(-1.0)


@settings(max_examples=60)
@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_polygon_of_many_corners_is_nearly_its_circle(x_m: float, y_m: float) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    ring = Polygon(2.0 * np.column_stack([np.cos(angles), np.sin(angles)]), inclusion=True)
    assert ring.depth_m(x_m, y_m) == pytest.approx(Circle((0.0, 0.0), 2.0, inclusion=True).depth_m(x_m, y_m), abs=1e-4)


def test_inclusions_all_or_any_and_exclusions_always() -> None:
    other = Circle((6.0, 0.0), 3.0, inclusion=True)
    both = Fence((SQUARE, other, PIT))
    assert both.clearance_m(3.5, 0.0, any_inclusion=False) == pytest.approx(0.5)  # in the overlap
    assert both.clearance_m(6.0, 0.0, any_inclusion=False) < 0.0
    assert both.clearance_m(6.0, 0.0, any_inclusion=True) == pytest.approx(3.0)
    assert both.clearance_m(2.2, 0.0, any_inclusion=True) == pytest.approx(-0.3)
    assert Fence().clearance_m(0.0, 0.0, any_inclusion=False) == NO_FENCE_M


@pytest.mark.parametrize(("action", "mode"), [(0, Mode.AUTO), (1, Mode.RETURN), (2, Mode.HOLD), (3, Mode.SMART_RETURN)])
def test_a_breach_is_answered_as_the_parameter_says(action: int, mode: Mode) -> None:
    drive = fenced(SQUARE, FENCE_ACTION=action, FENCE_MARGIN=1.0)
    drive.begin(DriveTo((3.8, 0.0, 0.0), hold_s=30.0))
    drive.until(lambda: drive.rover.x_m > 3.2)
    assert "Fence 1.0 m away" in drive.texts
    drive.autopilot.fence.fence = Fence((Circle((0.0, 0.0), 3.0, inclusion=True),))  # drawn tighter while it drives
    drive.step()
    word = "" if action == 0 else f", {mode.name.lower().replace('_', ' ')}"
    assert f"Fence breached{word}" in drive.texts
    assert drive.autopilot.mode is mode
    assert drive.autopilot.tripped == (action != 0)
    assert (drive.autopilot.fence.breached, drive.autopilot.fence.breaches) == (True, 1)
    if mode in (Mode.RETURN, Mode.SMART_RETURN):
        drive.until(lambda: math.hypot(drive.rover.x_m, drive.rover.y_m) < 0.6)
        assert "Fence: inside again" in drive.texts
    drive.step()
    assert drive.autopilot.fence.breaches == 1  # one crossing, one breach


def test_a_person_drives_it_back_inside_after_a_breach() -> None:
    drive = fenced(SQUARE, FENCE_ACTION=2)
    drive.begin(DriveTo((3.9, 0.0, 0.0)))
    drive.until(lambda: drive.rover.x_m > 3.5)
    drive.rover.x_m = 4.3
    drive.step()
    assert drive.autopilot.mode is Mode.HOLD
    assert drive.autopilot.goto((1.0, 0.0, 0.0)) is None
    assert not drive.autopilot.tripped
    drive.until(lambda: drive.rover.x_m < 1.5)
    drive.rover.x_m = 4.3
    drive.step()
    assert drive.autopilot.fence.breaches == 2


def test_arming_outside_is_refused_with_its_reason() -> None:
    drive = fenced(SQUARE)
    drive.rover.x_m = 9.0
    drive.step()
    assert drive.autopilot.arm() == "outside of the fence"
    drive.step()
    assert "PreArm: outside of the fence" in drive.texts
    assert drive.autopilot.fence.breaches == 0
    assert drive.autopilot.arm(force=True) is None
    drive.step()
    assert (drive.autopilot.mode, drive.autopilot.fence.breaches) == (Mode.RETURN, 1)


def test_a_pose_that_is_no_number_is_neither_inside_nor_outside() -> None:
    drive = fenced(SQUARE, FENCE_ACTION=2)
    drive.begin(DriveTo((3.9, 0.0, 0.0)))
    drive.until(lambda: drive.rover.x_m > 1.0)
    drive.rover.x_m = 4.5
    drive.step()
    drive.rover.x_m = math.nan
    drive.step()
    assert drive.autopilot.fence.breached
    assert np.isfinite(drive.autopilot.returns.track.crumbs_w).all()


def test_targets_and_missions_outside_are_refused() -> None:
    drive = fenced(SQUARE, PIT)
    assert drive.autopilot.arm() is None
    for place in ((5.0, 0.0, 0.0), (2.1, 0.1, 0.0)):
        assert drive.autopilot.goto(place) == "the target is outside of the fence"
    assert drive.autopilot.mode is Mode.HOLD
    drive.autopilot.set_mission(Mission((DriveTo((1.0, 0.0, 0.0)), DriveTo((9.0, 0.0, 0.0)))))
    assert drive.autopilot.start_mission() == "item 1 is outside of the fence"
    drive.autopilot.set_mission(Mission((DriveTo((1.0, 0.0, 0.0)),)))
    assert drive.autopilot.start_mission() is None
    drive.autopilot.set_mission(Mission((DriveTo((9.0, 0.0, 0.0)),)))
    assert (drive.autopilot.mode, drive.autopilot.tripped) == (Mode.HOLD, True)
    drive.step()
    assert "Mission: item 0 is outside of the fence, hold" in drive.texts


def test_ways_across_a_line_are_refused_and_a_rover_outside_may_come_in() -> None:
    drive = fenced(NOTCHED, FENCE_TYPE=4)
    drive.rover.x_m, drive.rover.y_m = 0.3, 3.0
    drive.step()
    assert drive.autopilot.arm() is None
    assert drive.autopilot.goto((3.7, 3.0, 0.0)) == "the way to the target leads out of the fence"  # across the notch
    assert drive.autopilot.goto((2.0, 0.3, 0.0)) is None
    drive.autopilot.set_mode(Mode.HOLD)
    across = Mission((DriveTo((0.3, 3.0, 0.0)), SetSpeed(0.5), DriveTo((3.7, 3.0, 0.0))))
    drive.autopilot.set_mission(across)
    assert drive.autopilot.start_mission() == "the way to item 2 leads out of the fence"
    round_it = Mission((DriveTo((0.3, 3.0, 0.0)), DriveTo((2.0, 0.3, 0.0)), DriveTo((3.7, 3.0, 0.0))))
    drive.autopilot.set_mission(round_it)
    assert drive.autopilot.start_mission() is None
    drive.autopilot.set_mode(Mode.HOLD)
    drive.rover.x_m, drive.rover.y_m = 2.0, 3.0  # in the notch, outside
    drive.step()
    assert drive.autopilot.goto((0.3, 3.0, 0.0)) is None


@settings(max_examples=60, deadline=None)
@given(*(st.floats(-0.5, 4.5) for _ in range(4)))
def test_a_way_crosses_where_a_fine_look_along_it_says_so(x_m: float, y_m: float, to_x_m: float, to_y_m: float) -> None:
    guard = FENCED.fence
    share = np.linspace(0.0, 1.0, 401)[:, None]
    way = np.array([x_m, y_m]) * (1.0 - share) + np.array([to_x_m, to_y_m]) * share
    deepest = min(NOTCHED.depth_m(*place) for place in way)
    crosses = guard.crosses((x_m, y_m, 0.0), (to_x_m, to_y_m, 0.0), (0.0, 0.0, 0.0))
    assert crosses or deepest > -0.06  # beside a line it may be overlooked by a step of 5 cm
    assert not crosses or deepest < 0.01


def test_of_two_rally_points_the_one_with_a_clear_way_is_chosen() -> None:
    drive = fenced(NOTCHED, FENCE_TYPE=4, RALLY_INCL_HOME=0)
    drive.autopilot.returns.rally_w = ((3.7, 3.0, 0.0), (0.5, -0.5, 0.0), (0.2, 0.2, 0.0))
    assert drive.autopilot.returns.place((1.0, 2.3, 0.0), (0.0, 0.0, 0.0))[1] == (0.2, 0.2, 0.0)
    drive.autopilot.returns.rally_w = ((3.7, 3.0, 0.0),)
    assert drive.autopilot.returns.place((1.0, 2.3, 0.0), (0.0, 0.0, 0.0))[1] == (3.7, 3.0, 0.0)  # better than none


def test_the_circle_about_home_and_the_switches() -> None:
    drive = fenced(FENCE_RADIUS=5.0)
    assert not drive.autopilot.allows((5.1, 0.0, 0.0))
    assert drive.autopilot.parameters.set("FENCE_TYPE", 4)
    assert drive.autopilot.allows((5.1, 0.0, 0.0))
    assert not drive.autopilot.fence.on  # the list is empty
    assert drive.autopilot.arm() == "the fence is switched on, but there is none"
    drive.autopilot.fence.fence = Fence((SQUARE,))
    assert not drive.autopilot.allows((4.5, 0.0, 0.0))
    assert drive.autopilot.parameters.set("FENCE_ENABLE", 0)
    assert drive.autopilot.allows((4.5, 0.0, 0.0))


def test_px4s_names_and_choices() -> None:
    drive = Drive()
    drive.autopilot.parameters.remove(parameter.name for parameter in ARDUPILOT_SAFETY)
    drive.autopilot.parameters.extend(PX4_SAFETY)
    drive.autopilot.fence.fence = Fence((SQUARE,))
    drive.begin(DriveTo((3.9, 0.0, 0.0)))
    drive.until(lambda: drive.rover.x_m > 2.0)
    drive.rover.x_m = 4.5
    drive.step()
    assert drive.autopilot.mode is Mode.HOLD  # GF_ACTION 2
    assert drive.autopilot.parameters.set("GF_MAX_HOR_DIST", 2.0)
    assert not drive.autopilot.allows((2.5, 0.0, 0.0))
    assert drive.autopilot.parameters.set("GF_ACTION", 0)
    assert drive.autopilot.allows((9.0, 0.0, 0.0))
    assert drive.autopilot.set_mode(Mode.SMART_RETURN) == "the way back is not known"


def test_return_leads_to_the_nearest_rally_point_that_counts() -> None:
    drive = fenced(SQUARE)
    autopilot = drive.autopilot
    autopilot.returns.rally_w = ((3.0, 3.0, 0.0), (20.0, 0.0, 0.0))
    assert autopilot.returns.place((2.5, 2.5, 0.0), autopilot.home_w) == ("a rally point", (3.0, 3.0, 0.0))
    assert autopilot.returns.place((19.0, 0.0, 0.0), autopilot.home_w)[1] == (3.0, 3.0, 0.0)  # the near one is outside
    assert autopilot.returns.place((0.5, 0.5, 0.0), autopilot.home_w) == ("home", (0.0, 0.0, 0.0))
    assert autopilot.parameters.set("RALLY_INCL_HOME", 0)
    assert autopilot.returns.place((0.5, 0.5, 0.0), autopilot.home_w)[1] == (3.0, 3.0, 0.0)
    assert autopilot.parameters.set("RALLY_LIMIT_KM", 0.001)
    assert autopilot.returns.place((0.5, 0.5, 0.0), autopilot.home_w) == ("home", (0.0, 0.0, 0.0))


def test_the_return_command_and_the_mission_item_drive_to_the_rally_point() -> None:
    drive = Drive()
    drive.autopilot.returns.rally_w = ((2.0, 2.0, 0.0),)
    drive.begin(DriveTo((3.0, 0.0, 0.0)), ReturnHome(), Wait(30.0))
    drive.until(lambda: drive.autopilot.auto.current == 2)
    assert math.hypot(drive.rover.x_m - 2.0, drive.rover.y_m - 2.0) < 0.5
    drive.autopilot.returns.rally_w = ((2.0, 3.5, 0.0),)
    assert drive.autopilot.set_mode(Mode.RETURN) is None
    drive.step()
    assert "Returning to a rally point" in drive.texts
    drive.until(lambda: math.hypot(drive.rover.x_m - 2.0, drive.rover.y_m - 3.5) < 0.4)


def test_the_fences_return_point_serves_after_a_breach_only() -> None:
    drive = fenced(SQUARE)
    drive.autopilot.fence.fence = Fence((SQUARE,), return_w=(1.0, 1.0, 0.0))
    assert drive.autopilot.returns.place((3.0, 0.0, 0.0), drive.autopilot.home_w)[0] == "home"
    drive.begin(DriveTo((3.9, 0.0, 0.0)))
    drive.rover.x_m = 4.5
    drive.step()
    assert "Returning to the fence's return point" in drive.texts


def test_smart_return_goes_back_on_the_rovers_own_track() -> None:
    drive = Drive()
    drive.begin(DriveTo((3.0, 0.0, 0.0)), DriveTo((3.0, 3.0, 0.0)))
    drive.until(drive.complete)
    there = len(drive.track)
    assert drive.autopilot.set_mode(Mode.SMART_RETURN) is None
    drive.until(lambda: math.hypot(drive.rover.x_m, drive.rover.y_m) < 0.5)
    back = np.array(drive.track[there:])
    away = np.minimum(np.abs(back[:, 0] - 3.0), np.abs(back[:, 1]))  # from the two legs
    assert away.max() < 0.8
    assert drive.autopilot.auto.state is MissionState.COMPLETE


def test_the_track_cuts_loops_and_ends_when_full() -> None:
    track = Track()
    for place in [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1.1, 0.1), (1, -1)]:
        track.add(np.array([*place, 0.0]), 0.9, 10)
    assert [crumb[:2] for crumb in track.crumbs_w] == [(0, 0), (1, 0), (1, -1)]
    for x_m in range(2, 20):
        track.add(np.array([x_m, -1.0, 0.0]), 0.9, 10)
    assert track.full
    assert len(track.crumbs_w) == 10
