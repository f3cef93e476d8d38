"""Both sides of the doubled PX4 in one vehicle: HIL sensors in, an estimate of its own, missions, outputs out.

One clock, that of HIL_SENSOR. It imitates and is not PX4: estimator and controller are simple ones. But it knows of
the world only what its sensors say, and takes nothing from HIL_STATE_QUATERNION.
"""

from __future__ import annotations

from math import atan2, cos, hypot, remainder, sin, tau

import numpy as np

from rover_sim.hil.px4_parameters import Parameters
from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from rover_sim.mavlink.transport import Transport
from rover_sim.sim.magnetometer import world_field_uT
from tests.px4_checks import STEP_USEC, Believed, Checks, body_to_ned
from tests.px4_double import Outputs, Px4Double
from tests.px4_mavlink_double import Px4RoverDouble
from tests.vehicle_double import NEUTRAL, Gains, Motion
from worlds.scenario import Origin
from worlds.types import FloatArray

STEP_S = STEP_USEC / 1e6
YEAR = 2026.0
GNSS_DELAY_S = 0.11  # EKF2_GPS_DELAY
TILT_RATE, HEADING_RATE = 0.5, 0.5  # 1/s, at which gravity and magnetic north pull the attitude
PLACE_GAIN, SPEED_GAIN = 0.4, 0.3  # of a fix


class Estimator:
    """Attitude by a complementary filter, place and velocity by an alpha-beta filter on delayed fixes."""

    def __init__(self, home: Origin) -> None:
        self._frame = LocalFrame(home)
        north, east, _ = world_field_uT(home, YEAR)
        self._declination = atan2(east, north)
        self._quaternion: FloatArray | None = None  # w, x, y, z: body to north-east-down
        self._place, self._velocity = np.zeros(2), np.zeros(2)
        self._fixes = self._field_usec = 0

    @property
    def motion(self) -> Motion:
        """What it believes now; at home and still before it knows better."""
        if self._quaternion is None:
            return Motion()
        w, x, y, z = self._quaternion.tolist()
        heading = atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        (north, east), (v_north, v_east) = self._place.tolist(), self._velocity.tolist()
        return Motion(north, east, heading, v_north * cos(heading) + v_east * sin(heading))

    def update(self, believed: Believed) -> None:
        """One HIL_SENSOR further."""
        if self._quaternion is None:
            self._align(believed)
        else:
            self._turn(believed)
        self._place = self._place + STEP_S * self._velocity
        if believed.fixes > self._fixes and believed.fix is not None and believed.fix.fix_type >= 3:
            self._take_fix(believed)

    def _align(self, believed: Believed) -> None:
        """Roll and pitch from gravity, heading from the magnetic field, both of the first samples."""
        if believed.field_gauss is None:
            return
        ax, ay, az = believed.acceleration.tolist()
        roll, pitch = atan2(-ay, -az), atan2(ax, hypot(ay, az))
        level = _quaternion(roll, pitch, 0.0)
        north, east, _ = body_to_ned(tuple(level)) @ believed.field_gauss
        self._quaternion = np.array(_quaternion(roll, pitch, self._declination - atan2(east, north)))

    def _turn(self, believed: Believed) -> None:
        assert self._quaternion is not None
        rotation = body_to_ned(tuple(self._quaternion))
        up = -believed.acceleration / np.linalg.norm(believed.acceleration)
        rate = believed.rate + TILT_RATE * np.cross(up, rotation.T @ np.array([0.0, 0.0, 1.0]))
        if believed.field_gauss is not None and believed.field_usec > self._field_usec:
            north, east, _ = rotation @ believed.field_gauss
            off = remainder(self._declination - atan2(east, north), tau)
            span_s = min(0.1, (believed.field_usec - self._field_usec) / 1e6)
            self._field_usec = believed.field_usec
            rate = rate + rotation.T @ np.array([0.0, 0.0, HEADING_RATE * off * span_s / STEP_S])
        turned = self._quaternion + 0.5 * STEP_S * _product(self._quaternion, rate)
        self._quaternion = turned / np.linalg.norm(turned)

    def _take_fix(self, believed: Believed) -> None:
        fix = believed.fix
        assert fix is not None
        east, north, _ = self._frame.to_world(GeoPoint(fix.lat / 1e7, fix.lon / 1e7, fix.alt / 1e3))
        velocity = np.array([fix.vn, fix.ve]) / 100.0
        now = np.array([north, east]) + GNSS_DELAY_S * velocity
        first, self._fixes = self._fixes == 0, believed.fixes
        self._place = now if first else self._place + PLACE_GAIN * (now - self._place)
        self._velocity = velocity if first else self._velocity + SPEED_GAIN * (velocity - self._velocity)


class JoinedPx4:
    """One PX4 rover whose world is the simulator; ``px4`` is its HIL side."""

    def __init__(
        self,
        transport: Transport,
        home: Origin,
        values: Parameters,
        *,
        period_usec: int = STEP_USEC,
        head_start_s: float = 0.0,
    ) -> None:
        """``values``: those of which its controller makes use, as the command writes them.

        ``head_start_s``: by which it is ready earlier than the double of its MAVLink side.
        """
        self._head_start_s = head_start_s
        self.rover, self.estimator = Px4RoverDouble(transport, home), Estimator(home)
        full_m_s = values["RO_MAX_THR_SPEED"]
        self.rover.gains = Gains(full_m_s, values["RD_WHEEL_TRACK"] / (2.0 * full_m_s))
        self.rover.speed_m_s, self.rover.radius_m = values["RO_SPEED_LIM"], values["NAV_ACC_RAD"]
        self.px4 = Px4Double(self._control, period_usec=period_usec)
        self.errors_m: list[float] = []  # of the estimate's place, from when it has driven

    def _control(self, checks: Checks) -> Outputs:
        self.estimator.update(checks.believed)
        motion = self.estimator.motion
        left, right = self.rover.tick(self._head_start_s + checks.elapsed_usec / 1e6, motion)
        self._note(checks, motion)
        return Outputs(self.rover.armed, (right - NEUTRAL) / 500.0, (left - NEUTRAL) / 500.0)

    def _note(self, checks: Checks, motion: Motion) -> None:
        """For the test alone: how far the estimate is from the truth."""
        truth = checks.believed.truth
        if truth is not None and self.rover.armed:
            north, east = self.rover.metres(truth.lat, truth.lon)
            self.errors_m.append(hypot(north - motion.north_m, east - motion.east_m))


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    cr, sr, cp, sp, cy, sy = (part(angle / 2) for angle in (roll, pitch, yaw) for part in (cos, sin))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _product(quaternion: FloatArray, rate: FloatArray) -> FloatArray:
    """Quaternion times (0, rate)."""
    w, v = quaternion[0], quaternion[1:]
    return np.array([-v @ rate, *(w * rate + np.cross(v, rate))])
