from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner import monitor
from planner.mobility import STOP, Command, wheel_speeds
from tests.planner_factory import FOOTPRINT, pose_at
from worlds.geometry import quaternion_from_euler
from worlds.types import Pose, PoseEstimate

REVOLUTION_M = 2 * np.pi * FOOTPRINT.wheel_radius_m


def moving(time_s: float, x_m: float, speed: float, tilt: tuple[float, float] = (0.0, 0.0)) -> PoseEstimate:
    estimate = pose_at(x_m, 0.0, 0.0, time_s)
    pose = Pose(estimate.pose.position_w, quaternion_from_euler(*tilt, 0.0))
    return replace(estimate, pose=pose, velocity_w=np.array([speed, 0.0, 0.0]))


def run(slip: float, seconds: float, wheel_m_s: float = 0.5) -> tuple[monitor.MonitorState, list[monitor.Advice]]:
    state, advices = monitor.MonitorState(), []
    true_speed = wheel_m_s * (1 - slip)
    for tick in range(1, int(seconds * 20) + 1):
        estimate = moving(tick / 20, true_speed * tick / 20, true_speed)
        state, advice = monitor.watch(
            state, estimate, wheel_speeds(wheel_m_s, 0.0, FOOTPRINT), Command(wheel_m_s, 0.0), FOOTPRINT
        )
        advices.append(advice)
    return state, advices


def test_slip_is_one_minus_true_over_wheel_speed() -> None:
    state, advices = run(0.25, 10.0)
    assert state.slip == pytest.approx(0.25, abs=0.01)
    assert state.slip_left == pytest.approx(0.25, abs=0.01)
    assert set(advices) == {monitor.Advice.NONE}


def test_slip_over_40_percent_stops_soon_after_one_revolution() -> None:
    _, advices = run(0.6, 6.0)
    first = advices.index(monitor.Advice.SLIP_STOP) / 20 * 0.5  # wheel travel in metres
    assert REVOLUTION_M <= first < REVOLUTION_M + 0.4


def test_a_short_slip_is_forgiven() -> None:
    _, advices = run(0.6, 1.2)
    assert set(advices) == {monitor.Advice.NONE}


def test_a_turn_on_the_spot_is_no_slip() -> None:
    state = monitor.MonitorState()
    for tick in range(1, 200):
        estimate = replace(pose_at(0.0, 0.0, 0.02 * tick, tick / 20), yaw_rate_rad_s=0.4)
        state, advice = monitor.watch(state, estimate, wheel_speeds(0.0, 0.4, FOOTPRINT), Command(0.0, 0.4), FOOTPRINT)
        assert advice is monitor.Advice.NONE
    assert abs(state.slip_left) < 0.05


def test_leaning_is_told_first() -> None:
    leaning = moving(1.0, 0.0, 0.0, tilt=(0.4, 0.45))
    assert monitor.tilt(leaning) == pytest.approx(np.arccos(np.cos(0.4) * np.cos(0.45)))
    _, advice = monitor.watch(monitor.MonitorState(), leaning, (0.0,) * 4, STOP, FOOTPRINT)
    assert advice is monitor.Advice.TILT


def test_no_progress_is_stuck_only_when_asked_to_move() -> None:
    state, asked = monitor.MonitorState(), Command(0.3, 0.0)
    told = []
    for tick in range(1, 200):
        command = asked if tick > 60 else STOP  # the wheels do not turn: a stalled drive shows no slip
        state, advice = monitor.watch(state, moving(tick / 20, 0.0, 0.0), (0.0,) * 4, command, FOOTPRINT)
        told.append(advice)
    first = told.index(monitor.Advice.STUCK) / 20
    assert first == pytest.approx(3.0 + 6.0, abs=0.2)
    _, after = monitor.watch(monitor.resume(state), moving(10.0, 0.0, 0.0), (0.0,) * 4, asked, FOOTPRINT)
    assert after is monitor.Advice.NONE


@pytest.mark.parametrize(("turned_rad_s", "wanted"), [(0.02, True), (0.1, False)])
def test_a_turn_on_the_spot_in_vain_is_told_in_seconds(turned_rad_s: float, *, wanted: bool) -> None:
    state, told = monitor.MonitorState(), []
    for tick in range(1, 80):  # sliding along does not count
        estimate = replace(
            pose_at(0.004 * tick, 0.0, 1.0 + turned_rad_s * tick / 20, tick / 20), yaw_rate_rad_s=turned_rad_s
        )
        state, advice = monitor.watch(state, estimate, wheel_speeds(0.0, 0.4, FOOTPRINT), Command(0.0, 0.4), FOOTPRINT)
        told.append(advice)
    assert (monitor.Advice.VAIN_TURN in told) is wanted
    if wanted:
        assert told.index(monitor.Advice.VAIN_TURN) / 20 == pytest.approx(1.3, abs=0.2)
    after, advice = monitor.watch(state, pose_at(0.4, 0.0, 1.0, 4.1), (0.0,) * 4, Command(0.2, 0.4), FOOTPRINT)
    assert advice is monitor.Advice.NONE
    assert after.turn_asked_rad == 0.0


@pytest.mark.parametrize(("far_m", "wanted"), [(0.1, True), (0.6, False)])
def test_going_to_and_fro_at_one_place_is_told(far_m: float, *, wanted: bool) -> None:
    state, told = monitor.MonitorState(), []
    for tick in range(1, 400):
        x, yaw = far_m * np.sin(tick / 40), 0.4 * np.sin(tick / 30)  # never still for long, never far
        wheels = wheel_speeds(0.3, 0.0, FOOTPRINT)
        estimate = replace(pose_at(x, 0.0, yaw, tick / 20), velocity_w=np.array([0.25, 0.0, 0.0]))
        state, advice = monitor.watch(state, estimate, wheels, Command(0.3, 0.1), FOOTPRINT)
        told.append(advice)
    assert (monitor.Advice.TREADING in told) is wanted
    if wanted:
        assert told.index(monitor.Advice.TREADING) / 20 * 0.3 == pytest.approx(2.5, abs=0.1)
