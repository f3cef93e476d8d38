"""The truth about the rover at one instant, for the recorder and for scoring; no planner sees it."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from worlds.types import BoolArray, FloatArray, Pose, Vector3


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
    """Truth of one instant; the left wheels from front to rear, then the right ones."""

    time_s: float
    pose: Pose  # of the body origin, in the middle of the axles
    linear_velocity_w: FloatArray  # (3,) of the body origin
    angular_velocity_w: FloatArray  # (3,)
    hubs_w: FloatArray  # (n, 3)
    wheel_speed_rad_s: FloatArray  # (n,) relative to the chassis
    slip: FloatArray  # (n,) driving 1 - v / (omega r), braking (omega r - v) / v < 0
    slip_angle_rad: FloatArray  # (n,) positive where the wheel moves to its left
    sinkage_m: FloatArray  # (n,) plastic
    normal_force_N: FloatArray  # (n,) of soil and rocks
    drawbar_N: FloatArray  # (n,) net pull of the soil along the wheel
    wheel_torque_Nm: FloatArray  # (n,) of the motors
    wheel_power_W: FloatArray  # (n,) of the motors at the axle; negative where the ground drives the wheel
    pit_depth_m: FloatArray  # (n,) what the wheel must climb to get out, ahead or behind; below 0: nothing
    wedged: BoolArray  # (n,) obstacles press on the wheel from opposite sides
    power_W: float  # positive motor work and electronics
    energy_J: float  # the same since the start
    tilt_rad: float  # between body z and the vertical
    stability_margin: float  # force-angle measure, 1 on level ground at rest, < 0 tips
    tip_angle_rad: FloatArray  # (m,) left until the weight acts over each side of the polygon of support
    tip_rate_rad_s: FloatArray  # (m,) at which that angle shrinks
    belly_contact: bool  # with the ground
    belly_clearance_m: float  # least gap under the hull, to ground or obstacles; below 0 they press
    body_contacts: tuple[BodyContact, ...]  # of this step
    wheel_contacts: tuple[int, ...]  # obstacles under or against the wheels in this step
    off_map: bool  # a wheel has left the height field


def trace_columns(state: VehicleState) -> dict[str, ArrayLike]:
    """What the trace keeps of one instant: a row of its columns."""
    return {
        "time_s": state.time_s,
        "position_w": state.pose.position_w,
        "quaternion_w": state.pose.quaternion_w,
        "velocity_w": state.linear_velocity_w,
        "angular_velocity_w": state.angular_velocity_w,
        "wheel_speed": state.wheel_speed_rad_s,
        "slip": state.slip,
        "slip_angle": state.slip_angle_rad,
        "sinkage": state.sinkage_m,
        "normal_force": state.normal_force_N,
        "drawbar": state.drawbar_N,
        "wheel_torque": state.wheel_torque_Nm,
        "wheel_power": state.wheel_power_W,
        "pit_depth": state.pit_depth_m,
        "power_W": state.power_W,
        "energy_J": state.energy_J,
        "stability_margin": state.stability_margin,
        "belly_contact": state.belly_contact,
        "belly_clearance": state.belly_clearance_m,
    }
