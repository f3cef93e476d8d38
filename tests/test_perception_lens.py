from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.camera import grid_rays_c, project, rays_c
from perception.ground import beyond_horizon, depression_rad, ground_points
from perception.lens import distort, undistort
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.types import CameraModel, FloatArray, GroundPlane, Lens, Pose

LEVEL = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
BARREL = Lens("brown", (-0.28, 0.09, 0.0012, -0.0008, -0.012), (158.0, 123.0), 1.02)
FISHEYE = Lens("fisheye", (-0.03, 0.004, -0.002, 0.0003), (161.0, 118.0), 0.99)
LENSES = pytest.mark.parametrize("lens", [BARREL, FISHEYE], ids=["brown", "fisheye"])


def camera_with(lens: Lens) -> CameraModel:
    return CameraModel(320, 240, 160.0, (0.0, 0.0, 1.1), float(np.deg2rad(25.0)), lens)


def pose_of(camera: CameraModel, roll: float = 0.0, pitch: float = 0.0) -> Pose:
    return camera_pose(Pose(np.zeros(3), quaternion_from_euler(roll, pitch, 0.3)), camera)


def points(half: float) -> FloatArray:
    across = np.linspace(-half, half, 21)
    return np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)


@LENSES
def test_distortion_is_that_of_opencv(lens: Lens) -> None:
    ideal = points(0.9)
    space = np.column_stack([ideal, np.ones(len(ideal))])[:, None]
    still = np.zeros(3)
    coefficients = np.array(lens.coefficients)
    if lens.model == "brown":
        theirs, _ = cv2.projectPoints(space, still, still, np.eye(3), coefficients)
    else:
        theirs, _ = cv2.fisheye.projectPoints(space, still, still, np.eye(3), coefficients)
    assert distort(lens, ideal) == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


coefficient = st.floats(-0.3, 0.3)


@settings(max_examples=60, deadline=None)
@given(coefficient, st.floats(-0.1, 0.1), st.floats(-0.003, 0.003), st.floats(-0.003, 0.003), st.floats(-0.02, 0.02))
def test_undistortion_inverts_or_says_nan(k1: float, k2: float, p1: float, p2: float, k3: float) -> None:
    for lens in (
        Lens("brown", (k1, k2, p1, p2, k3), (0.0, 0.0)),
        Lens("fisheye", (k1, k2, p1, p2), (0.0, 0.0)),
    ):
        sensor = points(0.7)
        ideal = undistort(lens, sensor)
        known = np.asarray(np.isfinite(ideal).all(axis=1))
        assert distort(lens, ideal[known]) == pytest.approx(sensor[known], abs=1e-8)
        assert known[len(sensor) // 2]  # the axis is always seen


@LENSES
def test_beyond_the_reach_of_the_polynomial_there_is_no_ray(lens: Lens) -> None:
    folding = Lens(lens.model, (-0.5, *(0.0,) * (len(lens.coefficients) - 1)), (160.0, 120.0))
    camera = camera_with(folding)
    assert np.isnan(rays_c(camera, np.array([[1e4, 120.0], [-1e4, 120.0]]))[:, :2]).all()
    assert rays_c(camera, np.array([160.0, 120.0])).tolist() == [0.0, 0.0, 1.0]


@LENSES
@given(
    u=st.floats(0.0, 320.0),
    v=st.floats(110.0, 240.0),
    roll=st.floats(-0.15, 0.15),
    pitch=st.floats(-0.15, 0.15),
)
def test_pixel_to_ground_and_back(lens: Lens, u: float, v: float, roll: float, pitch: float) -> None:
    camera = camera_with(lens)
    pose = pose_of(camera, roll, pitch)
    point = ground_points(camera, pose, LEVEL, np.array([u, v]))
    if np.isnan(point).any() or np.linalg.norm(point) > 200.0:
        return
    assert point[2] == pytest.approx(0.0, abs=1e-9)
    pixel, _ = project(camera, pose, point)
    assert pixel == pytest.approx([u, v], abs=1e-4)


@LENSES
def test_without_distortion_a_lens_is_a_pinhole(lens: Lens) -> None:
    if lens.model == "fisheye":  # a fisheye is one only where the angle is the tangent
        coefficients: tuple[float, ...] = (1 / 3, 2 / 15, 17 / 315, 62 / 2835)  # the series of the tangent
        allowed = 2e-4
    else:
        coefficients, allowed = (0.0,) * 5, 1e-12
    straight = camera_with(Lens(lens.model, coefficients, (160.0, 120.0)))
    pixels = points(70.0) + 160.0
    expected = rays_c(CameraModel(320, 240, 160.0), pixels)
    assert rays_c(straight, pixels) == pytest.approx(expected, abs=allowed)


@LENSES
def test_the_horizon_bends_with_the_lens(lens: Lens) -> None:
    camera = camera_with(lens)
    pose = pose_of(camera, roll=0.1)
    dip = np.deg2rad(2.0)
    far = beyond_horizon(camera, pose, LEVEL, (240, 320), float(dip))
    rows, columns = np.indices(far.shape)
    angle = depression_rad(camera, pose, LEVEL, np.stack([columns + 0.5, rows + 0.5], axis=-1))
    assert (far == ~(angle >= dip)).all()
    edge = (~far).argmax(axis=0)  # first row of ground
    across = np.arange(320)
    bend = edge - np.polyval(np.polyfit(across, edge, 1), across)
    assert np.abs(bend).max() > 3.0


def test_a_smaller_picture_looks_along_the_same_rays() -> None:
    camera = camera_with(BARREL)
    large, small = grid_rays_c(camera, (240, 320)), grid_rays_c(camera, (120, 160))
    between = large[::2, ::2] + large[1::2, 1::2] + large[::2, 1::2] + large[1::2, ::2]
    between /= np.linalg.norm(between, axis=-1, keepdims=True)
    seen = ~np.isnan(between[..., 0])  # the corners are beyond this lens
    assert 0.9 < seen.mean() < 1.0
    assert small[seen] == pytest.approx(between[seen], abs=2e-3)
