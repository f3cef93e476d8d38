"""Between pixels and the ground that the rover believes it stands on.

A picture row maps to a ground distance that grows as the ray gets flatter; rows per metre fall as one over the
distance squared (the 2004 paper, section 3, on the compression of the obstacle map).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from perception.camera import grid_rays_c, rays_w
from worlds.geometry import rotation_from_quaternion
from worlds.types import BoolArray, CameraModel, FloatArray, GroundPlane, Pose


def height_over(plane: GroundPlane, points_w: FloatArray) -> FloatArray:
    """Height (...,) of points (..., 3) over the plane, along its normal, in metres."""
    return np.asarray((np.asarray(points_w, dtype=float) - plane.point_w) @ plane.normal_w)


def ground_points(camera: CameraModel, camera_pose: Pose, plane: GroundPlane, pixels: FloatArray) -> FloatArray:
    """World points (..., 3) where the rays of ``pixels`` (..., 2) meet the plane; NaN at and above the horizon."""
    return _met(camera_pose, plane, rays_w(camera, camera_pose, pixels))


def _met(camera_pose: Pose, plane: GroundPlane, rays: FloatArray) -> FloatArray:
    """World points (..., 3) where ``rays`` (..., 3) in world axes meet the plane; NaN where they do not."""
    fall = -(rays @ plane.normal_w)
    distance = float(height_over(plane, camera_pose.position_w)) / np.where(fall > 1e-9, fall, np.nan)
    return np.asarray(camera_pose.position_w + np.where(distance > 0, distance, np.nan)[..., None] * rays)


def depression_rad(camera: CameraModel, camera_pose: Pose, plane: GroundPlane, pixels: FloatArray) -> FloatArray:
    """Angle (...,) of the rays of ``pixels`` (..., 2) below the plane's horizon, in radians."""
    rays = rays_w(camera, camera_pose, pixels)
    return np.asarray(np.arcsin(-(rays @ plane.normal_w) / np.linalg.norm(rays, axis=-1)))


def beyond_horizon(
    camera: CameraModel, camera_pose: Pose, plane: GroundPlane, shape: tuple[int, int], dip_rad: float = 0.0
) -> BoolArray:
    """Pixels (rows, columns) of a picture of ``shape`` above the plane's horizon, or where the lens sees nothing.

    ``dip_rad`` lowers the line by that depression angle: what lies above it is too far to judge. Through a real lens
    the horizon is a curve, so each pixel is asked for its own ray.
    """
    normal_c = rotation_from_quaternion(camera_pose.quaternion_w).T @ plane.normal_w
    return ~falling(grid_rays_c(camera, shape), normal_c, float(np.sin(dip_rad)))


@njit(cache=True)
def falling(rays_c: FloatArray, normal_c: FloatArray, least: float) -> BoolArray:
    """Which unit rays (rows, columns, 3) point down by at least a sine, against a normal (3,) in the same axes."""
    answer = np.empty(rays_c.shape[:2], dtype=np.bool_)
    x, y, z = normal_c[0], normal_c[1], normal_c[2]
    for row in range(rays_c.shape[0]):
        for column in range(rays_c.shape[1]):
            fall = -(rays_c[row, column, 0] * x + rays_c[row, column, 1] * y + rays_c[row, column, 2] * z)
            answer[row, column] = fall >= least
    return answer


def ground_range(camera_pose: Pose, plane: GroundPlane, points_w: FloatArray) -> FloatArray:
    """Distance (...,) along the plane from the foot of the camera to points (..., 3), in metres."""
    offset = np.asarray(points_w, dtype=float) - camera_pose.position_w
    along = offset - (offset @ plane.normal_w)[..., None] * plane.normal_w
    return np.asarray(np.linalg.norm(along, axis=-1))


def range_sd(
    range_m: FloatArray, camera_height_m: float, angle_sd_rad: float, ground_sd_m: float, slope_sd: float
) -> FloatArray:
    """One sigma (...,) of the ground range along the line of sight, in metres.

    With range r = h / tan(d) an angle error e moves the point by e (h^2 + r^2) / h, and ground that is higher or
    lower than believed by s moves it by s r / h, the height error over the grazing slope. Rolling ground leaves the
    believed plane the more the farther away: s is ``ground_sd_m`` and ``slope_sd`` times the range together.
    """
    r = np.asarray(range_m, dtype=float)
    by_angle = angle_sd_rad * (camera_height_m**2 + r**2) / camera_height_m
    by_height = np.hypot(ground_sd_m, slope_sd * r) * r / camera_height_m
    return np.asarray(np.hypot(by_angle, by_height))


def window_centres(
    camera: CameraModel, camera_pose: Pose, plane: GroundPlane, shape: tuple[int, int], max_range_m: float
) -> FloatArray:
    """Ground x, y (rows, columns, 2) under the centres of ``shape`` windows; NaN in the sky and beyond the range."""
    points = _window_points(camera, camera_pose, plane, shape)
    near = ground_range(camera_pose, plane, points) <= max_range_m
    return np.asarray(np.where(near[..., None], points[..., :2], np.nan))


def window_ranges(camera: CameraModel, camera_pose: Pose, plane: GroundPlane, shape: tuple[int, int]) -> FloatArray:
    """Ground distance (rows, columns), m, of the centres of ``shape`` windows; NaN at and above the horizon."""
    return ground_range(camera_pose, plane, _window_points(camera, camera_pose, plane, shape))


def _window_points(camera: CameraModel, camera_pose: Pose, plane: GroundPlane, shape: tuple[int, int]) -> FloatArray:
    """World points (rows, columns, 3) under the centres of ``shape`` windows."""
    rays = grid_rays_c(camera, shape) @ rotation_from_quaternion(camera_pose.quaternion_w).T
    return _met(camera_pose, plane, rays)


def footprint(
    camera: CameraModel, camera_pose: Pose, plane: GroundPlane, max_range_m: float, columns: int = 9
) -> FloatArray:
    """Outline (N, 2) of the ground in view up to ``max_range_m``, counter-clockwise; empty without ground."""
    across = np.linspace(0.0, camera.width_px, columns)
    near = ground_points(
        camera, camera_pose, plane, np.column_stack([across, np.full(columns, float(camera.height_px))])
    )
    if np.isnan(near).any() or height_over(plane, camera_pose.position_w) <= 0:
        return np.empty((0, 2))
    foot = camera_pose.position_w - height_over(plane, camera_pose.position_w) * plane.normal_w
    top_pixels = np.column_stack([across, np.zeros(columns)])
    rays = rays_w(camera, camera_pose, top_pixels)
    direction = rays - (rays @ plane.normal_w)[:, None] * plane.normal_w
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    top_range = ground_range(camera_pose, plane, ground_points(camera, camera_pose, plane, top_pixels))
    reach = np.fmin(np.where(np.isnan(top_range), max_range_m, top_range), max_range_m)
    far = foot + reach[:, None] * direction
    # Seen from above: along the near edge from left to right, then back along the far edge.
    return np.concatenate([near, far[::-1]])[:, :2]
