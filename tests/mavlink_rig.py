"""A rover without physics for tests of the autopilot and of MAVLink: it goes where its wheels say."""

from __future__ import annotations

import numpy as np

from planner.mobility import body_motion
from worlds.geometry import quaternion_from_euler
from worlds.types import Footprint, GnssReading, ImuReading, Pose, PoseEstimate, SensorReadings

FOOTPRINT = Footprint(
    length_m=0.99,
    width_m=0.67,
    wheel_radius_m=0.165,
    track_m=0.55,
    wheelbase_m=0.51,
    clearance_m=0.13,
    max_speed_m_s=1.0,
    max_yaw_rate_rad_s=1.0,
)


class KinematicRover:
    """Truth and belief are the same here; ``slip`` and ``roll_rad`` may be set by a test."""

    def __init__(self) -> None:
        self.time_s = 0.0
        self.x_m = self.y_m = self.yaw_rad = 0.0
        self.roll_rad = 0.0
        self.slip = 0.0
        self.position_sd_m = 0.05
        self.wheels: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def move(self, wheels: tuple[float, ...], step_s: float) -> None:
        self.wheels = wheels
        motion = body_motion(wheels, FOOTPRINT)
        speed = motion.linear_m_s * (1.0 - self.slip)
        self.yaw_rad += motion.yaw_rate_rad_s * step_s
        self.x_m += speed * float(np.cos(self.yaw_rad)) * step_s
        self.y_m += speed * float(np.sin(self.yaw_rad)) * step_s
        self.time_s += step_s

    def estimate(self) -> PoseEstimate:
        motion = body_motion(self.wheels, FOOTPRINT)
        speed = motion.linear_m_s * (1.0 - self.slip)
        return PoseEstimate(
            time_s=self.time_s,
            pose=Pose(np.array([self.x_m, self.y_m, 0.0]), quaternion_from_euler(self.roll_rad, 0.0, self.yaw_rad)),
            velocity_w=np.array([speed * np.cos(self.yaw_rad), speed * np.sin(self.yaw_rad), 0.0]),
            yaw_rate_rad_s=motion.yaw_rate_rad_s,
            position_sd_m=self.position_sd_m,
            yaw_sd_rad=0.02,
        )

    def readings(self) -> SensorReadings:
        return SensorReadings(
            time_s=self.time_s,
            imu=ImuReading((0.0, 0.0, 3.71), (0.0, 0.0, 0.0), self.yaw_rad),
            wheel_speed_rad_s=self.wheels,
            gnss=GnssReading((self.x_m, self.y_m, 0.0), (0.0, 0.0, 0.0), 0.5),
        )
