"""The truth about the rover at one instant, for the recorder and for scoring; no planner sees it."""

from __future__ import annotations

from dataclasses import dataclass

from worlds.types import FloatArray, Pose, Vector3


@dataclass(frozen=True)
class BodyContact:
    """The hull touched an obstacle."""

    obstacle_id: int
    time_s: float
    impact_speed_m_s: float  # approach along the contact normal, just before
    normal_force_N: float
    position_w: Vector3


@dataclass(frozen=True, eq=False)
class VehicleState:
    """Truth of one instant; wheels in the order left front, left rear, right front, right rear."""

    time_s: float
    pose: Pose  # of the body origin, in the middle of the axles
    linear_velocity_w: FloatArray  # (3,) of the body origin
    angular_velocity_w: FloatArray  # (3,)
    wheel_speed_rad_s: FloatArray  # (4,) relative to the chassis
    slip: FloatArray  # (4,) driving 1 - v / (omega r), braking (omega r - v) / v < 0
    slip_angle_rad: FloatArray  # (4,) positive where the wheel moves to its left
    sinkage_m: FloatArray  # (4,) plastic
    normal_force_N: FloatArray  # (4,) of soil and rocks
    drawbar_N: FloatArray  # (4,) net pull of the soil along the wheel
    wheel_torque_Nm: FloatArray  # (4,) of the motors
    power_W: float  # positive motor work and electronics
    energy_J: float  # the same since the start
    tilt_rad: float  # between body z and the vertical
    stability_margin: float  # force-angle measure, 1 on level ground at rest, < 0 tips
    belly_contact: bool
    body_contacts: tuple[BodyContact, ...]  # of this step
    wheel_contacts: tuple[int, ...]  # obstacles under or against the wheels in this step
    off_map: bool  # a wheel has left the height field
