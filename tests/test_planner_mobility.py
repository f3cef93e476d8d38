from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import mobility
from tests.planner_factory import FOOTPRINT, drive, pose_at

LIMITS = mobility.Limits()


def follow(path: list[list[float]], yaw: float = 0.0, *, reverse: bool = False) -> tuple[np.ndarray, bool]:
    """Drive a path with a kinematic rover for at most two minutes: the track (N, 3) and whether it arrived."""
    state, progress, track = np.array([path[0][0], path[0][1], yaw]), mobility.Progress(), []
    for _ in range(2400):
        command, progress = mobility.follow_path(
            np.array(path), pose_at(*state), FOOTPRINT, LIMITS, progress, reverse=reverse
        )
        track.append(state)
        if progress.arrived:
            break
        state = drive(state, command, 0.05)
    return np.array(track), progress.arrived


def test_wheel_speeds_worked_by_hand() -> None:
    # 0.33 m/s on wheels of 0.165 m: 2 rad/s each.
    assert mobility.wheel_speeds(0.33, 0.0, FOOTPRINT) == pytest.approx((2.0, 2.0, 2.0, 2.0))
    # Effective track 1.6 * 0.57 = 0.912 m: 0.5 rad/s wants +-0.228 m/s, 1.38182 rad/s.
    assert mobility.wheel_speeds(0.0, 0.5, FOOTPRINT) == pytest.approx((-1.38182, -1.38182, 1.38182, 1.38182), rel=1e-5)


@given(st.floats(-3.0, 3.0), st.floats(-5.0, 5.0))
def test_no_wheel_is_ever_too_fast_and_the_curvature_stays(linear: float, rate: float) -> None:
    speeds = mobility.wheel_speeds(linear, rate, FOOTPRINT)
    assert max(abs(speed) for speed in speeds) * FOOTPRINT.wheel_radius_m <= FOOTPRINT.max_speed_m_s + 1e-9
    motion = mobility.body_motion(speeds, FOOTPRINT)
    assert motion.linear_m_s * rate == pytest.approx(motion.yaw_rate_rad_s * linear, abs=1e-6)


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=6),
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4)),
    st.floats(0.0, 1.0),
    st.booleans(),
)
def test_any_path_from_anywhere_stays_inside_the_limits(
    path: list[tuple[float, float]], place: tuple[float, float, float], risk: float, reverse: bool
) -> None:
    limits = mobility.Limits(risk=risk)
    command, progress = mobility.follow_path(
        np.array(path), pose_at(*place), FOOTPRINT, limits, mobility.Progress(), reverse=reverse
    )
    assert abs(command.linear_m_s) <= limits.cruise_speed_m_s * (1.0 - 0.6 * risk) + 1e-9
    assert abs(command.yaw_rate_rad_s) <= FOOTPRINT.max_yaw_rate_rad_s + 1e-9
    assert command.linear_m_s * (-1 if reverse else 1) >= 0.0
    assert not progress.arrived or command == mobility.STOP


def test_a_path_with_corners_is_kept_within_15_cm() -> None:
    path = [[0.0, 0.0], [2.0, 0.0], [3.5, 1.2], [6.0, 1.2]]
    track, arrived = follow(path)
    assert arrived
    assert np.linalg.norm(track[-1, :2] - path[-1]) < 0.3
    assert max(distance_to(path, point) for point in track[:, :2]) < 0.15


def distance_to(path: list[list[float]], point: np.ndarray) -> float:
    corners = np.array(path)
    steps = np.diff(corners, axis=0)
    along = np.clip(((point - corners[:-1]) * steps).sum(1) / (steps**2).sum(1), 0, 1)
    return float(np.min(np.linalg.norm(corners[:-1] + along[:, None] * steps - point, axis=1)))


@pytest.mark.parametrize("reverse", [False, True])
def test_a_path_across_a_slope_is_kept_by_pointing_uphill(*, reverse: bool) -> None:
    path, lead = np.array([[0.0, 0.0], [-6.0 if reverse else 6.0, 0.0]]), -1.0 if reverse else 1.0
    state, progress, velocity, off = np.zeros(3), mobility.Progress(), np.zeros(3), []
    while not progress.arrived:
        estimate = replace(pose_at(*state), velocity_w=velocity)
        command, progress = mobility.follow_path(path, estimate, FOOTPRINT, LIMITS, progress, reverse=reverse)
        before, state = state, drive(state, command, 0.05)
        state[1] -= 0.18 * abs(command.linear_m_s) * 0.05  # slides as on 10 degrees of sand
        velocity = np.array([*(state[:2] - before[:2]) / 0.05, 0.0])
        off.append(-state[1])
    assert max(off) < 0.08
    assert abs(np.mean(off[len(off) // 2 :])) < 0.03  # 0.13 without
    assert lead * state[2] == pytest.approx(np.arctan(0.18), abs=0.04)


@pytest.mark.parametrize("lead", [1.0, -1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bend_is_straightened_while_its_outer_wheels_spin(lead: float, side: float) -> None:
    bend = mobility.Command(0.25 * lead, 0.3 * side)
    inner_slips, outer_slips = ((0.9, 0.1), (0.1, 0.9)) if side * lead > 0 else ((0.1, 0.9), (0.9, 0.1))
    assert mobility.relieve(bend, inner_slips, spinning=False) == (bend, False)
    straight, spinning = mobility.relieve(bend, outer_slips, spinning=False)
    assert spinning
    assert straight == mobility.Command(lead * mobility.PUSH_M_S, 0.0)
    half = (0.45, 0.45)  # between the two limits what is goes on
    assert mobility.relieve(bend, half, spinning=False) == (bend, False)
    assert mobility.relieve(bend, half, spinning=True) == (straight, True)
    turn = mobility.Command(0.0, 0.3 * side)
    assert mobility.relieve(turn, outer_slips, spinning=True) == (turn, False)


def test_a_goal_behind_is_turned_to_on_the_spot() -> None:
    track, arrived = follow([[0.0, 0.0], [-3.0, 0.0]])
    assert arrived
    assert abs(track[:, 1]).max() < 0.35


def test_backing_goes_straight_to_the_rear() -> None:
    track, arrived = follow([[1.0, 1.0], [1.0, 0.2]], np.pi / 2, reverse=True)
    assert arrived
    assert track[-1, 2] == pytest.approx(np.pi / 2, abs=0.05)
    assert track[-1, 1] < 0.5


def test_a_path_that_meets_itself_is_driven_in_full() -> None:
    track, arrived = follow([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [1.0, 3.0], [1.0, -1.0]])
    assert arrived
    assert track[:, 1].max() > 2.5


@given(st.floats(-4, 4), st.floats(-4, 4))
@settings(max_examples=30)
def test_turning_reaches_any_heading(start: float, heading: float) -> None:
    state = np.array([0.0, 0.0, start])
    for _ in range(600):
        command, done = mobility.turn_to(heading, pose_at(*state), FOOTPRINT, LIMITS)
        if done:
            break
        state = drive(state, command, 0.05)
    assert done
    assert abs(np.angle(np.exp(1j * (state[2] - heading)))) < LIMITS.turn_end_rad


def test_acceleration_is_bounded() -> None:
    command = mobility.ramp(mobility.STOP, mobility.Command(0.6, -1.0), LIMITS, 0.1)
    assert command.linear_m_s == pytest.approx(0.05)
    assert command.yaw_rate_rad_s == pytest.approx(-0.1)
    assert mobility.ramp(command, command, LIMITS, 0.1) == command


def test_one_point_is_a_path_too() -> None:
    command, progress = mobility.follow_path(
        np.array([[1.0, 0.0]]), pose_at(0.0, 0.0, 0.0), FOOTPRINT, LIMITS, mobility.Progress()
    )
    assert command.linear_m_s > 0.0
    assert not progress.arrived
