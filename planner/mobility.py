"""Mobility planning: a path to speed and yaw rate, and those to the wheels of a skid-steer rover.

Regulated pure pursuit: Coulter, CMU-RI-TR-92-01 (1992); the slowing by curvature and nearness after Macenski,
Singh, Martin, Gines, "Regulated pure pursuit for robot path tracking", Autonomous Robots 47 (2023) 685-694.
Skid-steer kinematics with an effective track: Mandow et al., IROS 2007; Martinez et al., IJRR 24(10), 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, copysign, cos, hypot, pi, sin

import numba
import numpy as np

from worlds.geometry import euler_from_quaternion, wrap_angle
from worlds.types import FloatArray, Footprint, PoseEstimate


@dataclass(frozen=True)
class Command:
    """Wanted motion of the body: speed along x and rate about z."""

    linear_m_s: float
    yaw_rate_rad_s: float


STOP = Command(0.0, 0.0)
SPINNING_SLIP, ROLLING_SLIP = 0.55, 0.35  # of the outer side of a bend
PUSH_M_S = 0.4  # over what stops the outer side
LEAST_COURSE_M_S = 0.1  # a slower rover has no course that could be told
MOST_DRIFT_RAD = float(np.deg2rad(25.0))


@dataclass(frozen=True)
class Limits:
    """How the rover may be driven; the footprint's own limits hold as well."""

    cruise_speed_m_s: float = 0.6
    creep_speed_m_s: float = 0.12  # slow, but enough not to stick in the sand
    turn_rate_rad_s: float = 0.45  # on the spot
    least_turn_rate_rad_s: float = 0.12
    acceleration_m_s2: float = 0.5  # a third of what sand of 27 deg gives under Mars gravity
    yaw_acceleration_rad_s2: float = 1.0
    lookahead_m: float = 0.5
    lookahead_time_s: float = 0.4
    slow_radius_m: float = 1.2  # tighter curves than this are driven in proportion slower
    slow_distance_m: float = 0.8  # braking begins so far from the end
    arrival_radius_m: float = 0.25
    turn_start_rad: float = float(np.deg2rad(35.0))  # heading error at which the rover stops to turn
    inner_share: float = 0.3  # of the speed, that the inner wheels keep in a bend: standing ones dig the others in
    turn_end_rad: float = float(np.deg2rad(8.0))
    risk: float = 0.0  # 0 free ground .. 1 dangerous: cruise speed falls to 40 %


@dataclass(frozen=True)
class Progress:
    """What path following remembers between two steps; begin each path with ``Progress()``."""

    arc_m: float = 0.0  # how far along the path the rover is
    turning: bool = False
    arrived: bool = False


def follow_path(
    path_w: FloatArray,
    pose: PoseEstimate,
    footprint: Footprint,
    limits: Limits,
    progress: Progress,
    *,
    reverse: bool = False,
) -> tuple[Command, Progress]:
    """Speed and yaw rate that lead along the polyline ``path_w`` (N, 2), N >= 1, and the progress made.

    With ``reverse`` the rear leads. At the end the command is `STOP` and ``progress.arrived`` is true.
    """
    x, y = pose.pose.position_w[:2].tolist()
    path_w = np.array(path_w, dtype=np.float64)
    arc, length = arc_on_path(path_w, x, y, progress.arc_m)
    end_x, end_y = path_w[-1].tolist()
    to_end = hypot(end_x - x, end_y - y)
    left = length - arc
    near = min(limits.arrival_radius_m, 0.3 * length) if length > 0.0 else limits.arrival_radius_m
    if progress.arrived or (to_end < near and left < 2.0) or (to_end < 1.0 and left < 1e-3):
        return STOP, Progress(arc, progress.turning, arrived=True)
    yaw = euler_from_quaternion(pose.pose.quaternion_w)[2] + (pi if reverse else 0.0)
    speed_now = hypot(*pose.velocity_w[:2].tolist())
    lookahead = limits.lookahead_m + limits.lookahead_time_s * speed_now
    ahead_x, ahead_y = point_at(path_w, arc + lookahead)
    error = wrap_angle(atan2(ahead_y - y, ahead_x - x) - yaw)
    turning = abs(error) > (limits.turn_end_rad if progress.turning else limits.turn_start_rad)
    following = Progress(arc, turning, progress.arrived)
    if turning:
        return Command(0.0, _turn_rate(error, footprint, limits)), following
    tightest = (1.0 - limits.inner_share) / _effective_half_track(footprint)
    error -= _drift(pose, yaw)
    curvature = _clamp(2.0 * sin(error) / max(hypot(ahead_x - x, ahead_y - y), 0.2), tightest)
    speed = _speed(curvature, max(to_end, left), footprint, limits)
    rate = _clamp(speed * curvature, footprint.max_yaw_rate_rad_s)
    return Command(-speed if reverse else speed, rate), following


def relieve(command: Command, slips: tuple[float, float], *, spinning: bool) -> tuple[Command, bool]:
    """A bend whose outer wheels spin becomes straight until they roll again; and whether they still spin.

    ``slips``: of the left and right side, see `planner.monitor`; ``spinning``: what the last call said. In a bend the
    outer side carries nearly all: against a low rock uphill it spins, and the slower inner side turns the rover the
    wrong way. With both sides at one speed four wheels push.
    """
    outer_is_right = (command.yaw_rate_rad_s > 0.0) == (command.linear_m_s > 0.0)
    limit = ROLLING_SLIP if spinning else SPINNING_SLIP
    if command.linear_m_s == 0.0 or slips[outer_is_right] < limit:
        return command, False
    return Command(float(np.copysign(max(abs(command.linear_m_s), PUSH_M_S), command.linear_m_s)), 0.0), True


def turn_to(heading_rad: float, pose: PoseEstimate, footprint: Footprint, limits: Limits) -> tuple[Command, bool]:
    """Yaw rate on the spot towards a heading in the world, and whether it is reached (then the command is `STOP`)."""
    error = wrap_angle(heading_rad - euler_from_quaternion(pose.pose.quaternion_w)[2])
    if abs(error) < limits.turn_end_rad:
        return STOP, True
    return Command(0.0, _turn_rate(error, footprint, limits)), False


def ramp(previous: Command, wanted: Command, limits: Limits, step_s: float) -> Command:
    """``wanted``, as far as the accelerations allow it ``step_s`` after ``previous``."""
    linear = limits.acceleration_m_s2 * step_s
    turn = limits.yaw_acceleration_rad_s2 * step_s
    return Command(
        previous.linear_m_s + _clamp(wanted.linear_m_s - previous.linear_m_s, linear),
        previous.yaw_rate_rad_s + _clamp(wanted.yaw_rate_rad_s - previous.yaw_rate_rad_s, turn),
    )


def wheel_speeds(linear_m_s: float, yaw_rate_rad_s: float, footprint: Footprint) -> tuple[float, ...]:
    """Wheel speeds (rad/s; left side front to rear, then right side) of a wanted motion.

    A motion beyond the fastest wheel is slowed as a whole, so its curvature stays.
    """
    half_track = _effective_half_track(footprint)
    left, right = linear_m_s - yaw_rate_rad_s * half_track, linear_m_s + yaw_rate_rad_s * half_track
    scale = min(1.0, footprint.max_speed_m_s / max(abs(left), abs(right), 1e-9)) / footprint.wheel_radius_m
    return (left * scale,) * (footprint.wheels // 2) + (right * scale,) * (footprint.wheels // 2)


def body_motion(wheel_speed_rad_s: tuple[float, ...], footprint: Footprint) -> Command:
    """Motion that wheels without slip would give: the inverse of `wheel_speeds`."""
    left, right = rim_speeds(wheel_speed_rad_s, footprint)
    return Command((left + right) / 2.0, (right - left) / (2.0 * _effective_half_track(footprint)))


def rim_speeds(wheel_speed_rad_s: tuple[float, ...], footprint: Footprint) -> tuple[float, float]:
    """Mean rim speed (m/s) of the left and of the right wheels."""
    half = len(wheel_speed_rad_s) // 2
    share = footprint.wheel_radius_m / half
    return share * sum(wheel_speed_rad_s[:half]), share * sum(wheel_speed_rad_s[half:])


def _effective_half_track(footprint: Footprint) -> float:
    return footprint.effective_track_ratio * footprint.track_m / 2.0


def _drift(pose: PoseEstimate, heading_rad: float) -> float:
    """Angle (rad) from the leading heading to the course: across a slope the rover goes downhill of where it points."""
    east, north = pose.velocity_w[:2].tolist()
    s, c = sin(heading_rad), cos(heading_rad)
    ahead, left = east * c + north * s, north * c - east * s
    return _clamp(atan2(left, max(ahead, LEAST_COURSE_M_S)), MOST_DRIFT_RAD)


def _turn_rate(error_rad: float, footprint: Footprint, limits: Limits) -> float:
    fastest = min(limits.turn_rate_rad_s, footprint.max_yaw_rate_rad_s)
    least = min(limits.least_turn_rate_rad_s, fastest)
    return copysign(min(max(1.2 * abs(error_rad), least), fastest), error_rad)


def _speed(curvature: float, remaining_m: float, footprint: Footprint, limits: Limits) -> float:
    cruise = min(limits.cruise_speed_m_s, footprint.max_speed_m_s) * (1.0 - 0.6 * min(max(limits.risk, 0.0), 1.0))
    curved = min(1.0, 1.0 / max(abs(curvature) * limits.slow_radius_m, 1e-9))
    ending = min(1.0, remaining_m / limits.slow_distance_m)
    # The outer wheels run faster than the body: leave them room, or the curve opens.
    outer = 1.0 + abs(curvature) * _effective_half_track(footprint)
    return min(max(cruise * curved * ending, min(limits.creep_speed_m_s, cruise)), footprint.max_speed_m_s / outer)


def _clamp(value: float, most: float) -> float:
    """``value``, held between -``most`` and ``most``; NumPy's clip takes microseconds for a single number."""
    return min(max(value, -most), most)


@numba.njit("UniTuple(f8, 2)(f8[:, ::1], f8, f8, f8)", cache=True)  # at import: a rover must not stand and compile
def arc_on_path(path_w: FloatArray, x_m: float, y_m: float, arc_m: float) -> tuple[float, float]:
    """Arc length of the path's point nearest to (x_m, y_m) and the path's length.

    Only the stretch from 0.3 m behind the last arc to 2 m ahead counts: a path that meets itself is not cut short.
    """
    low, high = max(arc_m - 0.3, 0.0), arc_m + 2.0
    nearest, answer, start = np.inf, 0.0, 0.0
    for i in range(path_w.shape[0] - 1):
        x, y = path_w[i + 1, 0] - path_w[i, 0], path_w[i + 1, 1] - path_w[i, 1]
        length = np.sqrt(x * x + y * y)
        divisor = max(length, 1e-9)
        along = ((x_m - path_w[i, 0]) * x + (y_m - path_w[i, 1]) * y) / divisor
        arc = min(max(start + min(max(along, 0.0), length), low), max(high, low))
        arc = min(max(arc, start), start + length)
        if low - 1e-9 <= arc <= high + 1e-9:
            share = (arc - start) / divisor
            dx, dy = path_w[i, 0] + x * share - x_m, path_w[i, 1] + y * share - y_m
            distance = np.sqrt(dx * dx + dy * dy)
            if distance < nearest:
                nearest, answer = distance, arc
        start += length
    return (answer if nearest < np.inf else start), start


@numba.njit("UniTuple(f8, 2)(f8[:, ::1], f8)", cache=True)
def point_at(path_w: FloatArray, arc_m: float) -> tuple[float, float]:
    """Point of the path at an arc length; the last one beyond its end."""
    start = 0.0
    for i in range(path_w.shape[0] - 1):
        x, y = path_w[i + 1, 0] - path_w[i, 0], path_w[i + 1, 1] - path_w[i, 1]
        length = np.sqrt(x * x + y * y)
        if arc_m < start + length:
            share = max(arc_m - start, 0.0) / length
            return path_w[i, 0] + share * x, path_w[i, 1] + share * y
        start += length
    return float(path_w[-1, 0]), float(path_w[-1, 1])
