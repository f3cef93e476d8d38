"""Set points from outside: a motion, a direction or a place to be followed in mode Guided while they keep coming."""

from __future__ import annotations

import math
from dataclasses import dataclass

from planner.mobility import STOP, Command, Limits, turn_to
from rover_sim.autopilot.mission import DriveTo, Mission
from rover_sim.autopilot.runner import MissionRunner
from worlds.geometry import euler_from_quaternion, wrap_angle
from worlds.types import Footprint, PoseEstimate, Vector3

_YAW_GAIN_PER_S = 1.5
_SAME_PLACE_M = 0.01  # a place that is sent again does not begin a new way


@dataclass(frozen=True)
class DriveAt:
    """Speed along the body's x and rate about z."""

    speed_m_s: float
    yaw_rate_rad_s: float


@dataclass(frozen=True)
class DriveAlong:
    """Head for a direction of the world (from +x counter-clockwise) at a speed; below 0 with the rear first."""

    heading_rad: float
    speed_m_s: float


@dataclass(frozen=True)
class DriveToward:
    """Drive to a place and stay there."""

    position_w: Vector3


Target = DriveAt | DriveAlong | DriveToward


class TargetFollower:
    """Follows the last set point; one instance lives as long as its autopilot."""

    def __init__(self, footprint: Footprint) -> None:
        self.target: Target | None = None
        self.hold_on_loss = False  # mode Hold once set points stop coming; else stand still in Guided
        self._footprint = footprint
        self._runner = MissionRunner(footprint)
        self._until_s = math.inf

    def aim(self, target: Target, until_s: float, *, hold_on_loss: bool) -> None:
        """Follow this from now on; without news until ``until_s`` the set points are lost."""
        if isinstance(target, DriveToward) and not self._is_place(target.position_w):
            self._runner.load(Mission((DriveTo(target.position_w),)))
            self._runner.start()
        self.target, self._until_s, self.hold_on_loss = target, until_s, hold_on_loss

    def forget(self) -> None:
        """Follow nothing."""
        self.target = None
        self._runner.load(Mission())

    def lost(self, time_s: float) -> bool:
        """Whether the set points have just been lost; the last one is then forgotten."""
        late = self.target is not None and not time_s < self._until_s
        if late:
            self.forget()
        return late

    def wanted(self, time_s: float, estimate: PoseEstimate, limits: Limits, home_w: Vector3) -> Command:
        """Motion towards the set point."""
        match self.target:
            case DriveAt(speed, rate):
                return Command(speed, rate)
            case DriveAlong(heading, 0.0):
                return turn_to(heading, estimate, self._footprint, limits)[0]
            case DriveAlong(heading, speed):
                return self._along(heading, speed, estimate)
            case DriveToward():
                return self._runner.step(time_s, estimate, limits, lambda: home_w)[0]
        return STOP

    def _along(self, heading_rad: float, speed_m_s: float, estimate: PoseEstimate) -> Command:
        """Turn in proportion to the error and drive the slower the larger it is; beyond a right angle on the spot."""
        error = wrap_angle(heading_rad - euler_from_quaternion(estimate.pose.quaternion_w)[2])
        fastest = self._footprint.max_yaw_rate_rad_s
        rate = min(max(_YAW_GAIN_PER_S * error, -fastest), fastest)
        return Command(speed_m_s * max(math.cos(error), 0.0), rate)

    def _is_place(self, position_w: Vector3) -> bool:
        before = self.target
        same = isinstance(before, DriveToward) and math.dist(before.position_w, position_w) < _SAME_PLACE_M
        return same and not self._runner.mission.empty
