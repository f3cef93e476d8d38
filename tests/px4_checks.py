"""What PX4 would believe of a simulator's messages, and everything about them that is wrong.

After ``SimulatorMavlink.cpp``, and stricter: what PX4 would quietly ignore, misread or let its estimator choke on is
an error here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rover_sim.mavlink.dialect import Message
from worlds.types import FloatArray

STEP_USEC = 4000
GNSS_USEC = 200_000
ACCELEROMETER, GYROSCOPE, MAGNETOMETER, DIFFERENCE, BAROMETER = 0b111, 0b111000, 0b111000000, 1 << 10, 0b1101000000000
ARC_M = math.radians(1.0) * 6_371_000.0 / 1e7  # of 1e-7 degrees of latitude
YEAR_2015_USEC = 1_420_070_400 * 1_000_000


class ViolationError(AssertionError):
    """The simulator did what PX4 would not stand, or would silently take wrong."""


def require(fine: bool, text: str) -> None:
    if not fine:
        raise ViolationError(text)


def standard_altitude(pressure_hPa: float) -> float:
    """Height (m) of a pressure in the standard atmosphere, up to 11 km."""
    return float(44330.77 * (1.0 - (pressure_hPa / 1013.25) ** 0.190263))


def body_to_ned(quaternion: tuple[float, ...]) -> FloatArray:
    """Rotation matrix of a quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@dataclass
class Believed:
    """What PX4 has been told, and when (its own clock, microseconds)."""

    clock_usec: int = 0
    sensors: int = 0
    acceleration: FloatArray = field(default_factory=lambda: np.zeros(3))
    rate: FloatArray = field(default_factory=lambda: np.zeros(3))
    field_gauss: FloatArray | None = None
    field_usec: int = 0
    pressure_hPa: float | None = None
    altitude_m: float = 0.0
    pressure_usec: int = 0
    fix: Message | None = None
    fix_usec: int = 0
    fixes: int = 0
    truth: Message | None = None
    truth_usec: int = 0
    truths: int = 0
    unix_usec: int = 0


class Checks:
    """Takes the simulator's messages one by one; raises ViolationError for the first that is wrong."""

    def __init__(self, *, truth_usec: int = 5000, gnss: bool = True, at_rest: bool = True) -> None:
        """``truth_usec``: interval of HIL_STATE_QUATERNION that is asked for; ``gnss``: whether fixes must come.

        ``at_rest``: whether the rover stands still, upright, when this PX4 starts.
        """
        self.believed = Believed()
        self.truth_asked = False
        self._truth_usec, self._gnss, self._rest_usec = truth_usec, gnss, 400_000 if at_rest else 0
        self._first_usec = 0
        self._takers: dict[str, Callable[[Message], None]] = {
            "HIL_SENSOR": self._sensor,
            "HIL_GPS": self._fix,
            "HIL_STATE_QUATERNION": self._truth,
            "SYSTEM_TIME": self._system_time,
        }

    @property
    def elapsed_usec(self) -> int:
        """Since the first step."""
        return self.believed.clock_usec - self._first_usec

    def on_board(self) -> None:
        """The receiver of a board: it wants heartbeats, and takes HIL_STATE_QUATERNION for its own estimate."""
        del self._takers["HIL_STATE_QUATERNION"]
        self._takers["HEARTBEAT"] = lambda _: None

    def take(self, message: Message) -> None:
        """One message of the simulator."""
        kind = message.get_type()
        require(kind in self._takers, f"{kind}: not for PX4")
        for name in message.get_fieldnames():
            value = getattr(message, name)
            if not all(map(math.isfinite, value if isinstance(value, list) else [value])):
                raise ViolationError(f"{kind}.{name} = {value}")
        self._takers[kind](message)

    def _sensor(self, message: Message) -> None:
        believed, updated = self.believed, message.fields_updated
        require(message.id == 0, "HIL_SENSOR.id: only 0 moves the clock")
        if believed.sensors == 0:
            require(message.time_usec > 0, "HIL_SENSOR.time_usec: 0 is no time")
            self._first_usec = message.time_usec
            for name in ("field_usec", "pressure_usec", "fix_usec", "truth_usec"):
                setattr(believed, name, message.time_usec)
        else:
            step = message.time_usec - believed.clock_usec
            require(step == STEP_USEC, f"HIL_SENSOR.time_usec: a step of {step} us, wanted {STEP_USEC}")
        believed.clock_usec, believed.sensors = message.time_usec, believed.sensors + 1
        known = ACCELEROMETER | GYROSCOPE | MAGNETOMETER | BAROMETER
        require(updated & ~known == 0, f"HIL_SENSOR.fields_updated = {updated:#x}: more than a rover has")
        for group in (ACCELEROMETER, GYROSCOPE, MAGNETOMETER, BAROMETER):
            require(updated & group in (0, group), f"HIL_SENSOR.fields_updated = {updated:#x}: half a group")
        require(updated & ACCELEROMETER != 0 and updated & GYROSCOPE != 0, "HIL_SENSOR without inertial unit")
        self._inertial(message)
        if updated & MAGNETOMETER:
            self._magnetic(message)
        if updated & BAROMETER:
            self._pressure(message)
        self._check_silence()

    def _inertial(self, message: Message) -> None:
        believed = self.believed
        believed.acceleration = np.array([message.xacc, message.yacc, message.zacc])
        believed.rate = np.array([message.xgyro, message.ygyro, message.zgyro])
        most, fastest = float(np.abs(believed.acceleration).max()), float(np.abs(believed.rate).max())
        require(most < 16.0 * 9.80665, f"acceleration of {most:g} m/s2")
        require(fastest < math.radians(2000.0), f"rate of {fastest:g} rad/s")
        if self.elapsed_usec < self._rest_usec:
            total = float(np.linalg.norm(believed.acceleration))
            require(abs(total - 9.80665) < 1.0, f"at rest it feels {total:.2f} m/s2 instead of 9.81")
            require(believed.acceleration[2] < -8.0, f"at rest zacc = {believed.acceleration[2]:.2f}: z is down")

    def _magnetic(self, message: Message) -> None:
        believed = self.believed
        believed.field_gauss = np.array([message.xmag, message.ymag, message.zmag])
        believed.field_usec = believed.clock_usec
        strength = float(np.linalg.norm(believed.field_gauss))
        require(0.2 < strength < 0.7, f"magnetic field of {strength:g} gauss; on Earth 0.22 to 0.67")

    def _pressure(self, message: Message) -> None:
        believed = self.believed
        believed.pressure_hPa, believed.pressure_usec = message.abs_pressure, believed.clock_usec
        believed.altitude_m = message.pressure_alt
        require(300.0 < message.abs_pressure < 1100.0, f"pressure {message.abs_pressure:g}: hPa are wanted")
        height = standard_altitude(message.abs_pressure)
        require(abs(height - message.pressure_alt) < 1.0, f"pressure_alt {message.pressure_alt:g}, not {height:.1f} m")
        require(-60.0 < message.temperature < 85.0, f"temperature {message.temperature:g} C")

    def _fix(self, message: Message) -> None:
        believed = self.believed
        require(message.time_usec > YEAR_2015_USEC, "HIL_GPS.time_usec: PX4 takes it for UTC")
        require(believed.fix is None or message.time_usec > believed.fix.time_usec, "HIL_GPS.time_usec does not rise")
        require(message.id == 0, "HIL_GPS.id: one receiver only")
        if believed.fixes > 1:
            gap = believed.clock_usec - believed.fix_usec
            require(abs(gap - GNSS_USEC) <= STEP_USEC, f"HIL_GPS after {gap} us, wanted {GNSS_USEC}")
        believed.fix, believed.fix_usec, believed.fixes = message, believed.clock_usec, believed.fixes + 1
        if message.fix_type >= 3:
            self._check_fix(message)

    def _check_fix(self, fix: Message) -> None:
        require((fix.lat, fix.lon) != (0, 0), "HIL_GPS at 0, 0")
        require(fix.eph < 300 and fix.epv < 500, f"eph {fix.eph}, epv {fix.epv}: the estimator wants 3 and 5 m")
        require(fix.satellites_visible >= 6, f"{fix.satellites_visible} satellites: the estimator wants 6")
        speed = math.hypot(fix.vn, fix.ve)
        require(abs(speed - fix.vel) <= 1.5, f"HIL_GPS.vel = {fix.vel}, of vn and ve {speed:.1f}")
        if fix.cog != 65535:
            require(0 <= fix.cog < 36000, f"HIL_GPS.cog = {fix.cog}")
            course = math.degrees(math.atan2(fix.ve, fix.vn)) * 100.0
            off = (fix.cog - course + 18000.0) % 36000.0 - 18000.0
            require(abs(off) < 600.0 or speed < 10.0, f"HIL_GPS.cog = {fix.cog}, of vn and ve {course:.0f}")
        truth = self.believed.truth
        if truth is not None:
            north = (fix.lat - truth.lat) * ARC_M
            east = (fix.lon - truth.lon) * ARC_M * math.cos(math.radians(truth.lat / 1e7))
            require(math.hypot(north, east) < 5.0, f"the fix is {north:.1f}, {east:.1f} m from the truth")
            require(abs(fix.alt - truth.alt) < 10_000, f"the fix is {(fix.alt - truth.alt) / 1e3:.1f} m too high")
            require(abs(fix.vd - truth.vz) < 60, f"vd = {fix.vd} cm/s, truly {truth.vz}")

    def _truth(self, message: Message) -> None:
        believed = self.believed
        require(self.truth_asked, "HIL_STATE_QUATERNION that nobody asked for")
        length = math.hypot(*message.attitude_quaternion)
        require(abs(length - 1.0) < 1e-3, f"attitude_quaternion of length {length:g}")
        believed.truth, believed.truth_usec, believed.truths = message, believed.clock_usec, believed.truths + 1
        rotation = body_to_ned(tuple(message.attitude_quaternion))
        if believed.sensors and self.elapsed_usec < self._rest_usec:
            north, east, down = (rotation @ believed.acceleration).tolist()
            felt = f"{north:.2f}, {east:.2f}, {down:.2f} m/s2 north-east-down"
            require(math.hypot(north, east) < 1.5 and down < -8.0, f"at rest it feels {felt}")
        if believed.field_gauss is not None:
            north, east, _ = rotation @ believed.field_gauss
            off = math.degrees(math.atan2(east, north))
            require(abs(off) < 40.0, f"magnetic north {off:.0f} deg from true north")

    def _system_time(self, message: Message) -> None:
        believed = self.believed
        require(message.time_unix_usec > max(YEAR_2015_USEC, believed.unix_usec), "SYSTEM_TIME does not rise")
        believed.unix_usec = message.time_unix_usec

    def _check_silence(self) -> None:
        """Sensors that stay out for longer than PX4 waits before it calls them lost."""
        believed = self.believed
        for name, last, longest in (
            ("magnetometer", believed.field_usec, 100_000),
            ("barometer", believed.pressure_usec, 100_000),
        ):
            silent = believed.clock_usec - last
            require(silent <= longest, f"no {name} for {silent} us")
        if self._gnss:
            silent = believed.clock_usec - believed.fix_usec
            require(silent <= 2 * GNSS_USEC, f"no HIL_GPS for {silent} us")
        if self.truth_asked:
            silent = believed.clock_usec - believed.truth_usec
            require(silent <= self._truth_usec + 2 * STEP_USEC, f"no HIL_STATE_QUATERNION for {silent} us")
