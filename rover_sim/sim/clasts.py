"""Which pebble each pixel of a picture shows: truth for scoring, from the ground texture that was drawn.

Pebbles are part of the ground's texture and have no place in the renderer's id buffer, but a picture shows them.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.ground_textures import GROUND_SIZE_PX, GROUND_TILE_M, Pebbles
from rover_sim.sim.renderer import GROUND_ID, RenderedImage, pose_rotation
from rover_sim.sim.textures import DRIFT_SIZE_PX, DRIFT_TILE_M, Pyramid
from worlds.types import CameraModel, FloatArray, IntArray, Pose

SingleArray = NDArray[np.float32]
Places = NDArray[np.int64]
LEAST_PX = 1.0  # a pebble that covers less of the picture does not stand out
LEAST_STRENGTH = 0.5  # where the texture shows weaker a pixel is more soil than pebble
_STEEPEST = 0.04  # least cosine between ray and ground, as the shading has it
_TEXELS_PER_M = GROUND_SIZE_PX / GROUND_TILE_M
_TILES = 1 << 15  # on either side of the origin: 131 km


def clast_ids(
    picture: RenderedImage, camera: CameraModel, pose: Pose, pebbles: Pebbles, strength: SingleArray, first: int
) -> IntArray:
    """The ids (H, W) of ``picture`` with visible pebbles numbered from ``first`` on.

    ``strength`` (texels,): that of the fine texture, row by row of the broad one (`strength_of`).
    A pebble is visible where it covers a pixel or more and the ground shows it. What wheels pressed in counts too.
    """
    ids = picture.ids.copy()
    lens = (camera.width_px / 2, camera.height_px / 2, camera.focal_px)
    pixels, keys = _shown(picture, pose, lens, pebbles.owner, pebbles.area_m2, strength)
    _, number = np.unique(keys, return_inverse=True)
    ids.ravel()[pixels] = first + number
    return ids


def strength_of(drift: Pyramid) -> SingleArray:
    """How strong the fine texture shows (texels,), from the broad one."""
    return np.ascontiguousarray(drift.finest()[..., 3]).ravel()


def _shown(
    picture: RenderedImage,
    pose: Pose,
    lens: tuple[float, float, float],
    owner: IntArray,
    area_m2: FloatArray,
    strength: SingleArray,
) -> tuple[Places, Places]:
    """Flat places (N,) of the pixels that show a pebble, and a number (N,) for each pebble of each tile."""
    return _shown_kernel(
        picture.ids, picture.depth_m, pose.position_w, pose_rotation(pose), lens, owner, area_m2, strength
    )


@njit(cache=True, nogil=True)
def _shown_kernel(
    ids: IntArray,
    depth_m: SingleArray,
    eye_w: FloatArray,
    r: FloatArray,
    lens: tuple[float, float, float],
    owner: IntArray,
    area_m2: FloatArray,
    strength: SingleArray,
) -> tuple[Places, Places]:
    pixels, keys = np.empty(ids.size, dtype=np.int64), np.empty(ids.size, dtype=np.int64)
    found, columns, fine, broad = 0, ids.shape[1], GROUND_SIZE_PX - 1, DRIFT_SIZE_PX - 1
    per_m = DRIFT_SIZE_PX / DRIFT_TILE_M
    for row in range(ids.shape[0]):
        for column in range(columns):
            if ids[row, column] != GROUND_ID:
                continue
            u, v, depth = (column + 0.5 - lens[0]) / lens[2], (row + 0.5 - lens[1]) / lens[2], depth_m[row, column]
            dx, dy = r[0, 0] * u + r[0, 1] * v + r[0, 2], r[1, 0] * u + r[1, 1] * v + r[1, 2]
            x, y = eye_w[0] + depth * dx, eye_w[1] + depth * dy
            tx, ty = int(np.floor(x * _TEXELS_PER_M)), int(np.floor(y * _TEXELS_PER_M))
            pebble = owner[ty & fine, tx & fine]
            if pebble < 0:
                continue
            # How much of the fine texture shows there; the drift texture lies turned, as in the shading.
            i, j = int(np.floor((0.6 * x + 0.8 * y) * per_m)), int(np.floor((0.8 * x - 0.6 * y) * per_m))
            dz = r[2, 0] * u + r[2, 1] * v + r[2, 2]
            cosine = max(abs(dz) / np.sqrt(dx * dx + dy * dy + dz * dz), _STEEPEST)
            large = area_m2[pebble] >= LEAST_PX * (depth / lens[2]) ** 2 / cosine
            if large and strength[(i & broad) * DRIFT_SIZE_PX + (j & broad)] >= LEAST_STRENGTH:
                pixels[found] = row * columns + column
                tile = (tx // GROUND_SIZE_PX + _TILES) * 2 * _TILES + ty // GROUND_SIZE_PX + _TILES
                keys[found] = tile * len(area_m2) + pebble
                found += 1
    return pixels[:found], keys[:found]
