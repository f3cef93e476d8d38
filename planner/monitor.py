"""Watching the drive: slip per side, tilt and progress, and what to do about them.

The slip stop of 40 % within one wheel revolution is that of the Mars Exploration Rovers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from planner.mobility import Command, rim_speeds
from worlds.geometry import euler_from_quaternion, rotation_from_quaternion, wrap_angle
from worlds.types import Footprint, PoseEstimate


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
    anchor: tuple[float, float, float] | None = None  # place and heading of the last progress
    anchor_time_s: float = 0.0
    turn_from_rad: float = 0.0  # heading at which the rover last got on turning on the spot
    turn_asked_rad: float = 0.0  # since then
    place: tuple[float, float, float] | None = None  # and heading, that the rover has hardly left
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
    slipped = _slip(state, estimate, wheel_speed_rad_s, footprint, limits, step)
    moved = _turn_progress(_progress(slipped, estimate, command, limits), estimate, command, limits, step)
    travel = float(np.mean(np.abs(wheel_speed_rad_s))) * footprint.wheel_radius_m * step
    after = replace(_tread(moved, estimate, travel, limits), time_s=estimate.time_s)
    if tilt(estimate) > limits.tilt_rad:
        return after, Advice.TILT
    if after.slipping_m > limits.slip_revolutions * 2.0 * np.pi * footprint.wheel_radius_m:
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
    return float(np.arccos(np.clip(rotation_from_quaternion(estimate.pose.quaternion_w)[2, 2], -1.0, 1.0)))


def side_speeds(estimate: PoseEstimate, footprint: Footprint) -> tuple[float, float, float]:
    """Believed speed along x of the body, and of its left and right wheel rows over the ground."""
    forward = rotation_from_quaternion(estimate.pose.quaternion_w)[:, 0]
    speed = float(estimate.velocity_w @ forward)
    # Skidding is part of turning, no slip stop: sides are judged by the effective track.
    turn = estimate.yaw_rate_rad_s * footprint.effective_track_ratio * footprint.track_m / 2.0
    return speed, speed - turn, speed + turn


def _slip(
    state: MonitorState,
    estimate: PoseEstimate,
    wheels: tuple[float, ...],
    footprint: Footprint,
    limits: MonitorLimits,
    step: float,
) -> MonitorState:
    """Averages of slip = 1 - true over wheel speed, and the wheel travel spent above the limit."""
    body, left, right = side_speeds(estimate, footprint)
    wheel_left, wheel_right = rim_speeds(wheels, footprint)
    mean = (wheel_left + wheel_right) / 2.0
    travel = float(np.mean(np.abs(wheels))) * footprint.wheel_radius_m * step
    share = 1.0 - float(np.exp(-travel / limits.smoothing_m))
    least = limits.least_wheel_speed_m_s
    slip = _blend(state.slip, body, mean, share, least)
    slipping = state.slipping_m + travel if slip > limits.slip and abs(mean) > least else 0.0
    return replace(
        state,
        slip=slip,
        slip_left=_blend(state.slip_left, left, wheel_left, share, least),
        slip_right=_blend(state.slip_right, right, wheel_right, share, least),
        slipping_m=slipping if travel > 0.0 else state.slipping_m,
    )


def _blend(old: float, true_speed: float, wheel_speed: float, share: float, least: float) -> float:
    if abs(wheel_speed) < least:
        return old * (1.0 - share)
    return old + share * (min(max(1.0 - true_speed / wheel_speed, -1.0), 1.5) - old)


def _turn_progress(
    state: MonitorState, estimate: PoseEstimate, command: Command, limits: MonitorLimits, step: float
) -> MonitorState:
    """Adds up the turn on the spot that is asked for, from the heading at which the rover last got on."""
    heading = euler_from_quaternion(estimate.pose.quaternion_w)[2]
    turned = abs(wrap_angle(heading - state.turn_from_rad))
    if command.linear_m_s != 0.0 or command.yaw_rate_rad_s == 0.0 or turned > limits.stuck_turn_rad:
        return replace(state, turn_from_rad=heading, turn_asked_rad=0.0)
    return replace(state, turn_asked_rad=state.turn_asked_rad + step * abs(command.yaw_rate_rad_s))


def _tread(state: MonitorState, estimate: PoseEstimate, travel_m: float, limits: MonitorLimits) -> MonitorState:
    """Adds up the wheels' travel at one place, until the rover has left it or turned away."""
    here = _here(estimate)
    if state.place is not None:
        moved = float(np.hypot(here[0] - state.place[0], here[1] - state.place[1]))
        if moved < limits.treading_distance_m and abs(wrap_angle(here[2] - state.place[2])) < limits.treading_turn_rad:
            return replace(state, travel_m=state.travel_m + travel_m)
    return replace(state, place=here, travel_m=0.0)


def _here(estimate: PoseEstimate) -> tuple[float, float, float]:
    """Place and heading."""
    x, y = (float(value) for value in estimate.pose.position_w[:2])
    return x, y, euler_from_quaternion(estimate.pose.quaternion_w)[2]


def _progress(state: MonitorState, estimate: PoseEstimate, command: Command, limits: MonitorLimits) -> MonitorState:
    """Moves the anchor when the rover got on, turned, or was not asked to."""
    here = _here(estimate)
    x, y = here[:2]
    asked = abs(command.linear_m_s) > 0.02 or abs(command.yaw_rate_rad_s) > 0.02
    if state.anchor is not None and asked:
        moved = float(np.hypot(x - state.anchor[0], y - state.anchor[1]))
        turned = abs((here[2] - state.anchor[2] + np.pi) % (2 * np.pi) - np.pi)
        if moved < limits.stuck_distance_m and turned < limits.stuck_turn_rad:
            return state
    return replace(state, anchor=here, anchor_time_s=estimate.time_s)
