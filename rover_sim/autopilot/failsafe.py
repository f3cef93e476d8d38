"""Fail-safes: reasons to stop driving by itself, from what the rover believes and what its wheels report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, radians

from planner.mobility import Command
from planner.monitor import Advice, MonitorLimits, MonitorState, resume, tilt, watch
from rover_sim.autopilot.modes import Severity
from rover_sim.autopilot.parameters import ParameterTable
from worlds.types import Footprint, PoseEstimate, SensorReadings

STUCK = {
    Advice.STUCK: "no progress for {:.0f} s",
    Advice.VAIN_TURN: "turns on the spot in vain",
    Advice.TREADING: "goes to and fro at one place",
}


_LEAN_MORE_RAD = radians(3.0)


@dataclass(frozen=True)
class Trip:
    """A fail-safe has tripped: the autopilot goes to Hold and says why."""

    severity: Severity
    text: str


class Failsafe:
    """Watches pose, tilt, slip and progress; one instance lives as long as its autopilot."""

    def __init__(self, footprint: Footprint) -> None:
        self.monitor = MonitorState()
        self._footprint = footprint
        self._tilted_since_s: float | None = None
        self._tilt_rad = 0.0
        self._begun_rad = 0.0  # lean with which the task began, until the rover stands within the limit again

    def reset(self) -> None:
        """Forget what has built up: a new task gets its full time and its full wheel revolution.

        A rover that leans over the limit may drive back to where it stands better: until it does, the limit is a
        little more than the lean of the beginning.
        """
        self.monitor = resume(self.monitor)
        self._tilted_since_s = None
        self._begun_rad = self._tilt_rad

    def unfit(self, time_s: float, estimate: PoseEstimate | None, parameters: ParameterTable) -> str | None:
        """Why the rover must not begin to drive by itself now; None if it may."""
        return _pose_fault(time_s, estimate, parameters)

    def leaning(self, parameters: ParameterTable) -> str | None:
        """Why the rover must not be armed where it stands; None if it may."""
        leans = self._tilt_rad > _tilt_limit_rad(parameters)
        return f"tilted by {degrees(self._tilt_rad):.0f} deg" if leans else None

    def update(
        self,
        time_s: float,
        estimate: PoseEstimate | None,
        readings: SensorReadings,
        commanded: Command,
        parameters: ParameterTable,
    ) -> Trip | None:
        """The fail-safe that is tripped now, if any; to be called at every control step."""
        fault = _pose_fault(time_s, estimate, parameters)
        if fault is not None or estimate is None:
            return Trip(Severity.CRITICAL, f"Pose lost: {fault}")
        self._tilt_rad, tilt_limit_rad = tilt(estimate), _tilt_limit_rad(parameters)
        if self._tilt_rad <= tilt_limit_rad:
            self._begun_rad = 0.0
        limits = parameters.derived(_monitor_limits)
        if self._begun_rad + _LEAN_MORE_RAD > tilt_limit_rad:
            limits = replace(limits, tilt_rad=self._begun_rad + _LEAN_MORE_RAD)
        wheels = readings.wheel_speed_rad_s
        self.monitor, advice = watch(self.monitor, estimate, wheels, commanded, self._footprint, limits)
        return self._judge(time_s, estimate, advice, parameters)

    def _judge(self, time_s: float, estimate: PoseEstimate, advice: Advice, parameters: ParameterTable) -> Trip | None:
        if advice is Advice.TILT:
            since = self._tilted_since_s = time_s if self._tilted_since_s is None else self._tilted_since_s
            if time_s - since < parameters["FS_TILT_S"]:
                return None
            return Trip(Severity.CRITICAL, f"Tilt {degrees(tilt(estimate)):.0f} deg")
        self._tilted_since_s = None
        if advice is Advice.SLIP_STOP:
            return Trip(Severity.CRITICAL, f"Slip stop: slip {100.0 * self.monitor.slip:.0f} %")
        if advice in STUCK:
            return Trip(Severity.ERROR, f"Stuck: {STUCK[advice].format(parameters['FS_STUCK_S'])}")
        return None


def _tilt_limit_rad(parameters: ParameterTable) -> float:
    return radians(parameters["FS_TILT_DEG"]) if parameters["FS_TILT_ENABLE"] else inf


def _monitor_limits(parameters: ParameterTable) -> MonitorLimits:
    """Of a rover that did not lean when its task began."""
    limits = MonitorLimits(
        slip=parameters["FS_SLIP_PCT"] / 100.0 if parameters["FS_SLIP_ENABLE"] else inf,
        tilt_rad=_tilt_limit_rad(parameters),
        stuck_time_s=parameters["FS_STUCK_S"],
    )
    if parameters["FS_STUCK_ENABLE"]:
        return limits
    return replace(limits, stuck_time_s=inf, vain_turn_rad=inf, treading_m=inf)


def _pose_fault(time_s: float, estimate: PoseEstimate | None, parameters: ParameterTable) -> str | None:
    """Why the pose cannot be trusted; comparisons are written so that NaN fails them."""
    if estimate is None:
        return "no pose estimate"
    pose = estimate.pose
    if not all(map(isfinite, (*pose.position_w.tolist(), *pose.quaternion_w.tolist()))):
        return "pose estimate is not finite"
    age_s = time_s - estimate.time_s
    if not age_s <= parameters["FS_POSE_S"]:
        return f"pose estimate is {age_s:.1f} s old"
    if not estimate.position_sd_m <= parameters["FS_POSE_M"]:
        return f"position uncertain by {estimate.position_sd_m:.1f} m"
    return None
