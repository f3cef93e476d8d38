"""The rover's own sensors with seeded noise: inertial unit, compass, satellite receiver, wheel encoders.

Noise figures are of the class of hardware named beside them; they are ours, not of one data sheet. A table of the
scenario (`worlds.sensor_tables`) puts a sensor of its own in the place of the one here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan2, floor, radians, tau

import numpy as np

from rover_sim.sim.faults import gnss_offset_w, sensor_lost
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.table_sensors import TableSensors
from worlds.fault_events import Event, LosableSensor
from worlds.geometry import cross, rotation_from_quaternion, wrap_angle
from worlds.types import BatteryReading, FloatArray, GnssReading, ImuReading, SensorReadings, Vector3, World

_ACCELERATION_BIAS_SD = 0.02  # m/s^2, calibrated MEMS
_ACCELERATION_NOISE_SD = 0.03
_RATE_BIAS_SD = 0.0005  # rad/s
_RATE_NOISE_SD = 0.002
_HEADING_BIAS_SD = radians(0.5)  # calibrated compass or dual antenna
_HEADING_NOISE_SD = radians(0.5)
_GNSS_PERIOD_S = 0.2
_GNSS_HORIZONTAL_SD_M = 0.02  # real-time kinematic fix
_GNSS_VERTICAL_SD_M = 0.03
_GNSS_VELOCITY_SD = 0.02  # m/s
_COUNTS_PER_TURN = 16384


class Sensors:
    """Sensor models of one rover; all randomness comes from ``rng``."""

    def __init__(self, world: World, rover: RoverModel, rng: np.random.Generator) -> None:
        scenario = world.scenario
        self._tables, self._turn = TableSensors(world, rng), _COUNTS_PER_TURN
        if scenario.encoder is not None:
            self._turn = scenario.encoder.counts_per_turn
        self._gnss, self._gravity, self._rng = scenario.sensors.gnss, scenario.gravity_m_s2, rng
        self._events = scenario.event
        self._centre_b = np.array(rover.chassis.centre_of_mass_m)
        self._acceleration_bias = rng.normal(0.0, _ACCELERATION_BIAS_SD, 3).tolist()
        self._rate_bias = rng.normal(0.0, _RATE_BIAS_SD, 3).tolist()
        self._heading_bias = float(rng.normal(0.0, _HEADING_BIAS_SD))
        self._last: SensorReadings | None = None

    def start(self, raw: FloatArray, wheel_angles_rad: Sequence[float]) -> None:
        """Begin at time zero with the rover at rest; ``raw`` as in `soil_kernels.ground_forces`."""
        self._time_s, self._velocity = 0.0, raw[7:10].tolist()
        self._counts = self._count(wheel_angles_rad)
        self._next_fix = 0
        self._last = None

    def read(
        self, time_s: float, raw: FloatArray, wheel_angles_rad: Sequence[float], battery: BatteryReading
    ) -> SensorReadings:
        """Readings now; a second call at the same time repeats them."""
        if self._last is not None and time_s <= self._last.time_s:
            return self._last
        span = time_s - self._time_s
        rotation = rotation_from_quaternion(raw[3:7])
        imu = self._imu(time_s, rotation, raw[7:13].tolist(), span)
        speeds = self._wheel_speeds(wheel_angles_rad, span)
        self._time_s, self._velocity = time_s, raw[7:10].tolist()
        sound = SensorReadings(time_s, imu, speeds, self._fix(time_s, rotation, raw), battery)
        self._last = with_faults(sound, self._events) if self._events else sound
        return self._last

    def _imu(self, time_s: float, rotation: FloatArray, motion: list[float], span: float) -> ImuReading:
        """Readings for a motion (6,) of velocity and rate in the world; plain numbers, as NumPy's calls are slower."""
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
        noise = self._rng.standard_normal(7).tolist()
        x, y, z = ((now - old) / span if span > 0.0 else 0.0 for now, old in zip(motion, self._velocity, strict=False))
        z += self._gravity
        felt = (xx * x + yx * y + zx * z, xy * x + yy * y + zy * z, xz * x + yz * y + zz * z)
        x, y, z = motion[3:]
        turned = (xx * x + yx * y + zx * z, xy * x + yy * y + zy * z, xz * x + yz * y + zz * z)
        heading = self._tables.heading(rotation)
        if heading is None:
            heading = wrap_angle(atan2(yx, xx) + self._heading_bias + _HEADING_NOISE_SD * noise[6])
        tabled = self._tables.inertial(time_s, felt, turned, (motion[0], motion[1], motion[2]))
        if tabled is not None:
            return ImuReading(*tabled, heading)
        return ImuReading(
            _noisy(felt, self._acceleration_bias, _ACCELERATION_NOISE_SD, noise[:3]),
            _noisy(turned, self._rate_bias, _RATE_NOISE_SD, noise[3:6]),
            heading,
        )

    def _wheel_speeds(self, angles_rad: Sequence[float], span: float) -> tuple[float, ...]:
        """Mean speed of each wheel since the last reading, from whole encoder counts."""
        counts = self._count(angles_rad)
        moved = [now - before for now, before in zip(counts, self._counts, strict=True)]
        self._counts = counts
        return tuple(count * tau / self._turn / span if span > 0.0 else 0.0 for count in moved)

    def _count(self, angles_rad: Sequence[float]) -> list[int]:
        return [floor(angle * self._turn / tau) for angle in angles_rad]

    def _fix(self, time_s: float, rotation: FloatArray, raw: FloatArray) -> GnssReading | None:
        if not self._gnss:
            return None
        if self._tables.gnss is not None:
            return self._tables.fix(time_s, *self._body(rotation, raw))
        if time_s + 1e-9 < self._next_fix * _GNSS_PERIOD_S:
            return None
        self._next_fix = floor(time_s / _GNSS_PERIOD_S + 1e-6) + 1
        spread = [_GNSS_HORIZONTAL_SD_M, _GNSS_HORIZONTAL_SD_M, _GNSS_VERTICAL_SD_M]
        position, velocity = self._body(rotation, raw)
        position = position + self._rng.normal(0.0, spread)
        velocity = velocity + self._rng.normal(0.0, _GNSS_VELOCITY_SD, 3)
        return GnssReading(_vector(position), _vector(velocity), _GNSS_HORIZONTAL_SD_M)

    def _body(self, rotation: FloatArray, raw: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Place and velocity (3,) of the body's origin."""
        offset = rotation @ self._centre_b
        return raw[:3] - offset, raw[7:10] - cross(raw[10:13], offset)


def with_faults(sound: SensorReadings, events: Sequence[Event]) -> SensorReadings:
    """The readings as the faults of their time leave them."""

    def lost(sensor: LosableSensor) -> bool:
        return sensor_lost(events, sensor, sound.time_s)

    imu, gnss, speeds = sound.imu, sound.gnss, sound.wheel_speed_rad_s
    if imu is not None and lost("magnetometer"):
        imu = replace(imu, heading_rad=None)
    if gnss is not None:
        x, y, z = np.add(gnss.position_w, gnss_offset_w(events, sound.time_s)).tolist()
        gnss = None if lost("gnss") else replace(gnss, position_w=(x, y, z))
    if lost("encoder"):  # its counter stands
        speeds = (0.0,) * len(speeds)
    return replace(sound, imu=None if lost("imu") else imu, gnss=gnss, wheel_speed_rad_s=speeds)


def _noisy(true: Vector3, bias: list[float], sd: float, noise: list[float]) -> Vector3:
    return true[0] + bias[0] + sd * noise[0], true[1] + bias[1] + sd * noise[1], true[2] + bias[2] + sd * noise[2]


def _vector(values: FloatArray) -> Vector3:
    return float(values[0]), float(values[1]), float(values[2])
