"""All sensors of one rover that an autopilot estimates by, each with its own random numbers and at its own rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rover_sim.sim import barometer, gnss, imu, magnetometer
from rover_sim.sim.faults import gnss_offset_w, sensor_lost
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensed import GnssSample, Sensed
from rover_sim.sim.ticker import Ticker
from worlds.fault_events import Event
from worlds.sensor_tables import Barometer, Gnss, Imu, Magnetometer
from worlds.types import World

_FIRST_STREAM = 201  # of the seed


class SensorSuite:
    """Feeds an estimator: `read` once a step of the physics, or as often as the estimator wants inertial samples.

    A table that the scenario leaves out has the defaults of `worlds.sensor_tables`; a sensor that a fault event
    silences gives nothing. The same seed gives the same samples.
    """

    def __init__(self, world: World) -> None:
        scenario, origin = world.scenario, world.origin
        streams = range(_FIRST_STREAM, _FIRST_STREAM + 4)
        self._streams = [np.random.default_rng([world.seed, number]) for number in streams]
        imu_rng, field_rng, pressure_rng, gnss_rng = self._streams
        self._altitude_m = origin.altitude_m + float(world.start.position_w[2])
        self._imu = imu.imu_model(scenario.imu or Imu(), scenario.terrain.texture)
        self._imu_state = imu.begin(self._imu, imu_rng)
        field = scenario.magnetometer or Magnetometer()
        self._field = magnetometer.magnetometer_model(field, origin, field_rng)
        self._barometer = scenario.barometer or Barometer()
        self._pressure = barometer.begin(self._barometer, 0.0, pressure_rng)
        self._gnss = scenario.gnss or Gnss()
        self._receiver = gnss.begin(self._gnss, 0.0, gnss_rng) if scenario.sensors.gnss else None
        self._field_due, self._pressure_due = Ticker(field.rate_hz), Ticker(self._barometer.rate_hz)
        self._fix_due = Ticker(self._gnss.rate_hz)
        self._events = scenario.event
        self._last: Sensed | None = None

    def read(self, truth: NedState) -> Sensed:
        """What is new now; a second call at the same time repeats the first."""
        if self._last is not None and truth.time_s <= self._last.time_s:
            return self._last
        imu_rng, field_rng, pressure_rng, _ = self._streams
        self._imu_state, inertial = imu.read(self._imu, self._imu_state, truth, imu_rng)
        field = magnetometer.read(self._field, truth, field_rng) if self._field_due.due(truth.time_s) else None
        pressure = None
        if self._pressure_due.due(truth.time_s):
            self._pressure, pressure = barometer.read(
                self._barometer, self._pressure, truth, self._altitude_m, pressure_rng
            )
        told = Sensed(truth.time_s, inertial, field, pressure, self._fix(truth))
        self._last = _with_losses(told, self._events) if self._events else told
        return self._last

    def _fix(self, truth: NedState) -> GnssSample | None:
        if self._receiver is None:
            return None
        if self._fix_due.due(truth.time_s):
            east, north, up = gnss_offset_w(self._events, truth.time_s)
            jump = (north, east, -up)
            self._receiver = gnss.measure(self._gnss, self._receiver, truth, self._streams[3], jump)
        self._receiver, sample = gnss.report(self._gnss, self._receiver, truth.time_s)
        return sample


def _with_losses(told: Sensed, events: Sequence[Event]) -> Sensed:
    """What is left while faults silence sensors."""
    return replace(
        told,
        imu=None if sensor_lost(events, "imu", told.time_s) else told.imu,
        magnetometer=None if sensor_lost(events, "magnetometer", told.time_s) else told.magnetometer,
        barometer=None if sensor_lost(events, "barometer", told.time_s) else told.barometer,
        gnss=None if sensor_lost(events, "gnss", told.time_s) else told.gnss,
    )
