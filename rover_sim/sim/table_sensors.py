"""Sensors of a scenario's tables for the built-in autopilot: east-north-up, body axes forward-left-up."""

from __future__ import annotations

from math import atan2, pi

import numpy as np

from rover_sim.sim import gnss, imu, magnetometer
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensed import FixType
from rover_sim.sim.ticker import Ticker
from worlds.geometry import quaternion_from_rotation, wrap_angle
from worlds.types import FloatArray, GnssReading, Vector3, World

_TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from east-north-up
_TO_FRD = np.array([1.0, -1.0, -1.0])  # from forward-left-up
_NOWHERE: Vector3 = (0.0, 0.0, 0.0)
_NORTH = (1.0, 0.0, 0.0, 0.0)


class TableSensors:
    """What each table makes of the truth; one that the scenario leaves out gives None."""

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        scenario = world.scenario
        self._imu_rng, self._field_rng, self._gnss_rng = rng.spawn(3)
        self._imu = None if scenario.imu is None else imu.imu_model(scenario.imu, scenario.terrain.texture)
        self._imu_state = None if self._imu is None else imu.begin(self._imu, self._imu_rng)
        field = scenario.magnetometer
        self._field = None if field is None else magnetometer.magnetometer_model(field, world.origin, self._field_rng)
        self.gnss = scenario.gnss
        self._receiver = None if self.gnss is None else gnss.begin(self.gnss, 0.0, self._gnss_rng)
        self._due = None if self.gnss is None else Ticker(self.gnss.rate_hz)

    def inertial(
        self, time_s: float, felt_b: Vector3, rate_b: Vector3, velocity_w: Vector3
    ) -> tuple[Vector3, Vector3] | None:
        """Specific force and rate as the unit reads them."""
        if self._imu is None or self._imu_state is None:
            return None
        truth = NedState(time_s, _NOWHERE, velocity_w, _NORTH, _turned_over(rate_b), _turned_over(felt_b))
        self._imu_state, sample = imu.read(self._imu, self._imu_state, truth, self._imu_rng)
        return _turned_over(sample.specific_force_m_s2), _turned_over(sample.rate_rad_s)

    def heading(self, rotation: FloatArray) -> float | None:
        """Heading (rad) of a compass that knows how it leans, and the declination of its place."""
        if self._field is None:
            return None
        x, y, z, w = quaternion_from_rotation(_TO_NED @ rotation * _TO_FRD).tolist()
        sample = magnetometer.read(
            self._field, NedState(0.0, _NOWHERE, _NOWHERE, (w, x, y, z), _NOWHERE, _NOWHERE), self._field_rng
        )
        yaw = atan2(rotation[1, 0], rotation[0, 0])
        level = (
            np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]) @ rotation
        )
        ahead, left, _ = (level @ (_TO_FRD * sample.field_uT)).tolist()
        north, east, _ = self._field.field_uT.tolist()
        return wrap_angle(pi / 2.0 - atan2(east, north) - atan2(left, ahead))

    def fix(self, time_s: float, position_w: FloatArray, velocity_w: FloatArray) -> GnssReading | None:
        """What the receiver reports at this time, if it does."""
        if self.gnss is None or self._receiver is None or self._due is None:
            return None
        if self._due.due(time_s):
            place, speed = _vector(_TO_NED @ position_w), _vector(_TO_NED @ velocity_w)
            truth = NedState(time_s, place, speed, _NORTH, _NOWHERE, _NOWHERE)
            self._receiver = gnss.measure(self.gnss, self._receiver, truth, self._gnss_rng)
        self._receiver, sample = gnss.report(self.gnss, self._receiver, time_s)
        if sample is None or sample.fix is FixType.NONE:
            return None
        north, east, down = sample.position_m
        place, speed = (east, north, -down), sample.velocity_m_s
        return GnssReading(place, (speed[1], speed[0], -speed[2]), sample.horizontal_sd_m)


def _turned_over(vector: Vector3) -> Vector3:
    """From forward-left-up to forward-right-down, or back."""
    x, y, z = vector
    return x, -y, -z


def _vector(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return x, y, z
