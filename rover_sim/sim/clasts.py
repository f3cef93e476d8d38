"""Which pebble each pixel of a picture shows: truth for scoring, from the ground texture that was drawn.

Pebbles are part of the ground's texture and have no place in the renderer's id buffer, but a picture shows them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.ground_textures import GROUND_SIZE_PX, GROUND_TILE_M, Pebbles
from rover_sim.sim.renderer import GROUND_ID, RenderedImage, pose_rotation
from rover_sim.sim.textures import DRIFT_SIZE_PX, DRIFT_TILE_M, Pyramid
from worlds.types import ByteArray, CameraModel, FloatArray, IntArray, Pose

SingleArray = NDArray[np.float32]
Places = NDArray[np.int64]
LEAST_PX = 1.0  # a pebble that covers less of the picture does not stand out
LEAST_STRENGTH = 0.5  # where the texture shows weaker a pixel is more soil than pebble
_STEEPEST = 0.04  # least cosine between ray and ground, as the shading has it
_TEXELS_PER_M = GROUND_SIZE_PX / GROUND_TILE_M
_TILES = 1 << 15  # on either side of the origin: 131 km


class PebbleMap(NamedTuple):
    """The pebbles of a ground tile, ready to be looked up: most texels show none, and bits stay in the cache."""

    there: ByteArray  # (N, N / 8) a bit a texel, the lowest first
    owner: IntArray  # (N, N) which pebble
    area_m2: FloatArray  # (P,)
    largest_m2: float


def pebble_map(pebbles: Pebbles) -> PebbleMap:
    """Ready to be looked up."""
    there = np.packbits(pebbles.owner >= 0, axis=1, bitorder="little")
    return PebbleMap(there, pebbles.owner, pebbles.area_m2, float(pebbles.area_m2.max(initial=0.0)))


def clast_ids(
    picture: RenderedImage, camera: CameraModel, pose: Pose, pebbles: PebbleMap, strength: SingleArray, first: int
) -> IntArray:
    """The ids (H, W) of ``picture`` with visible pebbles numbered from ``first`` on.

    ``strength`` (texels,): that of the fine texture, row by row of the broad one (`strength_of`).
    A pebble is visible where it covers a pixel or more and the ground shows it. What wheels pressed in counts too.
    """
    ids = picture.ids.copy()
    lens = (camera.width_px / 2, camera.height_px / 2, camera.focal_px)
    pixels, keys = _shown(ids, picture.depth_m, pose.position_w, pose_rotation(pose), lens, pebbles, strength)
    _, number = np.unique(keys, return_inverse=True)
    ids.ravel()[pixels] = first + number
    return ids


def strength_of(drift: Pyramid) -> SingleArray:
    """How strong the fine texture shows (texels,), from the broad one."""
    return np.ascontiguousarray(drift.finest()[..., 3]).ravel()


@njit(cache=True, nogil=True)
def _shown(
    ids: IntArray,
    depth_m: SingleArray,
    eye_w: FloatArray,
    r: FloatArray,
    lens: tuple[float, float, float],
    pebbles: PebbleMap,
    strength: SingleArray,
) -> tuple[Places, Places]:
    """Flat places (N,) of the pixels that show a pebble, and a number (N,) for each pebble of each tile."""
    pixels, keys = np.empty(ids.size, dtype=np.int64), np.empty(ids.size, dtype=np.int64)
    columns, fine, broad = ids.shape[1], GROUND_SIZE_PX - 1, DRIFT_SIZE_PX - 1
    texels_x, texels_y = np.empty(columns, dtype=np.int64), np.empty(columns, dtype=np.int64)
    per_m, found = DRIFT_SIZE_PX / DRIFT_TILE_M, 0
    for row in range(ids.shape[0]):
        v = (row + 0.5 - lens[1]) / lens[2]
        farthest_m = _farthest_m(r, v, lens, columns, pebbles.largest_m2)
        # Where all pixels of a row lie is reckoned first: that alone takes many at a time.
        for column in range(columns):
            u, depth = (column + 0.5 - lens[0]) / lens[2], min(depth_m[row, column], np.float32(farthest_m))
            dx, dy = r[0, 0] * u + r[0, 1] * v + r[0, 2], r[1, 0] * u + r[1, 1] * v + r[1, 2]
            texels_x[column] = int(np.floor((eye_w[0] + depth * dx) * _TEXELS_PER_M))
            texels_y[column] = int(np.floor((eye_w[1] + depth * dy) * _TEXELS_PER_M))
        for column in range(columns):
            tx, ty, depth = texels_x[column], texels_y[column], depth_m[row, column]
            if ids[row, column] != GROUND_ID or depth > farthest_m:
                continue
            if not (pebbles.there[ty & fine, (tx & fine) >> 3] >> (tx & 7)) & 1:
                continue
            pebble = pebbles.owner[ty & fine, tx & fine]
            u = (column + 0.5 - lens[0]) / lens[2]
            dx, dy = r[0, 0] * u + r[0, 1] * v + r[0, 2], r[1, 0] * u + r[1, 1] * v + r[1, 2]
            x, y = eye_w[0] + depth * dx, eye_w[1] + depth * dy
            # How much of the fine texture shows there; the drift texture lies turned, as in the shading.
            i, j = int(np.floor((0.6 * x + 0.8 * y) * per_m)), int(np.floor((0.8 * x - 0.6 * y) * per_m))
            dz = r[2, 0] * u + r[2, 1] * v + r[2, 2]
            cosine = max(abs(dz) / np.sqrt(dx * dx + dy * dy + dz * dz), _STEEPEST)
            large = pebbles.area_m2[pebble] >= LEAST_PX * (depth / lens[2]) ** 2 / cosine
            if large and strength[(i & broad) * DRIFT_SIZE_PX + (j & broad)] >= LEAST_STRENGTH:
                pixels[found] = row * columns + column
                tile = (tx // GROUND_SIZE_PX + _TILES) * 2 * _TILES + ty // GROUND_SIZE_PX + _TILES
                keys[found] = tile * len(pebbles.area_m2) + pebble
                found += 1
    return pixels[:found], keys[:found]


@njit(cache=True, nogil=True)
def _farthest_m(r: FloatArray, v: float, lens: tuple[float, float, float], columns: int, largest_m2: float) -> float:
    """Depth beyond which not even the largest pebble covers a pixel of a row, with a little to spare."""
    left, right = (0.5 - lens[0]) / lens[2], (columns - 0.5 - lens[0]) / lens[2]
    down = max(abs(r[2, 0] * left + r[2, 1] * v + r[2, 2]), abs(r[2, 0] * right + r[2, 1] * v + r[2, 2]))
    cosine = max(down / np.sqrt(1.0 + v * v), _STEEPEST)
    return float(1.0001 * lens[2] * np.sqrt(largest_m2 * cosine / LEAST_PX))
