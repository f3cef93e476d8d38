"""What of the ground is drawn: tiles with levels of detail, and the apron around the map.

Ground tiles come in strides of 1, 2, 4 ... samples. A tile is drawn with the coarsest stride whose height error
stays under half a pixel from where the camera is (geometrical mipmapping: de Boer, "Fast terrain rendering using
geometrical mipmapping", 2000).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_sim.sim.raster_kernels import NEAR, TILE_CELLS, measure_tiles, touches_pyramid
from worlds.types import BoolArray, FloatArray, HeightField, IntArray, TriangleMesh

STRIDES = (1, 2, 4, 8, 16, 32)
TOLERANCE_PX = 0.5  # height error of a coarse tile on the screen
APRON_M = (4.0, 300.0)  # widths of two rings of ground around the map, so that the world does not end in a cliff
APRON_STEP = 16  # the outer ring has a vertex for so many of the map's edge


@dataclass(frozen=True, eq=False)
class View:
    """A pinhole camera in the world."""

    eye_w: FloatArray  # (3,)
    rotation: FloatArray  # (3, 3), columns are the camera's right, down and forward in the world
    focal_px: float
    width_px: int
    height_px: int

    def matrix(self) -> FloatArray:
        """Projection (4, 4) for the raster kernels: key = 1 / depth."""
        turn = np.eye(4)
        turn[:3, :3] = self.rotation.T
        turn[:3, 3] = -self.rotation.T @ self.eye_w
        f, cx, cy = self.focal_px, self.width_px / 2.0, self.height_px / 2.0
        lens = np.array([[f, 0, cx, 0], [0, f, cy, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        return np.asarray(lens @ turn)

    def sees(self, centres_w: FloatArray, radii_m: FloatArray) -> BoolArray:
        """Which spheres (N, 3), (N,) touch the viewing pyramid: bool (N,)."""
        f, w, h = self.focal_px, self.width_px / 2.0, self.height_px / 2.0
        planes = np.array([[f, 0, w], [-f, 0, w], [0, f, h], [0, -f, h], [0, 0, 1]], dtype=float)
        planes /= np.linalg.norm(planes, axis=1, keepdims=True)
        return np.asarray(touches_pyramid(centres_w, radii_m, self.eye_w, planes @ self.rotation.T))


@dataclass(frozen=True, eq=False)
class Tiles:
    """The ground in tiles of `TILE_CELLS` cells a side."""

    corner: IntArray  # (T, 2) first row and column
    centre_w: FloatArray  # (T, 3) of the bounding sphere
    radius_m: FloatArray  # (T,)
    error_m: FloatArray  # (T, len(STRIDES)) greatest height error of each stride, growing

    def choose(self, view: View) -> tuple[IntArray, FloatArray]:
        """Tiles to draw (K, 3): row, column, stride; and the skirt depth of each (K,) in metres."""
        seen = np.flatnonzero(view.sees(self.centre_w, self.radius_m))
        distance = np.linalg.norm(self.centre_w[seen] - view.eye_w, axis=1) - self.radius_m[seen]
        allowed_m = TOLERANCE_PX * np.maximum(distance, NEAR) / view.focal_px
        level = (self.error_m[seen] <= allowed_m[:, None]).sum(axis=1) - 1
        chosen = np.column_stack([self.corner[seen], np.asarray(STRIDES)[level]])
        # Two neighbours may be apart by both their errors; a tile further away was allowed more.
        drop_m = 4.0 * TOLERANCE_PX * (np.maximum(distance, NEAR) + 2 * self.radius_m[seen]) / view.focal_px
        return np.ascontiguousarray(chosen, dtype=np.int32), drop_m


def make_tiles(ground: HeightField) -> Tiles:
    """Cut the ground into tiles, with their bounds and the error of every stride."""
    ny, nx = ground.heights_m.shape
    rows, columns = np.arange(0, ny - 1, TILE_CELLS), np.arange(0, nx - 1, TILE_CELLS)
    corner = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)
    last = np.minimum(corner + TILE_CELLS, [ny - 1, nx - 1])
    low, high, error = np.empty(len(corner)), np.empty(len(corner)), np.zeros((len(corner), len(STRIDES)))
    heights = np.ascontiguousarray(ground.heights_m, dtype=np.float64)
    # Stride 1 draws every sample.
    measure_tiles(heights, corner, np.array(STRIDES[1:]), low, high, error[:, 1:])
    x0, y0 = ground.origin_m
    lower = np.column_stack([x0 + ground.resolution_m * corner[:, 1], y0 + ground.resolution_m * corner[:, 0], low])
    upper = np.column_stack([x0 + ground.resolution_m * last[:, 1], y0 + ground.resolution_m * last[:, 0], high])
    return Tiles(
        corner=corner.astype(np.int32),
        centre_w=(lower + upper) / 2,
        radius_m=np.linalg.norm(upper - lower, axis=1) / 2,
        error_m=np.maximum.accumulate(error, axis=1),
    )


def ground_plane(ground: HeightField) -> tuple[float, float, float]:
    """Least-squares plane ``z = a x + b y + c`` of the ground, as (a, b, c); a coarse grid of samples is enough."""
    step = max(min(ground.heights_m.shape) // 64, 1)
    z = ground.heights_m[::step, ::step]
    y, x = np.indices(z.shape) * step * ground.resolution_m
    columns = np.column_stack([x.ravel() + ground.origin_m[0], y.ravel() + ground.origin_m[1], np.ones(z.size)])
    a, b, c = np.linalg.lstsq(columns, z.ravel(), rcond=None)[0]
    return float(a), float(b), float(c)


def make_apron(ground: HeightField) -> TriangleMesh:
    """Rings of triangles around the map that run from its edge to its mean plane and on to the horizon."""
    edge = _edge_loop(ground)
    near, far = (_pushed_out(edge, width_m, ground_plane(ground)) for width_m in APRON_M)
    # Along a straight edge the near ring is straight too, so fewer vertices leave no gap as long as corners stay.
    ny, nx = ground.heights_m.shape
    corners = np.cumsum([0, nx - 1, ny - 1, nx - 1])
    few = np.union1d(np.arange(0, len(edge), APRON_STEP), corners)
    n, m = len(edge), len(few)
    faces = np.concatenate([_band(np.arange(n), n + np.arange(n)), _band(n + few, 2 * n + np.arange(m))])
    return TriangleMesh(np.concatenate([edge, near, far[few]]), faces, np.zeros(len(faces), dtype=np.int32))


def _pushed_out(loop: FloatArray, width_m: float, plane: tuple[float, float, float]) -> FloatArray:
    """A loop around the map, ``width_m`` further out on each side and on the plane."""
    low, high = loop[:, :2].min(axis=0), loop[:, :2].max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    xy = middle + (loop[:, :2] - middle) * (half + width_m) / half
    return np.column_stack([xy, xy @ np.array(plane[:2]) + plane[2]])


def _band(inner: NDArray[np.integer], outer: NDArray[np.integer]) -> IntArray:
    """Triangles (2 N, 3) between two loops of as many vertices, upwards."""
    i, o, j, p = inner, outer, np.roll(inner, -1), np.roll(outer, -1)
    return np.concatenate([np.column_stack([i, o, p]), np.column_stack([i, p, j])]).astype(np.int32)


def _edge_loop(ground: HeightField) -> FloatArray:
    """The samples (N, 3) on the map's edge, counter-clockwise from the first one."""
    ny, nx = ground.heights_m.shape
    row = np.concatenate([np.zeros(nx - 1), np.arange(ny - 1), np.full(nx - 1, ny - 1), np.arange(ny - 1, 0, -1)])
    column = np.concatenate([np.arange(nx - 1), np.full(ny - 1, nx - 1), np.arange(nx - 1, 0, -1), np.zeros(ny - 1)])
    row, column = row.astype(int), column.astype(int)
    x0, y0 = ground.origin_m
    return np.column_stack(
        [x0 + ground.resolution_m * column, y0 + ground.resolution_m * row, ground.heights_m[row, column]]
    )
