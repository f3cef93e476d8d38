"""What the sensors of `sensor_suite` give: north-east-down from the start, body axes forward-right-down, SI units.

They are what an autopilot's own estimator is fed. A sensor that has nothing new at an instant gives None: between its
samples, and while a fault silences it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from worlds.types import Vector3


class FixType(IntEnum):
    """Kind of a satellite fix; the values are MAVLink's GPS_FIX_TYPE."""

    NONE = 1
    FIX_3D = 3
    DGPS = 4
    RTK_FLOAT = 5
    RTK_FIXED = 6


@dataclass(frozen=True)
class ImuSample:
    """One sample of gyroscope and accelerometer, body axes."""

    rate_rad_s: Vector3
    specific_force_m_s2: Vector3  # level and at rest (0, 0, -9.8)


@dataclass(frozen=True)
class FieldSample:
    """One sample of the magnetometer, body axes; 100 microtesla are one gauss."""

    field_uT: Vector3


@dataclass(frozen=True)
class PressureSample:
    """One sample of the barometer."""

    pressure_Pa: float
    altitude_m: float  # that of this pressure in the standard atmosphere
    temperature_C: float


@dataclass(frozen=True)
class GnssSample:
    """One report of the satellite receiver, given ``delay_s`` after ``time_s``.

    Without a fix (`FixType.NONE`) place and velocity are those reported last and must not be used.
    """

    time_s: float  # for which it holds
    fix: FixType
    satellites: int  # 0 without a fix
    position_m: Vector3  # north, east, down from where the rover stood at the start
    velocity_m_s: Vector3
    horizontal_sd_m: float  # one sigma an axis, as the receiver says
    vertical_sd_m: float
    velocity_sd_m_s: float


@dataclass(frozen=True)
class Sensed:
    """All that is new at one instant."""

    time_s: float
    imu: ImuSample | None
    magnetometer: FieldSample | None
    barometer: PressureSample | None
    gnss: GnssSample | None
