"""What was seen from a pose, as seen from the pose that the rover believes in since."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from msgspec import structs

from worlds.geometry import euler_from_quaternion, wrap_angle
from worlds.types import FloatArray, GroundPlane, Observation, PerceivedRock, PoseEstimate


class Located(NamedTuple):
    """What a picture shows as the rover places it, and where it believes to be once it has seen it."""

    observation: Observation
    estimate: PoseEstimate
    lost: str = ""  # why it does not know where it is


def moved(observation: Observation, before: PoseEstimate, after: PoseEstimate) -> Observation:
    """``observation`` with all its places shifted and turned about the vertical as the rover's pose was."""
    turn = wrap_angle(_yaw(after) - _yaw(before))
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    old, new = before.pose.position_w, after.pose.position_w

    def places(points_w: FloatArray) -> FloatArray:
        axes = points_w.shape[-1]
        return np.asarray((points_w - old[:axes]) @ rotation[:axes, :axes].T + new[:axes])

    def rock(seen: PerceivedRock) -> PerceivedRock:
        x, y, z = places(np.asarray(seen.position_w)).tolist()
        return structs.replace(seen, position_w=(x, y, z), yaw_rad=seen.yaw_rad + turn)

    ground = observation.ground
    return replace(
        observation,
        rocks=tuple(rock(seen) for seen in observation.rocks),
        class_centre_w=places(observation.class_centre_w),
        footprint_w=places(observation.footprint_w),
        ground=None if ground is None else GroundPlane(places(ground.point_w), rotation @ ground.normal_w),
    )


def _yaw(estimate: PoseEstimate) -> float:
    return euler_from_quaternion(estimate.pose.quaternion_w)[2]
