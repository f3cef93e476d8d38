"""Projection: pixels to rays in the world and back, through an ideal pinhole or a real lens.

Pixel coordinates are ``(column, row)`` with the centre of the first pixel at (0.5, 0.5); camera axes are right, down
and forward (OpenCV), so a pinhole's ray is ``((u - cu) / f, (v - cv) / f, 1)``. Pictures are never resampled: it is
the points that a lens is taken out of.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from perception.lens import distort, undistort
from worlds.geometry import rotation_from_quaternion
from worlds.types import CameraModel, FloatArray, Pose


def rays_c(camera: CameraModel, pixels: FloatArray) -> FloatArray:
    """Rays (..., 3) of depth 1 in camera axes through ``pixels`` (..., 2); NaN where the lens sees nothing."""
    offset = (np.asarray(pixels, dtype=float) - camera.centre_px) / _focal(camera)
    if camera.lens is not None:
        offset = undistort(camera.lens, offset)
    return np.concatenate([offset, np.ones((*offset.shape[:-1], 1))], axis=-1)


def rays_w(camera: CameraModel, camera_pose: Pose, pixels: FloatArray) -> FloatArray:
    """Rays (..., 3) of depth 1 in world axes through ``pixels`` (..., 2)."""
    return rays_c(camera, pixels) @ rotation_from_quaternion(camera_pose.quaternion_w).T


def project(camera: CameraModel, camera_pose: Pose, points_w: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixels (..., 2) and depths (...,) in metres of world points (..., 3).

    Pixels are NaN behind the camera and beyond what its lens sees.
    """
    relative = np.asarray(points_w, dtype=float) - camera_pose.position_w
    points_c = relative @ rotation_from_quaternion(camera_pose.quaternion_w)
    depth = points_c[..., 2]
    in_front = np.where(depth > 0, depth, np.nan)
    offset = points_c[..., :2] / in_front[..., None]
    if camera.lens is not None:
        offset = distort(camera.lens, offset)
    return offset * _focal(camera) + camera.centre_px, depth


@lru_cache(maxsize=8)
def grid_rays_c(camera: CameraModel, shape: tuple[int, int]) -> FloatArray:
    """Unit rays (rows, columns, 3) in camera axes of a picture that shows the camera's view in ``shape`` pixels."""
    rows = (np.arange(shape[0]) + 0.5) * camera.height_px / shape[0]
    columns = (np.arange(shape[1]) + 0.5) * camera.width_px / shape[1]
    rays = rays_c(camera, np.stack(np.meshgrid(columns, rows), axis=-1))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    rays.flags.writeable = False
    return rays


def _focal(camera: CameraModel) -> FloatArray:
    """Focal length across and down in pixels."""
    return camera.focal_px * np.array([1.0, camera.lens.aspect if camera.lens else 1.0])
