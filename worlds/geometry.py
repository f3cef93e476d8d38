"""Quaternions ``(x, y, z, w)`` and rotation matrices, and where the camera is."""

from __future__ import annotations

from math import asin, atan2, cos, pi, sin

import numpy as np

from worlds.types import CameraModel, FloatArray, Pose, Vector3


def rotation_from_quaternion(quaternion: FloatArray) -> FloatArray:
    """Rotation matrix (3, 3) of a unit quaternion (4,): columns are the body axes in the world."""
    x, y, z, w = np.asarray(quaternion, dtype=float).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product (3,) of two vectors (3,); NumPy's own costs ten times as much."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def quaternion_from_rotation(rotation: FloatArray) -> FloatArray:
    """Unit quaternion (4,) with w >= 0 of a rotation matrix (3, 3), by the largest component."""
    m = rotation
    squared = np.array(
        [
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
            1 + m[0, 0] + m[1, 1] + m[2, 2],
        ]
    )
    products = np.array(
        [
            [squared[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
            [m[0, 1] + m[1, 0], squared[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squared[2], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squared[3]],
        ]
    )
    quaternion = products[int(np.argmax(squared))]
    quaternion = quaternion / np.linalg.norm(quaternion)
    return np.asarray(quaternion if quaternion[3] >= 0 else -quaternion)


def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> FloatArray:
    """Unit quaternion (4,) of roll about x, then pitch about y, then yaw about z (nose down is positive pitch)."""
    cr, sr = cos(roll_rad / 2), sin(roll_rad / 2)
    cp, sp = cos(pitch_rad / 2), sin(pitch_rad / 2)
    cy, sy = cos(yaw_rad / 2), sin(yaw_rad / 2)
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def euler_from_quaternion(quaternion: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw in radians, the inverse of `quaternion_from_euler`."""
    x, y, z, w = np.asarray(quaternion, dtype=float).tolist()
    roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
    yaw = atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


def wrap_angle(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (float(angle_rad) + pi) % (2 * pi) - pi


def camera_pose(body: Pose, camera: CameraModel) -> Pose:
    """World pose of the camera (axes right, down, forward) on a rover at ``body``."""
    sin, cos = np.sin(camera.pitch_rad), np.cos(camera.pitch_rad)
    # Columns: camera right, down and forward in body axes.
    camera_in_body = np.array([[0.0, -sin, cos], [-1.0, 0.0, 0.0], [0.0, -cos, -sin]])
    body_in_world = rotation_from_quaternion(body.quaternion_w)
    position = body.position_w + body_in_world @ np.asarray(camera.position_b)
    return Pose(position, quaternion_from_rotation(body_in_world @ camera_in_body))


def to_the_right(pose: Pose, distance_m: float) -> Pose:
    """Pose of a camera ``distance_m`` along the first axis (right) of another, its axes parallel."""
    return Pose(pose.position_w + distance_m * rotation_from_quaternion(pose.quaternion_w)[:, 0], pose.quaternion_w)


def to_sun(azimuth_deg: float, elevation_deg: float) -> Vector3:
    """Unit vector to the sun; azimuth from +x counter-clockwise, elevation over the level, in degrees."""
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    level = float(np.cos(elevation))
    return level * float(np.cos(azimuth)), level * float(np.sin(azimuth)), float(np.sin(elevation))
