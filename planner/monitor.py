"""Watching the drive: slip per side, tilt and progress, and what to do about them.

The slip stop of 40 % within one wheel revolution is that of the Mars Exploration Rovers.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import acos, exp, hypot, pi

import numpy as np

from planner.mobility import Command, rim_speeds
from worlds.geometry import euler_from_quaternion, wrap_angle
from worlds.types import Footprint, PoseEstimate

Place = tuple[float, float, float]  # and heading


class Advice(StrEnum):
    """What the monitor asks for; the gravest first."""

    TILT = "tilt"  # stop: the rover leans too far
    SLIP_STOP = "slip_stop"  # stop: the wheels dig
    STUCK = "stuck"  # told to move, and does not
    VAIN_TURN = "vain_turn"  # told to turn on the spot, and hardly does: each second digs the wheels in
    TREADING = "treading"  # to and fro at one place for a long way of the wheels, which digs them in as well
    NONE = "none"


@dataclass(frozen=True)
class MonitorLimits:
    """When the monitor speaks up."""

    slip: float = 0.40
    slip_revolutions: float = 1.0  # wheel travel at that slip, in revolutions
    tilt_rad: float = float(np.deg2rad(30.0))
    stuck_time_s: float = 6.0
    stuck_distance_m: float = 0.10
    stuck_turn_rad: float = 0.10
    vain_turn_rad: float = 0.5  # asked for on the spot while the rover turned by less than ``stuck_turn_rad``
    treading_m: float = 2.5  # of wheel travel within the next two; a turn by 60 degrees on sand takes one metre
    treading_distance_m: float = 0.25
    treading_turn_rad: float = 1.0
    least_wheel_speed_m_s: float = 0.05  # slower wheels say nothing of slip
    smoothing_m: float = 0.25  # wheel travel over which slip is averaged


@dataclass(frozen=True)
class MonitorState:
    """What the monitor remembers; the slips are averages over the last wheel travel."""

    time_s: float = 0.0
    slip: float = 0.0  # of the body
    slip_left: float = 0.0
    slip_right: float = 0.0
    slipping_m: float = 0.0  # wheel travel since slip went over the limit
    anchor: Place | None = None  # place and heading of the last progress
    anchor_time_s: float = 0.0
    turn_from_rad: float = 0.0  # heading at which the rover last got on turning on the spot
    turn_asked_rad: float = 0.0  # since then
    place: Place | None = None  # and heading, that the rover has hardly left
    travel_m: float = 0.0  # of its wheels since it came there


def watch(
    state: MonitorState,
    estimate: PoseEstimate,
    wheel_speed_rad_s: tuple[float, ...],
    command: Command,
    footprint: Footprint,
    limits: MonitorLimits | None = None,
) -> tuple[MonitorState, Advice]:
    """The state after one look at motion and wheels, and the advice."""
    limits = limits or MonitorLimits()
    step = max(estimate.time_s - state.time_s, 0.0)
    wheels_m_s = sum([abs(speed) for speed in wheel_speed_rad_s]) / len(wheel_speed_rad_s) * footprint.wheel_radius_m
    travel, here = wheels_m_s * step, _here(estimate)
    after = MonitorState(
        estimate.time_s,
        *_slips(state, side_speeds(estimate, footprint), rim_speeds(wheel_speed_rad_s, footprint), limits, travel),
        *_progress(state, here, estimate.time_s, command, limits),
        *_turn_progress(state, here[2], command, limits, step),
        *_tread(state, here, travel, limits),
    )
    if tilt(estimate) > limits.tilt_rad:
        return after, Advice.TILT
    if after.slipping_m > limits.slip_revolutions * 2.0 * pi * footprint.wheel_radius_m:
        return after, Advice.SLIP_STOP
    if estimate.time_s - after.anchor_time_s > limits.stuck_time_s:
        return after, Advice.STUCK
    if after.turn_asked_rad > limits.vain_turn_rad:
        return after, Advice.VAIN_TURN
    if after.travel_m > limits.treading_m:
        return after, Advice.TREADING
    return after, Advice.NONE


def resume(state: MonitorState) -> MonitorState:
    """The state after the rover was stopped and set to do something else: old slip and standstill are forgotten."""
    return MonitorState(time_s=state.time_s, anchor_time_s=state.time_s)


def tilt(estimate: PoseEstimate) -> float:
    """Angle between the body's up axis and the vertical, radians."""
    x, y, _, _ = estimate.pose.quaternion_w.tolist()
    return acos(min(max(1.0 - 2.0 * (x * x + y * y), -1.0), 1.0))


def side_speeds(estimate: PoseEstimate, footprint: Footprint) -> tuple[float, float, float]:
    """Believed speed along x of the body, and of its left and right wheel rows over the ground."""
    x, y, z, w = estimate.pose.quaternion_w.tolist()
    east, north, up = estimate.velocity_w.tolist()
    speed = east * (1 - 2 * (y * y + z * z)) + 2 * north * (x * y + z * w) + 2 * up * (x * z - y * w)
    # Skidding is part of turning, no slip stop: sides are judged by the effective track.
    turn = estimate.yaw_rate_rad_s * footprint.effective_track_ratio * footprint.track_m / 2.0
    return speed, speed - turn, speed + turn


def _slips(
    state: MonitorState,
    speeds_m_s: tuple[float, float, float],
    rims_m_s: tuple[float, float],
    limits: MonitorLimits,
    travel: float,
) -> tuple[float, float, float, float]:
    """Averages of slip = 1 - true over wheel speed (body, left, right), and the wheel travel spent above the limit.

    ``speeds_m_s`` of body, left and right wheels over the ground, ``rims_m_s`` of the left and right rims.
    """
    mean = (rims_m_s[0] + rims_m_s[1]) / 2.0
    share = 1.0 - exp(-travel / limits.smoothing_m)
    least = limits.least_wheel_speed_m_s
    slip = _blend(state.slip, speeds_m_s[0], mean, share, least)
    slipping = state.slipping_m + travel if slip > limits.slip and abs(mean) > least else 0.0
    return (
        slip,
        _blend(state.slip_left, speeds_m_s[1], rims_m_s[0], share, least),
        _blend(state.slip_right, speeds_m_s[2], rims_m_s[1], share, least),
        slipping if travel > 0.0 else state.slipping_m,
    )


def _blend(old: float, true_speed: float, wheel_speed: float, share: float, least: float) -> float:
    if abs(wheel_speed) < least:
        return old * (1.0 - share)
    return old + share * (min(max(1.0 - true_speed / wheel_speed, -1.0), 1.5) - old)


def _turn_progress(
    state: MonitorState, heading: float, command: Command, limits: MonitorLimits, step: float
) -> tuple[float, float]:
    """The heading at which the rover last got on, and the turn on the spot that was asked for since."""
    turned = abs(wrap_angle(heading - state.turn_from_rad))
    if command.linear_m_s != 0.0 or command.yaw_rate_rad_s == 0.0 or turned > limits.stuck_turn_rad:
        return heading, 0.0
    return state.turn_from_rad, state.turn_asked_rad + step * abs(command.yaw_rate_rad_s)


def _tread(state: MonitorState, here: Place, travel_m: float, limits: MonitorLimits) -> tuple[Place, float]:
    """A place, and the wheels' travel at it, until the rover has left it or turned away."""
    if state.place is not None:
        moved = hypot(here[0] - state.place[0], here[1] - state.place[1])
        if moved < limits.treading_distance_m and abs(wrap_angle(here[2] - state.place[2])) < limits.treading_turn_rad:
            return state.place, state.travel_m + travel_m
    return here, 0.0


def _here(estimate: PoseEstimate) -> Place:
    """Place and heading."""
    x, y, _ = estimate.pose.position_w.tolist()
    return x, y, euler_from_quaternion(estimate.pose.quaternion_w)[2]


def _progress(
    state: MonitorState, here: Place, time_s: float, command: Command, limits: MonitorLimits
) -> tuple[Place, float]:
    """The anchor and its time: moved when the rover got on, turned, or was not asked to."""
    asked = abs(command.linear_m_s) > 0.02 or abs(command.yaw_rate_rad_s) > 0.02
    if state.anchor is not None and asked:
        moved = hypot(here[0] - state.anchor[0], here[1] - state.anchor[1])
        turned = abs(wrap_angle(here[2] - state.anchor[2]))
        if moved < limits.stuck_distance_m and turned < limits.stuck_turn_rad:
            return state.anchor, state.anchor_time_s
    return here, time_s
