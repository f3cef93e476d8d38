"""Wheel speeds that come from outside in the place of the built-in autopilot."""

from __future__ import annotations

from planner.mobility import Command, body_motion
from worlds.types import Footprint, PoseEstimate, SensorReadings


class OutputDriver:
    """Turns both sides of wheels as the outputs of an autopilot say."""

    def __init__(self, footprint: Footprint) -> None:
        self._footprint = footprint
        self.set(0.0, 0.0)

    def set(self, left: float, right: float) -> None:
        """Outputs of both sides, -1 (full speed astern) to 1 (full speed ahead)."""
        fastest = self._footprint.max_speed_m_s / self._footprint.wheel_radius_m
        half = self._footprint.wheels // 2
        self.wheel_speed_rad_s = (left * fastest,) * half + (right * fastest,) * half

    @property
    def motion(self) -> Command:
        """The motion that these speeds give without slip."""
        return body_motion(self.wheel_speed_rad_s, self._footprint)

    def update(self, time_s: float, estimate: PoseEstimate, readings: SensorReadings) -> tuple[float, ...]:
        """The speeds set last; the autopilot has sensors of its own."""
        del time_s, estimate, readings
        return self.wheel_speed_rad_s
