"""A flat world of discs with a kinematic rover and a camera that sees discs: enough to close the planner's loop."""

from __future__ import annotations

import numpy as np

from planner.mobility import Command
from worlds.geometry import quaternion_from_euler
from worlds.types import FloatArray, Footprint, Pose, PoseEstimate

FOOTPRINT = Footprint(
    length_m=0.99,
    width_m=0.67,
    wheel_radius_m=0.165,
    track_m=0.57,
    wheelbase_m=0.51,
    clearance_m=0.13,
    max_speed_m_s=0.8,
    max_yaw_rate_rad_s=1.2,
)


def pose_at(x_m: float, y_m: float, yaw_rad: float, time_s: float = 0.0) -> PoseEstimate:
    """An exact estimate of a rover that stands at a place."""
    pose = Pose(np.array([x_m, y_m, 0.165]), quaternion_from_euler(0.0, 0.0, yaw_rad))
    return PoseEstimate(time_s, pose, np.zeros(3), 0.0, 0.02, 0.01)


def drive(state: FloatArray, command: Command, step_s: float) -> FloatArray:
    """Place and heading (3,) after ``step_s`` of a motion without slip."""
    heading = state[2] + 0.5 * step_s * command.yaw_rate_rad_s
    motion = np.array([np.cos(heading), np.sin(heading)]) * command.linear_m_s * step_s
    return np.array([state[0] + motion[0], state[1] + motion[1], state[2] + step_s * command.yaw_rate_rad_s])
