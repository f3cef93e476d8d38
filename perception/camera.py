"""Pinhole projection: pixels to rays in the world and back.

Pixel coordinates are ``(column, row)`` with the centre of the first pixel at (0.5, 0.5); camera axes are right, down
and forward (OpenCV), so a pixel's ray is ``((u - cu) / f, (v - cv) / f, 1)``.
"""

from __future__ import annotations

import numpy as np

from worlds.geometry import rotation_from_quaternion
from worlds.types import CameraModel, FloatArray, Pose


def rays_c(camera: CameraModel, pixels: FloatArray) -> FloatArray:
    """Rays (..., 3) of depth 1 in camera axes through ``pixels`` (..., 2)."""
    offset = (np.asarray(pixels, dtype=float) - camera.centre_px) / camera.focal_px
    return np.concatenate([offset, np.ones((*offset.shape[:-1], 1))], axis=-1)


def rays_w(camera: CameraModel, camera_pose: Pose, pixels: FloatArray) -> FloatArray:
    """Rays (..., 3) of depth 1 in world axes through ``pixels`` (..., 2)."""
    return rays_c(camera, pixels) @ rotation_from_quaternion(camera_pose.quaternion_w).T


def project(camera: CameraModel, camera_pose: Pose, points_w: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixels (..., 2) and depths (...,) in metres of world points (..., 3); pixels are NaN behind the camera."""
    relative = np.asarray(points_w, dtype=float) - camera_pose.position_w
    points_c = relative @ rotation_from_quaternion(camera_pose.quaternion_w)
    depth = points_c[..., 2]
    in_front = np.where(depth > 0, depth, np.nan)
    return points_c[..., :2] / in_front[..., None] * camera.focal_px + camera.centre_px, depth
