"""Sun shadows: a map of the world, of a large one the part around the camera, laid on a level plane.

The usual map looks from the sun and wastes texels on a square around a slanted world. Here each texel is the ray of
the sun through one small square of a level plane: the projection is a shear, the texels lie along the world's axes and
keep their size on the ground at any height of the sun. The key is the height: of all points on a ray of the sun the
highest is the lit one. What lies beyond the map counts as lit.
"""

from __future__ import annotations

import numpy as np

from rover_sim.sim.raster_kernels import draw_blocks, draw_tiles
from rover_sim.sim.raster_scene import Tiles
from rover_sim.sim.shade_types import ShadowMap
from rover_sim.sim.stone_store import FINE, OCTAHEDRON, StoneStore
from worlds.heightfield import grid_points
from worlds.types import FloatArray, HeightField, IntArray, Vector3

MAP_PX = 4096  # at most; 67 MB, 1 cm over a world of 40 m
WINDOW_M = 100.0  # of a larger world this much is in the map, in texels of 2.4 cm
MOVE_M = 15.0  # the camera may be so far off the middle before the map is drawn anew
FINE_WITHIN_M = 30.0  # in a map that moves, shadows further off its middle are those of octahedra
FINEST_TEXEL_M = 0.008
LOWEST_SUN = 0.05  # sine of the elevation below which shadows no longer grow
BIAS_TEXELS = 1.3  # points are lifted so far off their surface before they are compared


class SunShadows:
    """The shadow map around the camera; of a map no larger than `WINDOW_M` it holds all, else it is drawn anew."""

    def __init__(self, ground: HeightField, tiles: Tiles, store: StoneStore, to_sun_w: Vector3) -> None:
        self._ground, self._tiles, self._store = ground, tiles, store
        self._shear = np.array(to_sun_w[:2]) / max(to_sun_w[2], LOWEST_SUN)
        self._heights = np.ascontiguousarray(ground.heights_m, dtype=np.float64)
        self._lowest_m = float(self._heights.min())
        (west, east), (south, north) = ground.x_limits_m, ground.y_limits_m
        self._moves = max(east - west, north - south) > WINDOW_M
        self._centre: FloatArray | None = None
        if not self._moves:
            self.around(np.zeros(3))  # here rather than in the first picture, which a rover waits for

    def around(self, eye_w: FloatArray) -> ShadowMap:
        """The map for a camera there."""
        limits = np.array([self._ground.x_limits_m, self._ground.y_limits_m])
        # Windows stay inside the map, so that one of its size never moves.
        slack = np.maximum(limits[:, 1] - limits[:, 0] - WINDOW_M, 0.0) / 2
        centre = np.clip(eye_w[:2], limits.mean(axis=1) - slack, limits.mean(axis=1) + slack)
        if self._centre is None or np.abs(centre - self._centre).max() > MOVE_M:
            self._centre = centre
            half = np.minimum(limits[:, 1] - limits[:, 0], WINDOW_M) / 2
            self._map = self._draw(centre - half, centre + half)
        return self._map

    def _draw(self, first_m: FloatArray, last_m: FloatArray) -> ShadowMap:
        """Draw what casts shadows on a rectangle of ground from ``first_m`` to ``last_m``, as the sun meets it."""
        tiles, store = self._tiles, self._store
        matrix, size = self._frame(first_m, last_m)
        keys, tags = np.zeros(size, dtype=np.float32), np.empty(size, dtype=np.int32)
        chosen = self._falls_on(matrix, size, tiles.centre_w, tiles.radius_m)
        corners = np.column_stack([tiles.corner[chosen], np.ones(len(chosen), dtype=np.int32)])
        grid = (*self._ground.origin_m, self._ground.resolution_m)
        draw_tiles(self._heights, grid, corners, np.zeros(len(corners)), matrix, keys, tags)
        casters = self._falls_on(matrix, size, store.centre_w, store.radius_m)
        # The camera comes no nearer to the edge of a map that moves with it.
        off = np.abs(store.centre_w[casters, :2] - (first_m + last_m) / 2).max(axis=1)
        near = (off <= FINE_WITHIN_M) | (not self._moves)
        ranges = np.concatenate([store.at(FINE, casters[near]), store.at(OCTAHEDRON, casters[~near])])
        draw_blocks(store.vertices_w, store.faces, ranges, len(store.faces), 0.0, matrix, keys, tags)
        return ShadowMap(keys, matrix)

    def _falls_on(
        self, matrix: FloatArray, size: tuple[int, int], centre_w: FloatArray, radius_m: FloatArray
    ) -> IntArray:
        """Which spheres (N, 3), (N,) are drawn, at least in part, on a map of ``size`` texels."""
        place = centre_w @ matrix[:2, :3].T + matrix[:2, 3]
        reach = radius_m[:, None] * (1.0 + np.abs(self._shear)) * matrix[0, 0]
        inside = (place + reach >= 0.0) & (place - reach <= np.array(size)[::-1])
        return np.flatnonzero(inside.all(axis=1)).astype(np.int32)

    def _frame(self, first_m: FloatArray, last_m: FloatArray) -> tuple[FloatArray, tuple[int, int]]:
        """The shear to texels and keys (4, 4), and the rows and columns that hold the rectangle at all its heights."""
        shear, store = self._shear, self._store
        x, y = grid_points(self._ground)
        columns, rows = (slice(*np.searchsorted(p, (a, b))) for p, a, b in zip((x, y), first_m, last_m, strict=True))
        here = self._heights[rows, columns]
        among = ((store.centre_w[:, :2] >= first_m) & (store.centre_w[:, :2] <= last_m)).all(axis=1)
        low, level = float(here.min()), float(here.mean())
        high = max(float(here.max()), float((store.centre_w[:, 2] + store.radius_m)[among].max(initial=-np.inf)))
        shift = np.abs(shear) * max(high - level, level - low)
        first, last = first_m - shift, last_m + shift
        texel = max(float((last - first).max()) / MAP_PX, FINEST_TEXEL_M)
        width, height = (int(n) for n in np.ceil((last - first) / texel))
        width = width // 32 * 32 + 48  # rows a power of two apart would share a few lines of the cache
        matrix = np.zeros((4, 4))
        matrix[0, [0, 2, 3]] = np.array([1.0, -shear[0], shear[0] * level - first[0]]) / texel
        matrix[1, [1, 2, 3]] = np.array([1.0, -shear[1], shear[1] * level - first[1]]) / texel
        matrix[2, 3] = 1.0
        # Keys are above zero, the empty one, everywhere on the map.
        matrix[3, 2], matrix[3, 3] = 1.0, 1.0 - self._lowest_m
        return matrix, (height, width)
