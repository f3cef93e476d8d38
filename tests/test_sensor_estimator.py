"""Whether an estimator that assumes the stated figures finds them true: a strapdown filter of 15 errors, aided."""

from __future__ import annotations

from dataclasses import replace
from math import radians, sqrt

import msgspec
import numpy as np
import pytest

from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from rover_sim.sim.sensed import GnssSample, ImuSample
from rover_sim.sim.sensor_suite import SensorSuite
from tests.sim_factory import make_world, slope
from worlds.geometry import quaternion_from_rotation
from worlds.sensor_tables import Barometer, Gnss
from worlds.types import FloatArray

STEP_S, RATE = 0.02, 0.1
MICRO_G = 1e-6 * STANDARD_GRAVITY_M_S2
GRAVITY = np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])
TABLE = Gnss(delay_s=0.0, wander_m=0.0, horizontal_m=0.3, vertical_m=0.5, velocity_m_s=0.05)


def cross(vector: FloatArray) -> FloatArray:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def turn(vector: FloatArray) -> FloatArray:
    """Rotation matrix of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    k = cross(vector / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k)


def circling(time_s: float) -> NedState:
    """A rover that drives circles of 10 m over the plain at 1 m/s."""
    yaw = RATE * time_s
    s, c = float(np.sin(yaw)), float(np.cos(yaw))
    x, y, z, w = quaternion_from_rotation(turn(np.array([0.0, 0.0, yaw]))).tolist()
    place = s / RATE, (1.0 - c) / RATE, 0.0
    return NedState(time_s, place, (c, s, 0.0), (w, x, y, z), (0.0, 0.0, RATE), (0.0, RATE, -STANDARD_GRAVITY_M_S2))


class Strapdown:
    """Place, velocity, attitude and both biases by an error-state Kalman filter (Groves 2013, section 14.2)."""

    def __init__(self, truth: NedState) -> None:
        self.place, self.velocity = np.array(truth.position_m), np.array(truth.velocity_m_s)
        self.body, self.gyro_bias, self.accel_bias = np.eye(3), np.zeros(3), np.zeros(3)
        sd = [0.3] * 3 + [0.05] * 3 + [1e-3] * 3 + [radians(0.33)] * 3 + [6.7e3 * MICRO_G] * 3
        self.covariance = np.diag(np.square(sd))

    def predict(self, sample: ImuSample) -> None:
        rate = np.array(sample.rate_rad_s) - self.gyro_bias
        felt = self.body @ turn(0.5 * STEP_S * rate) @ (np.array(sample.specific_force_m_s2) - self.accel_bias)
        self.place = self.place + STEP_S * self.velocity + 0.5 * STEP_S**2 * (felt + GRAVITY)
        self.velocity = self.velocity + STEP_S * (felt + GRAVITY)
        moved = np.eye(15)
        moved[0:3, 3:6] = STEP_S * np.eye(3)
        moved[3:6, 6:9], moved[3:6, 12:15] = -STEP_S * cross(felt), -STEP_S * self.body
        moved[6:9, 9:12] = -STEP_S * self.body
        self.body = self.body @ turn(STEP_S * rate)
        noise = np.zeros(15)
        noise[3:6] = (175.0 * MICRO_G) ** 2 / 2 * STEP_S
        noise[6:9] = radians(0.014) ** 2 / 2 * STEP_S
        noise[9:12] = (radians(2.0 / 3600.0) / 60.0) ** 2 * STEP_S + 2 * STEP_S / 500.0 * radians(2.0 / 3600.0) ** 2
        noise[12:15] = (20.0 * MICRO_G / 60.0) ** 2 * STEP_S + 2 * STEP_S / 500.0 * (40.0 * MICRO_G) ** 2
        self.covariance = moved @ self.covariance @ moved.T + np.diag(noise)

    def correct(self, sample: GnssSample) -> tuple[FloatArray, FloatArray]:
        """Innovation (6,) of place and velocity, and what it was expected to be (6, 6)."""
        place = [sample.horizontal_sd_m, sample.horizontal_sd_m, sample.vertical_sd_m]
        noise = np.diag(np.square([*place, *[sample.velocity_sd_m_s] * 3]))
        innovation = np.concatenate([sample.position_m - self.place, sample.velocity_m_s - self.velocity])
        expected = self.covariance[:6, :6] + noise
        gain = np.linalg.solve(expected, self.covariance[:6]).T
        error = gain @ innovation
        self.place, self.velocity = self.place + error[0:3], self.velocity + error[3:6]
        self.body = turn(error[6:9]) @ self.body
        self.gyro_bias, self.accel_bias = self.gyro_bias + error[9:12], self.accel_bias + error[12:15]
        kept = np.eye(15)
        kept[:, :6] -= gain
        self.covariance = kept @ self.covariance @ kept.T + gain @ noise @ gain.T
        return innovation, expected


def drive(seed: int, table: Gnss, seconds: float = 120.0) -> tuple[FloatArray, FloatArray, Strapdown]:
    """Innovations (n, 6) in units of their expected spread, whitened; errors of place (n, 3); the filter at the end."""
    plain = make_world(slope(0.0))
    scenario = msgspec.structs.replace(plain.scenario, gnss=table, barometer=Barometer(rate_hz=1.0))
    suite = SensorSuite(replace(plain, scenario=scenario, seed=seed))
    belief, whitened, errors = Strapdown(circling(0.0)), [], []
    for step in range(int(seconds / STEP_S)):
        truth = circling(step * STEP_S)
        sensed = suite.read(truth)
        if sensed.gnss is not None:
            innovation, expected = belief.correct(sensed.gnss)
            whitened.append(np.linalg.solve(np.linalg.cholesky(expected), innovation))
            errors.append(belief.place - truth.position_m)
        assert sensed.imu is not None
        belief.predict(sensed.imu)
    return np.array(whitened), np.array(errors), belief


def test_innovations_are_as_large_as_the_stated_figures_say_and_independent() -> None:
    runs = [drive(seed, TABLE) for seed in range(4)]
    whitened = np.vstack([run[0] for run in runs])
    count = whitened.size
    # The sum of squares is chi-squared: its mean is 1, its standard error sqrt(2 / n).
    assert np.mean(whitened**2) == pytest.approx(1.0, abs=4 * sqrt(2 / count))
    assert np.abs(whitened.mean(axis=0)).max() < 4 / sqrt(len(whitened))
    lagged = np.mean([np.mean(run[0][1:] * run[0][:-1]) for run in runs])
    assert abs(lagged) < 4 / sqrt(count)


def test_errors_stay_within_what_the_filter_believes_and_biases_are_found() -> None:
    _, errors, belief = drive(7, TABLE)
    sd = np.sqrt(np.diag(belief.covariance))
    assert np.abs(errors[-1] / sd[:3]).max() < 3.5
    assert np.abs(errors[200:]).max() < 0.5
    assert sd[9] < 0.1 * radians(0.33)  # the turn-on bias of the gyroscope is known well by then


def test_a_filter_that_takes_slow_errors_for_white_ones_is_overconfident() -> None:
    slow = msgspec.structs.replace(TABLE, horizontal_m=0.03, vertical_m=0.05, wander_m=0.3, wander_time_s=30.0)
    whitened, errors, belief = drive(3, slow)
    lagged = np.mean(whitened[1:, :2] * whitened[:-1, :2])
    assert lagged > 4 / sqrt(whitened[:, :2].size)
    assert np.abs(errors[:, :2]).std() > 1.5 * sqrt(float(belief.covariance[0, 0]))
