"""Sun shadows: one map of the whole world, laid on a level plane.

The usual map looks from the sun and wastes texels on a square around a slanted world. Here each texel is the ray of
the sun through one small square of a level plane: the projection is a shear, the texels lie along the world's axes and
keep their size on the ground at any height of the sun. The key is the height: of all points on a ray of the sun the
highest is the lit one.
"""

from __future__ import annotations

import numpy as np

from rover_sim.sim.raster_kernels import TILE_CELLS, draw_blocks, draw_tiles
from rover_sim.sim.raster_scene import Blocks
from rover_sim.sim.shade_types import ShadowMap
from worlds.types import FloatArray, HeightField, Vector3

MAP_PX = 4096  # at most; 67 MB, 1 cm over a world of 40 m
FINEST_TEXEL_M = 0.008
LOWEST_SUN = 0.05  # sine of the elevation below which shadows no longer grow
BIAS_TEXELS = 1.3  # points are lifted so far off their surface before they are compared


def make_shadow_map(ground: HeightField, blocks: Blocks, to_sun_w: Vector3) -> ShadowMap:
    """Draw ground and rocks as the sun meets them."""
    heights = np.ascontiguousarray(ground.heights_m, dtype=np.float64)
    matrix, size = _frame(ground, blocks, to_sun_w)
    keys, tags = np.zeros(size, dtype=np.float32), np.empty(size, dtype=np.int32)
    ny, nx = heights.shape
    corner = np.stack(np.meshgrid(np.arange(0, ny - 1, TILE_CELLS), np.arange(0, nx - 1, TILE_CELLS)), -1).reshape(
        -1, 2
    )
    tiles = np.column_stack([corner, np.ones(len(corner))]).astype(np.int32)
    draw_tiles(heights, (*ground.origin_m, ground.resolution_m), tiles, np.zeros(len(tiles)), matrix, keys, tags)
    draw_blocks(blocks.vertices_w, blocks.faces, blocks.all_fine(), blocks.apron_face, 0.0, matrix, keys, tags)
    return ShadowMap(keys, matrix)


def _frame(ground: HeightField, blocks: Blocks, to_sun_w: Vector3) -> tuple[FloatArray, tuple[int, int]]:
    """The shear to texels and keys (4, 4), and the rows and columns that hold the world."""
    shear = np.array(to_sun_w[:2]) / max(to_sun_w[2], LOWEST_SUN)
    low = float(ground.heights_m.min())
    high = max([float(ground.heights_m.max()), *(blocks.centre_w[:, 2] + blocks.radius_m)])
    level = float(ground.heights_m.mean())
    shift = np.abs(shear) * max(high - level, level - low)
    first = np.array([ground.x_limits_m[0], ground.y_limits_m[0]]) - shift
    last = np.array([ground.x_limits_m[1], ground.y_limits_m[1]]) + shift
    texel = max(float((last - first).max()) / MAP_PX, FINEST_TEXEL_M)
    columns, rows = (int(n) for n in np.ceil((last - first) / texel))
    matrix = np.zeros((4, 4))
    matrix[0, [0, 2, 3]] = np.array([1.0, -shear[0], shear[0] * level - first[0]]) / texel
    matrix[1, [1, 2, 3]] = np.array([1.0, -shear[1], shear[1] * level - first[1]]) / texel
    matrix[2, 3] = 1.0
    matrix[3, 2], matrix[3, 3] = 1.0, 1.0 - low  # keys are above zero, the empty one
    return matrix, (rows, columns)
