from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.camera import project, rays_c
from perception.ground import (
    beyond_horizon,
    depression_rad,
    footprint,
    ground_points,
    ground_range,
    range_sd,
    window_centres,
)
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.types import CameraModel, FloatArray, GroundPlane, Pose

CAMERA = CameraModel(320, 240, 207.8, (0.0, 0.0, 1.1), float(np.deg2rad(25.0)))
LEVEL = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))


def pose_at(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, xyz: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Pose:
    return camera_pose(Pose(np.array(xyz), quaternion_from_euler(roll, pitch, yaw)), CAMERA)


def area(outline: FloatArray) -> float:
    x, y = outline.T
    return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def test_the_middle_of_the_picture_is_straight_ahead() -> None:
    assert rays_c(CAMERA, np.array([160.0, 120.0])).tolist() == [0.0, 0.0, 1.0]


def test_the_middle_row_lies_at_height_over_tangent_of_pitch() -> None:
    point = ground_points(CAMERA, pose_at(), LEVEL, np.array([160.0, 120.0]))
    assert point == pytest.approx([1.1 / np.tan(np.deg2rad(25.0)), 0.0, 0.0], abs=1e-12)


def test_a_row_lies_where_the_reference_formula_puts_it() -> None:
    # d = h / tan(pitch + atan((v - v0) / f))
    for v in (60.0, 150.0, 239.5):
        point = ground_points(CAMERA, pose_at(), LEVEL, np.array([160.0, v]))
        assert point[0] == pytest.approx(1.1 / np.tan(np.deg2rad(25.0) + np.arctan((v - 120.0) / 207.8)))


@given(
    st.floats(0.0, 320.0), st.floats(60.0, 240.0), st.floats(-0.15, 0.15), st.floats(-0.15, 0.15), st.floats(-3.0, 3.0)
)
def test_pixel_to_ground_and_back(u: float, v: float, roll: float, pitch: float, yaw: float) -> None:
    pose = pose_at(roll, pitch, yaw, (3.0, -2.0, 0.4))
    normal = np.array([0.05, -0.03, 1.0])
    plane = GroundPlane(np.array([3.0, -2.0, 0.4]), normal / np.linalg.norm(normal))
    point = ground_points(CAMERA, pose, plane, np.array([u, v]))
    if np.isnan(point).any():
        return
    assert (point - plane.point_w) @ plane.normal_w == pytest.approx(0.0, abs=1e-8)
    pixel, depth = project(CAMERA, pose, point)
    assert pixel == pytest.approx([u, v], abs=1e-6)
    assert depth > 0


def test_points_behind_have_no_pixel() -> None:
    pixel, depth = project(CAMERA, pose_at(), np.array([-5.0, 0.0, 0.0]))
    assert np.isnan(pixel).all()
    assert depth < 0


def test_the_horizon_of_a_level_camera_is_one_row() -> None:
    row = 120.0 - 207.8 * np.tan(np.deg2rad(25.0))  # 23.1
    far = beyond_horizon(CAMERA, pose_at(), LEVEL, (240, 320))
    assert (far == (np.arange(240)[:, None] + 0.5 < row)).all()


def test_roll_tilts_the_horizon_and_pixels_over_it_never_meet_the_ground() -> None:
    pose = pose_at(roll=0.1, pitch=-0.05)
    far = beyond_horizon(CAMERA, pose, LEVEL, (240, 320))
    rows = far.sum(axis=0)
    # Rolled to the right side down, the horizon rises on the right.
    assert rows[0] > rows[160] > rows[319]
    pixels = np.stack(np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5), axis=-1)
    assert (np.isnan(ground_points(CAMERA, pose, LEVEL, pixels)[..., 0]) == far).all()


def test_the_dip_is_an_angle_under_the_horizon() -> None:
    dip = np.deg2rad(2.0)
    far = beyond_horizon(CAMERA, pose_at(), LEVEL, (240, 320), float(dip))
    edge = np.stack([np.arange(320) + 0.5, far.sum(axis=0).astype(float)], axis=-1)
    below = depression_rad(CAMERA, pose_at(), LEVEL, edge)
    assert below == pytest.approx(np.full(320, dip), abs=0.5 / 207.8)


def test_uncertainty_grows_with_range_as_worked_by_hand() -> None:
    # 0.01 rad at 3 m from 1 m up: 0.01 (1 + 9) / 1 = 0.1 m; 0.02 m of height: 0.06 m.
    assert range_sd(np.array([3.0]), 1.0, 0.01, 0.0, 0.0)[0] == pytest.approx(0.1)
    assert range_sd(np.array([3.0]), 1.0, 0.0, 0.02, 0.0)[0] == pytest.approx(0.06)
    assert range_sd(np.array([3.0]), 1.0, 0.0, 0.0, 0.03)[0] == pytest.approx(0.27)
    assert np.all(np.diff(range_sd(np.linspace(0.5, 10.0, 30), 1.1, 0.005, 0.02, 0.03)) > 0)


def test_window_centres_lie_on_the_ground_under_their_windows() -> None:
    centres = window_centres(CAMERA, pose_at(), LEVEL, (12, 16), 10.0)
    assert centres.shape == (12, 16, 2)
    assert np.isnan(centres[0]).all()  # above the horizon
    assert np.isnan(centres[1]).all()  # row 30 looks 0.03 rad down: farther than 10 m
    expected = ground_points(CAMERA, pose_at(), LEVEL, np.array([150.0, 230.0]))[:2]
    assert centres[11, 7] == pytest.approx(expected)


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-3.1, 3.1))
def test_the_footprint_runs_counter_clockwise_within_reach(roll: float, pitch: float, yaw: float) -> None:
    pose = pose_at(roll, pitch, yaw, (1.0, 2.0, 0.0))
    outline = footprint(CAMERA, pose, LEVEL, 10.0)
    assert area(outline) > 10.0
    points = np.column_stack([outline, np.zeros(len(outline))])
    assert ground_range(pose, LEVEL, points).max() <= 10.0 + 1e-9
    pixels, _ = project(CAMERA, pose, points)
    assert (pixels >= -1e-6).all()
    assert (pixels <= [320 + 1e-6, 240 + 1e-6]).all()


def test_a_camera_that_looks_up_sees_no_ground() -> None:
    assert footprint(CAMERA, pose_at(pitch=-1.2), LEVEL, 10.0).shape == (0, 2)
