"""Which pebble each pixel of a picture shows: truth for scoring, from the ground texture that was drawn.

Pebbles are part of the ground's texture and have no place in the renderer's id buffer, but a picture shows them.
"""

from __future__ import annotations

import numpy as np

from rover_sim.sim.ground_textures import GROUND_SIZE_PX, GROUND_TILE_M, Pebbles
from rover_sim.sim.renderer import GROUND_ID, RenderedImage, pose_rotation
from rover_sim.sim.textures import DRIFT_SIZE_PX, DRIFT_TILE_M, Pyramid
from worlds.types import CameraModel, FloatArray, IntArray, Pose

LEAST_PX = 1.0  # a pebble that covers less of the picture does not stand out
LEAST_STRENGTH = 0.5  # where the texture shows weaker a pixel is more soil than pebble
_STEEPEST = 0.04  # least cosine between ray and ground, as the shading has it


def clast_ids(
    picture: RenderedImage, camera: CameraModel, pose: Pose, pebbles: Pebbles, drift: Pyramid, first: int
) -> IntArray:
    """The ids (H, W) of ``picture`` with visible pebbles numbered from ``first`` on.

    A pebble is visible where it covers a pixel or more and the ground shows it. What wheels pressed in counts too.
    """
    ids = picture.ids.copy()
    rows, columns = np.nonzero(ids == GROUND_ID)
    ray = np.column_stack([columns + 0.5 - camera.width_px / 2, rows + 0.5 - camera.height_px / 2]) / camera.focal_px
    ray_w = np.column_stack([ray, np.ones(len(rows))]) @ pose_rotation(pose).T
    depth = picture.depth_m[rows, columns].astype(np.float64)
    place = pose.position_w[:2] + depth[:, None] * ray_w[:, :2]
    texel = np.floor(place * (GROUND_SIZE_PX / GROUND_TILE_M)).astype(np.int64)
    tile, texel = np.divmod(texel, GROUND_SIZE_PX)
    owner = pebbles.owner[texel[:, 1], texel[:, 0]]
    cosine = np.maximum(np.abs(ray_w[:, 2]) / np.linalg.norm(ray_w, axis=1), _STEEPEST)
    pixel_m2 = (depth / camera.focal_px) ** 2 / cosine
    shown = (owner >= 0) & (_strength(place, drift) >= LEAST_STRENGTH)
    shown[shown] = pebbles.area_m2[owner[shown]] >= LEAST_PX * pixel_m2[shown]
    key = np.column_stack([tile[shown], owner[shown]])
    _, number = np.unique(key, axis=0, return_inverse=True)
    ids[rows[shown], columns[shown]] = first + number.ravel()
    return ids


def _strength(place: FloatArray, drift: Pyramid) -> FloatArray:
    """How much of the fine texture shows (N,) at x, y (N, 2); the drift texture lies turned, as in the shading."""
    x, y = place.T
    turned = np.stack([0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y]) * (DRIFT_SIZE_PX / DRIFT_TILE_M)
    column, row = np.floor(turned).astype(np.int64) % DRIFT_SIZE_PX
    return np.asarray(drift.data[row * DRIFT_SIZE_PX + column, 3], dtype=np.float64)
