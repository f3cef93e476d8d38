"""Where the rover comes to rest: a first guess of its pose from the ground under its wheels."""

from __future__ import annotations

import numpy as np

from rover_sim.sim.rover import RoverModel
from rover_sim.sim.terramechanics import WheelSoil
from worlds.geometry import euler_from_quaternion, quaternion_from_rotation
from worlds.heightfield import height_at
from worlds.types import FloatArray, HeightField, Pose


def resting_pose(ground: HeightField, start: Pose, rover: RoverModel, soil: WheelSoil, gravity_m_s2: float) -> Pose:
    """Body pose over ``start`` on the plane through the ground under the wheels; puts the soil under load as well."""
    yaw = euler_from_quaternion(start.quaternion_w)[2]
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    hubs = np.array(rover.wheel.positions_m)
    spots = np.asarray(start.position_w[:2]) + hubs[:, :1] * ahead + hubs[:, 1:2] * left
    heights = np.asarray(height_at(ground, spots[:, 0], spots[:, 1]))
    (level, along, across), *_ = np.linalg.lstsq(np.column_stack([np.ones(len(hubs)), hubs[:, :2]]), heights)
    normal = np.array([*(-along * ahead - across * left), 1.0])
    normal /= np.linalg.norm(normal)
    loads = np.full(len(hubs), rover.mass_kg * gravity_m_s2 * normal[2] / len(hubs))
    # Weight along the plane over weight across it is its slope: that share of their load the wheels hold with.
    depth = float(soil.settle(loads, (float(along), float(across)), spots).mean())
    foot = np.array([start.position_w[0], start.position_w[1], level])
    position = foot + (rover.wheel.radius_m - depth - float(hubs[:, 2].mean())) * normal
    return Pose(position, quaternion_from_rotation(_attitude(normal, ahead)))


def _attitude(normal: FloatArray, ahead: FloatArray) -> FloatArray:
    """Rotation (3, 3) with z along ``normal`` and x over the level direction ``ahead`` (2,)."""
    left = np.cross(normal, [*ahead, 0.0])
    left /= np.linalg.norm(left)
    return np.column_stack([np.cross(left, normal), left, normal])
