"""Pictures of boards through lenses that are known exactly, by ray casting in numpy."""

from __future__ import annotations

import numpy as np

from perception.camera import grid_rays_c
from perception.lens import distort
from worlds.types import BoolArray, ByteArray, CameraModel, FloatArray

SAMPLES = 3  # a pixel, across and down
WHITE, BLACK = 230.0, 25.0


def turned(about_x: float, about_y: float, about_z: float) -> FloatArray:
    """Rotation matrix (3, 3) of turns about the three axes in that order."""
    cx, sx, cy, sy, cz, sz = (f(a) for a in (about_x, about_y, about_z) for f in (np.cos, np.sin))
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(z @ y @ x)


def board_views(count: int, width: float, height: float, distance: float) -> list[tuple[FloatArray, FloatArray]]:
    """Rotation and place of the board's origin before the camera, the board's middle all over the picture."""
    rng = np.random.default_rng(5)
    views = []
    for i in range(count):
        tilt = rng.uniform(-0.5, 0.5, 2)
        rotation = turned(tilt[0], tilt[1], rng.uniform(-0.3, 0.3))
        spot = np.array([(i % 3 - 1) * 0.35, (i // 3 % 3 - 1) * 0.25, 1.0]) * distance * rng.uniform(0.8, 1.2)
        views.append((rotation, spot - rotation @ np.array([width / 2, height / 2, 0.0])))
    return views


def picture(
    camera: CameraModel, view: tuple[FloatArray, FloatArray], board: tuple[int, int], spacing: float, pattern: str
) -> ByteArray:
    """Grey picture of a board whose point (0, 0) lies at the view's place, its rows along the board's x."""
    rotation, place = view
    rays = grid_rays_c(camera, (camera.height_px * SAMPLES, camera.width_px * SAMPLES))
    normal = rotation[:, 2]
    with np.errstate(invalid="ignore"):
        depth = (place @ normal) / (rays @ normal)
        on_board = ((rays * depth[..., None] - place) @ rotation)[..., :2] / spacing
        dark = _dark(on_board, board, pattern)
    unseen = np.isnan(on_board).any(axis=-1)
    grey = np.where(np.logical_or(dark, unseen), BLACK, WHITE)
    grey = grey.reshape(camera.height_px, SAMPLES, camera.width_px, SAMPLES).mean(axis=(1, 3))
    return np.asarray(np.round(grey), dtype=np.uint8)


def _dark(on_board: FloatArray, board: tuple[int, int], pattern: str) -> BoolArray:
    x, y = on_board[..., 0], on_board[..., 1]
    if pattern == "checkerboard":  # point (0, 0) is the first inner corner
        squares = (np.floor(x) + np.floor(y)) % 2 == 0
        inside = (x > -1) & (y > -1) & (x < board[0]) & (y < board[1])
        return np.asarray(squares & inside)
    column = np.round((x - np.round(y) % 2) / 2) * 2 + np.round(y) % 2 if pattern == "acircles" else np.round(x)
    last = 2 * board[0] - 1 if pattern == "acircles" else board[0] - 1
    inside = (column >= 0) & (column <= last) & (np.round(y) >= 0) & (np.round(y) < board[1])
    radius = 0.5 if pattern == "acircles" else 0.28
    return np.asarray(inside & (np.hypot(x - column, y - np.round(y)) < radius))


def true_points(camera: CameraModel, view: tuple[FloatArray, FloatArray], places: FloatArray) -> FloatArray:
    """Pixels (N, 2) of places (N, 2) on the board."""
    points = np.column_stack([places, np.zeros(len(places))]) @ view[0].T + view[1]
    ideal = points[:, :2] / points[:, 2:]
    assert camera.lens is not None
    focal = camera.focal_px * np.array([1.0, camera.lens.aspect])
    return distort(camera.lens, ideal) * focal + camera.centre_px
