"""PX4's simulator interface as MAVLink messages: sensors and truth out, actuator controls in.

Fields and units as PX4 reads them (``src/modules/simulation/simulator_mavlink/SimulatorMavlink.cpp``); where that
differs from MAVLink's own description it is said beside the field.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from math import atan2, degrees, hypot, isfinite

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.geodesy import GeoPoint
from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from rover_sim.sim.sensed import FixType, GnssSample, ImuSample, Sensed
from worlds.types import Vector3

SYSTEM, COMPONENT = 1, 200  # that Gazebo speaks as; a board takes HIL_GPS from its own system only
STEP_USEC = 4000  # 250 Hz: the rate that PX4's control loops expect of its gyroscope
TIME_USEC = 1000 * STEP_USEC  # SYSTEM_TIME comes once in 1000 steps, as from jMAVSim
RIGHT_CHANNEL, LEFT_CHANNEL = 0, 1  # Motor 1 and Motor 2 of PX4's differential rovers (airframe 4009)
_GAUSS_UT = 100.0
_SLOWEST_COURSE_M_S = 0.05  # a slower rover has no course that a receiver could tell
_UNKNOWN = 65535


class Fields(IntFlag):
    """Groups of HIL_SENSOR.fields_updated; PX4 ignores a group that is not flagged whole."""

    ACCELEROMETER = 0b111
    GYROSCOPE = 0b111 << 3
    MAGNETOMETER = 0b111 << 6
    PRESSURE_DIFFERENCE = 1 << 10
    BAROMETER = 0b1101 << 9  # pressure, altitude and temperature


@dataclass(frozen=True)
class Controls:
    """One HIL_ACTUATOR_CONTROLS."""

    time_usec: int  # PX4's clock: the time of the last HIL_SENSOR that it has worked off
    values: tuple[float, ...]  # (16,) in [-1, 1]; 0 where PX4 sent no number
    armed: bool
    lockstep: bool

    @property
    def side_shares(self) -> tuple[float, float]:
        """Shares of full speed of the left and the right side; none while disarmed."""
        return (self.values[LEFT_CHANNEL], self.values[RIGHT_CHANNEL]) if self.armed else (0.0, 0.0)


def hil_sensor(time_usec: int, sensed: Sensed) -> Message:
    """HIL_SENSOR, with the groups flagged that are new; its time sets the clock of a PX4 in lockstep, so it must rise.

    The pressure of a pitot tube is never flagged: a rover has none.
    """
    imu, magnetometer, barometer = sensed.imu, sensed.magnetometer, sensed.barometer
    updated = Fields(0)
    inertial: tuple[float, ...] = (0.0,) * 6
    field, air = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if imu is not None:
        updated |= Fields.ACCELEROMETER | Fields.GYROSCOPE
        inertial = _inertial(imu)
    if magnetometer is not None:
        updated |= Fields.MAGNETOMETER
        field = _gauss(magnetometer.field_uT)
    if barometer is not None:
        updated |= Fields.BAROMETER
        air = (barometer.pressure_Pa / 100.0, barometer.altitude_m, barometer.temperature_C)  # hPa
    pressure, altitude, temperature = air
    numbers = (*inertial, *field, pressure, 0.0, altitude, temperature)
    return mavlink.MAVLink_hil_sensor_message(time_usec, *numbers, int(updated))


def hil_gps(unix_usec: int, fix: GnssSample, place: GeoPoint) -> Message:
    """HIL_GPS; PX4 takes its time for that since 1970, and eph and epv for centimetres."""
    if fix.fix is FixType.NONE:
        unknown = (0, 0, 0, _UNKNOWN, _UNKNOWN, _UNKNOWN, 0, 0, 0, _UNKNOWN)
        return mavlink.MAVLink_hil_gps_message(unix_usec, int(fix.fix), *unknown, 0)
    spread = (_uint16(100.0 * fix.horizontal_sd_m), _uint16(100.0 * fix.vertical_sd_m))
    return mavlink.MAVLink_hil_gps_message(
        unix_usec,
        int(fix.fix),
        *_integers(place),
        *spread,
        _uint16(100.0 * hypot(*fix.velocity_m_s[:2])),
        *_centimetres(fix.velocity_m_s),
        _course(fix.velocity_m_s),
        fix.satellites,
    )


def hil_state_quaternion(time_usec: int, truth: NedState, place: GeoPoint) -> Message:
    """HIL_STATE_QUATERNION: the truth, which PX4 only logs."""
    still_air = (_uint16(100.0 * hypot(*truth.velocity_m_s)),) * 2
    milli_g = (_int16(1000.0 * value / STANDARD_GRAVITY_M_S2) for value in truth.specific_force_m_s2)
    motion = (*_integers(place), *_centimetres(truth.velocity_m_s))
    return mavlink.MAVLink_hil_state_quaternion_message(
        time_usec, truth.quaternion, *truth.rate_rad_s, *motion, *still_air, *milli_g
    )


def system_time(unix_usec: int, time_usec: int) -> Message:
    """SYSTEM_TIME."""
    return mavlink.MAVLink_system_time_message(unix_usec, time_usec // 1000)


def heartbeat() -> Message:
    """HEARTBEAT of a simulator: what makes a board begin to talk on its USB port."""
    kind, no_autopilot = mavlink.MAV_TYPE_GENERIC, mavlink.MAV_AUTOPILOT_INVALID
    return mavlink.MAVLink_heartbeat_message(kind, no_autopilot, 0, 0, mavlink.MAV_STATE_UNINIT, 3)


def parse_controls(message: Message) -> Controls:
    """The controls in a HIL_ACTUATOR_CONTROLS; those beyond [-1, 1] are cut, and what is no number is 0."""
    values = tuple(min(max(value, -1.0), 1.0) if isfinite(value) else 0.0 for value in message.controls)
    armed = bool(message.mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    return Controls(int(message.time_usec), values, armed, bool(message.flags & 1))


def asked_interval(message: Message, known_usec: int) -> int:
    """Microseconds between two HIL_STATE_QUATERNION after a COMMAND_LONG, 0 for none; before it ``known_usec``."""
    wanted = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
    if message.command != mavlink.MAV_CMD_SET_MESSAGE_INTERVAL or message.param1 != wanted:
        return known_usec
    return max(0, round(message.param2)) if isfinite(message.param2) else known_usec


def due(time_usec: int, interval_usec: int, step_usec: int = STEP_USEC) -> bool:
    """Whether what comes every ``interval_usec`` comes in the step that ends now; at most once a step, 0: never."""
    return interval_usec > 0 and time_usec // interval_usec > (time_usec - step_usec) // interval_usec


def _inertial(imu: ImuSample) -> tuple[float, ...]:
    return (*imu.specific_force_m_s2, *imu.rate_rad_s)


def _gauss(field_uT: Vector3) -> Vector3:
    x, y, z = field_uT
    return x / _GAUSS_UT, y / _GAUSS_UT, z / _GAUSS_UT


def _integers(place: GeoPoint) -> tuple[int, int, int]:
    return place.latitude_e7, place.longitude_e7, place.altitude_mm


def _centimetres(velocity_m_s: Vector3) -> tuple[int, ...]:
    return tuple(_int16(100.0 * speed) for speed in velocity_m_s)


def _course(velocity_m_s: Vector3) -> int:
    """Clockwise from north, hundredths of a degree."""
    north, east, _ = velocity_m_s
    return round(100.0 * degrees(atan2(east, north))) % 36000 if hypot(north, east) >= _SLOWEST_COURSE_M_S else _UNKNOWN


def _int16(value: float) -> int:
    return round(min(max(value, -32768.0), 32767.0))


def _uint16(value: float) -> int:
    return round(min(max(value, 0.0), _UNKNOWN - 1.0))
