from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner import localization as loc
from planner.mobility import wheel_speeds
from tests.planner_factory import FOOTPRINT
from worlds.geometry import euler_from_quaternion, quaternion_from_euler, rotation_from_quaternion, wrap_angle
from worlds.types import FloatArray, GnssReading, ImuReading, SensorReadings

G = 3.71


def readings(
    time_s: float,
    truth: FloatArray,
    motion: tuple[float, float],
    rng: np.random.Generator,
    *,
    slip: float = 0.1,
    gnss: bool = True,
    tilt: tuple[float, float] = (0.0, 0.0),
) -> SensorReadings:
    """Noisy sensors of a rover at ``truth`` (x, y, yaw) that moves by ``motion`` (v, omega) with a gyro bias."""
    rotation = rotation_from_quaternion(quaternion_from_euler(*tilt, truth[2]))
    force = rotation.T @ np.array([0.0, 0.0, G]) + np.array([0.0, motion[0] * motion[1], 0.0])
    force = force + rng.normal(0, 0.05, 3)
    rate = rotation.T @ np.array([0.0, 0.0, motion[1]]) + rng.normal(0, 0.005, 3) + np.array([0, 0, 0.01])
    imu = ImuReading(
        (float(force[0]), float(force[1]), float(force[2])),
        (float(rate[0]), float(rate[1]), float(rate[2])),
        wrap_angle(truth[2] + rng.normal(0, 0.03)),
    )
    fix = None
    if gnss:
        x, y, z = np.array([truth[0], truth[1], 0.2]) + rng.normal(0, 0.05, 3)
        velocity = motion[0] * rotation[:, 0] + rng.normal(0, 0.03, 3)
        fix = GnssReading((x, y, z), (velocity[0], velocity[1], velocity[2]), 0.05)
    return SensorReadings(time_s, imu, wheel_speeds(motion[0] / (1 - slip), motion[1], FOOTPRINT), fix)


def traverse(
    seconds: float, *, gnss: bool, slip: float = 0.1, seed: int = 1
) -> tuple[loc.LocalizationState, FloatArray]:
    """Drive a slow S for a while: the final belief and the truth (x, y, yaw)."""
    rng = np.random.default_rng(seed)
    truth = np.zeros(3)
    state = loc.start(readings(0.0, truth, (0.0, 0.0), rng), (0.0, 0.0, 0.2))
    for tick in range(1, int(seconds * 40) + 1):
        motion = (0.5, 0.2 * np.sin(tick / 200.0))
        truth = truth + 0.025 * np.array([motion[0] * np.cos(truth[2]), motion[0] * np.sin(truth[2]), motion[1]])
        fix = gnss and tick % 8 == 0
        state = loc.localize(state, readings(tick / 40, truth, motion, rng, slip=slip, gnss=fix), FOOTPRINT)
    return state, truth


@pytest.mark.parametrize("slip", [0.0, 0.1, 0.35])
def test_with_gnss_the_pose_is_known_to_centimetres_at_any_slip(slip: float) -> None:
    state, truth = traverse(40.0, gnss=True, slip=slip)
    believed = loc.estimate(state)
    assert np.linalg.norm(believed.pose.position_w[:2] - truth[:2]) < 0.08
    assert abs(wrap_angle(euler_from_quaternion(believed.pose.quaternion_w)[2] - truth[2])) < np.deg2rad(1.5)
    assert believed.velocity_w[:2] == pytest.approx([0.5 * np.cos(truth[2]), 0.5 * np.sin(truth[2])], abs=0.05)
    assert 0.01 < believed.position_sd_m < 0.08


def test_dead_reckoning_knows_how_wrong_it_may_be() -> None:
    state, truth = traverse(40.0, gnss=False)
    believed = loc.estimate(state)
    error = float(np.linalg.norm(believed.pose.position_w[:2] - truth[:2]))
    assert error < 3.0 * believed.position_sd_m
    assert 0.2 < believed.position_sd_m < 3.0
    earlier = loc.estimate(traverse(10.0, gnss=False)[0])
    assert believed.position_sd_m > earlier.position_sd_m


def test_errors_stay_inside_three_sigma_for_many_seeds() -> None:
    inside = 0
    for seed in range(10):
        state, truth = traverse(8.0, gnss=True, seed=seed)
        believed = loc.estimate(state)
        inside += bool(np.linalg.norm(believed.pose.position_w[:2] - truth[:2]) < 3.0 * believed.position_sd_m)
    assert inside >= 9


def test_the_tilt_of_a_parked_rover_is_found() -> None:
    rng = np.random.default_rng(0)
    still = [readings(t / 40, np.zeros(3), (0.0, 0.0), rng, tilt=(0.1, -0.2)) for t in range(400)]
    state = loc.start(still[0], (0.0, 0.0, 0.2))
    for reading in still[1:]:
        state = loc.localize(state, reading, FOOTPRINT)
    assert state.roll_rad == pytest.approx(0.1, abs=0.02)
    assert state.pitch_rad == pytest.approx(-0.2, abs=0.02)


def test_a_bump_hardly_turns_the_ground_plane() -> None:
    state, _ = traverse(5.0, gnss=True)
    rng = np.random.default_rng(2)
    bumped = replace(state, roll_rad=0.1)  # a wheel on a stone
    after = loc.localize(bumped, readings(state.time_s + 0.05, state.mean[[0, 1, 3]], (0.5, 0.0), rng), FOOTPRINT)
    plane = loc.ground_plane(after, 0.2)
    assert np.arccos(plane.normal_w[2]) < 0.02
    assert abs(after.roll_rad) > 0.08
    np.testing.assert_allclose(plane.point_w[:2], after.mean[:2], atol=0.01)
    assert plane.point_w[2] == pytest.approx(after.mean[2] - 0.2, abs=0.01)


def test_a_known_ramp_becomes_the_plane_after_some_metres() -> None:
    rng = np.random.default_rng(3)
    truth, pitch = np.zeros(3), -0.15  # uphill
    state = loc.start(readings(0.0, truth, (0.0, 0.0), rng), (0.0, 0.0, 0.2))
    for tick in range(1, 1200):
        truth = truth + np.array([0.0125, 0.0, 0.0])
        state = loc.localize(
            state, readings(tick / 40, truth, (0.5, 0.0), rng, tilt=(0.0, pitch), gnss=False), FOOTPRINT
        )
    normal = loc.ground_plane(state, 0.2).normal_w
    assert np.arctan2(-normal[0], normal[2]) == pytest.approx(-pitch, abs=0.03)


def test_old_readings_change_nothing() -> None:
    state, truth = traverse(1.0, gnss=True)
    old = readings(0.5, truth, (0.5, 0.0), np.random.default_rng(0))
    assert loc.localize(state, old, FOOTPRINT) is state


@pytest.mark.parametrize("spin", [0.0, 0.3])
def test_a_slide_down_the_slope_is_followed(spin: float) -> None:
    # As a Husky slides on 10 degrees of sand while it turns on the spot and while it drives across.
    rng, tilt = np.random.default_rng(4), (0.17, 0.0)
    speed, slide = (0.0, np.array([0.0, -0.09])) if spin else (0.4, np.array([0.0, -0.07]))
    truth = np.zeros(3)
    state = loc.start(readings(0.0, truth, (0.0, 0.0), rng, tilt=tilt), (0.0, 0.0, 0.2))
    errors = []
    for tick in range(1, 480):
        truth = truth + 0.025 * np.array(
            [speed * np.cos(truth[2]) + slide[0], speed * np.sin(truth[2]) + slide[1], spin]
        )
        reading = readings(tick / 40, truth, (speed, spin), rng, gnss=tick % 8 == 0, tilt=tilt)
        if reading.gnss is not None:
            east, north, up = reading.gnss.velocity_w
            moving = (east + slide[0], north + slide[1], up)
            reading = replace(reading, gnss=replace(reading.gnss, velocity_w=moving))
        state = loc.localize(state, reading, FOOTPRINT)
        errors.append(np.linalg.norm(state.mean[:2] - truth[:2]))
    assert max(errors) < 0.15
    assert np.mean(errors[200:]) < 0.05
    assert loc.estimate(state).velocity_w[:2] == pytest.approx([speed + slide[0], slide[1]], abs=0.04)
