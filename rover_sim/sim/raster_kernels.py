"""Compiled drawing of height grids and meshes into a key buffer and a tag buffer.

One projection serves the camera and the shadow map: a point ``p`` goes through a matrix (4, 4) to
``(u w, v w, w, k w)``. A pinhole camera has ``w`` = distance along its axis and ``k`` = 1 / w; the
shadow map has ``w`` = 1 and ``k`` = height. The *largest* key wins and 0 is empty. ``u`` runs along
columns, ``v`` along rows, in pixels, with pixel centres at +0.5. Keys are linear over the screen in
both cases, so depth is exact at every pixel.

Source of the layout: deferred z-buffer rasterisation with barycentric stepping (Pineda, "A parallel
algorithm for polygon rasterization", SIGGRAPH 1988).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.borrowed import borrowed
from worlds.types import BoolArray, FloatArray, IntArray

KeyArray = NDArray[np.float32]

NEAR = 0.05  # m: what is closer to the lens is cut away
TILE_CELLS = 32  # a tile of the height grid has this many cells a side
RINGED = TILE_CELLS + 3  # points a side, with one ring of skirt points around the tile's own
EDGE_TOLERANCE = 1e-6  # in barycentric units: neighbours overlap by a hair instead of leaving one
GROUND_TAG = 0
EMPTY_TAG = -1


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    x0: float,
    y0: float,
    k0: float,
    x1: float,
    y1: float,
    k1: float,
    x2: float,
    y2: float,
    k2: float,
    tag: int,
    keys: KeyArray,
    tags: IntArray,
) -> None:
    """Draw one triangle given in pixels and keys."""
    rows, columns = keys.shape
    first_column = max(int(np.ceil(max(min(x0, x1, x2), 0.0) - 0.5)), 0)
    last_column = int(np.floor(min(max(x0, x1, x2), columns + 0.0) - 0.5))
    if first_column > last_column:
        return
    first_row = max(int(np.ceil(max(min(y0, y1, y2), 0.0) - 0.5)), 0)
    last_row = int(np.floor(min(max(y0, y1, y2), rows + 0.0) - 0.5))
    if first_row > last_row:
        return
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if area == 0.0:
        return
    b1x, b1y = (y2 - y0) / area, (x0 - x2) / area
    b2x, b2y = (y0 - y1) / area, (x1 - x0) / area
    kx = (k1 - k0) * b1x + (k2 - k0) * b2x
    ky = (k1 - k0) * b1y + (k2 - k0) * b2y
    for row in range(first_row, last_row + 1):
        dy = row + 0.5 - y0
        for column in range(first_column, last_column + 1):
            dx = column + 0.5 - x0
            b1 = b1x * dx + b1y * dy
            b2 = b2x * dx + b2y * dy
            if b1 >= -EDGE_TOLERANCE and b2 >= -EDGE_TOLERANCE and b1 + b2 <= 1.0 + EDGE_TOLERANCE:
                key = k0 + kx * dx + ky * dy
                if key > keys[np.uintp(row), np.uintp(column)]:
                    keys[np.uintp(row), np.uintp(column)] = key
                    tags[np.uintp(row), np.uintp(column)] = tag


@njit(cache=True, nogil=True, error_model="numpy")
def _clip_and_fill(points: FloatArray, i: int, j: int, k: int, tag: int, keys: KeyArray, tags: IntArray) -> None:
    """Draw the part of a triangle beyond the near plane; ``points`` as `_project` leaves them."""
    # Scalars only: slices of arrays would take a second each to compile.
    polygon = np.empty((4, 3))
    count = 0
    for step in range(3):
        a = i if step == 0 else (j if step == 1 else k)
        b = j if step == 0 else (k if step == 1 else i)
        wa, wb = points[a, 3], points[b, 3]
        # In front a point is already divided by w, behind it is not.
        sa, sb = (wa if wa >= NEAR else 1.0), (wb if wb >= NEAR else 1.0)
        if wa >= NEAR:
            for axis in range(3):
                polygon[count, axis] = points[a, axis]
            count += 1
        if (wa >= NEAR) != (wb >= NEAR):
            t = (NEAR - wa) / (wb - wa)
            for axis in range(3):
                polygon[count, axis] = (points[a, axis] * sa * (1.0 - t) + points[b, axis] * sb * t) / NEAR
            count += 1
    for n in range(2, count):
        _fill(
            polygon[0, 0],
            polygon[0, 1],
            polygon[0, 2],
            polygon[n - 1, 0],
            polygon[n - 1, 1],
            polygon[n - 1, 2],
            polygon[n, 0],
            polygon[n, 1],
            polygon[n, 2],
            tag,
            keys,
            tags,
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _project(x: float, y: float, z: float, matrix: FloatArray, points: FloatArray, i: int) -> None:
    """Write ``(u, v, key, w)`` of a point, or ``(u w, v w, key w, w)`` where it is not beyond the near plane."""
    w = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
    scale = 1.0 / w if w >= NEAR else 1.0
    points[i, 0] = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) * scale
    points[i, 1] = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) * scale
    points[i, 2] = (matrix[3, 0] * x + matrix[3, 1] * y + matrix[3, 2] * z + matrix[3, 3]) * scale
    points[i, 3] = w


@njit(cache=True, nogil=True, error_model="numpy")
def _draw(points: FloatArray, i: int, j: int, k: int, tag: int, facing: float, keys: KeyArray, tags: IntArray) -> None:
    """Draw the triangle of three projected points; ``facing`` 1 drops faces turned away, 0 none."""
    # Unsigned indices spare the test for negative ones, here and below.
    a, b, c = np.uintp(i), np.uintp(j), np.uintp(k)
    in_front = int(points[a, 3] >= NEAR) + int(points[b, 3] >= NEAR) + int(points[c, 3] >= NEAR)
    if in_front == 3:
        x0, y0, x1, y1, x2, y2 = points[a, 0], points[a, 1], points[b, 0], points[b, 1], points[c, 0], points[c, 1]
        # Rows run downwards, so a face turned to the camera has a negative area here.
        if facing != 0.0 and ((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)) * facing >= 0.0:
            return
        _fill(x0, y0, points[a, 2], x1, y1, points[b, 2], x2, y2, points[c, 2], tag, keys, tags)
    elif in_front > 0:
        _clip_and_fill(points, i, j, k, tag, keys, tags)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_tiles(
    heights: FloatArray,
    grid: tuple[float, float, float],
    tiles: IntArray,
    drops: FloatArray,
    matrix: FloatArray,
    keys: KeyArray,
    tags: IntArray,
) -> None:
    """Draw tiles of a height grid, two triangles a cell, with a skirt that hides cracks between strides.

    ``heights`` (ny, nx) m; ``grid`` = world x, y of the first sample and the spacing, m; ``tiles`` (T, 3) first
    row, first column and stride in samples; ``drops`` (T,) m, depth of the skirt; ``matrix`` (4, 4).
    """
    _draw_tiles(heights, grid, tiles, drops, matrix, keys, tags, np.empty((RINGED * RINGED, 4)))


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_tiles(
    heights: FloatArray,
    grid: tuple[float, float, float],
    tiles: IntArray,
    drops: FloatArray,
    matrix: FloatArray,
    keys: KeyArray,
    tags: IntArray,
    points: FloatArray,
) -> None:
    ny, nx = heights.shape
    side = RINGED
    heights, matrix, points = borrowed(heights), borrowed(matrix), borrowed(points)
    keys, tags = borrowed(keys), borrowed(tags)
    for tile in range(tiles.shape[0]):
        row0, column0, stride = tiles[tile, 0], tiles[tile, 1], tiles[tile, 2]
        last_row, last_column = min(row0 + TILE_CELLS, ny - 1), min(column0 + TILE_CELLS, nx - 1)
        rows = (last_row - row0 + stride - 1) // stride + 3
        columns = (last_column - column0 + stride - 1) // stride + 3
        for i in range(rows):
            row = min(row0 + max(i - 1, 0) * stride, last_row)
            for j in range(columns):
                column = min(column0 + max(j - 1, 0) * stride, last_column)
                z = heights[row, column]
                if i == 0 or j == 0 or i == rows - 1 or j == columns - 1:
                    z -= drops[tile]
                _project(grid[0] + grid[2] * column, grid[1] + grid[2] * row, z, matrix, points, i * side + j)
        for i in range(rows - 1):
            for j in range(columns - 1):
                a = i * side + j
                _draw(points, a, a + 1, a + side + 1, GROUND_TAG, 0.0, keys, tags)
                _draw(points, a, a + side + 1, a + side, GROUND_TAG, 0.0, keys, tags)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_blocks(
    vertices: FloatArray,
    faces: IntArray,
    ranges: IntArray,
    ground_from: int,
    facing: float,
    matrix: FloatArray,
    keys: KeyArray,
    tags: IntArray,
) -> None:
    """Draw blocks of a mesh; face ``i`` leaves tag ``i + 1``, or the ground's from face ``ground_from`` on.

    ``vertices`` (V, 3) m; ``faces`` (F, 3); ``ranges`` (B, 4) first and past-last vertex and face of each block.
    """
    longest = 0
    for block in range(ranges.shape[0]):
        longest = max(longest, ranges[block, 1] - ranges[block, 0])
    _draw_blocks(vertices, faces, ranges, ground_from, facing, matrix, keys, tags, np.empty((longest, 4)))


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_blocks(
    vertices: FloatArray,
    faces: IntArray,
    ranges: IntArray,
    ground_from: int,
    facing: float,
    matrix: FloatArray,
    keys: KeyArray,
    tags: IntArray,
    points: FloatArray,
) -> None:
    vertices, matrix, points = borrowed(vertices), borrowed(matrix), borrowed(points)
    keys, tags = borrowed(keys), borrowed(tags)
    for block in range(ranges.shape[0]):
        first = ranges[block, 0]
        for i in range(first, ranges[block, 1]):
            _project(vertices[i, 0], vertices[i, 1], vertices[i, 2], matrix, points, i - first)
        for face in range(ranges[block, 2], ranges[block, 3]):
            a, b, c = faces[face, 0] - first, faces[face, 1] - first, faces[face, 2] - first
            tag = face + 1 if face < ground_from else GROUND_TAG
            _draw(points, a, b, c, tag, facing, keys, tags)


@njit(cache=True, nogil=True, error_model="numpy")
def touches_pyramid(centres: FloatArray, radii: FloatArray, eye: FloatArray, planes: FloatArray) -> BoolArray:
    """Which spheres (N, 3), (N,) touch the viewing pyramid: bool (N,).

    ``planes`` (5, 3) inward unit normals through the eye, the forward one last: it cuts at the near distance.
    """
    found = np.empty(centres.shape[0], dtype=np.bool_)
    for i in range(centres.shape[0]):
        x, y, z = centres[i, 0] - eye[0], centres[i, 1] - eye[1], centres[i, 2] - eye[2]
        inside = True
        for k in range(5):
            least = NEAR - radii[i] if k == 4 else -radii[i]
            inside = inside and planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z >= least
        found[i] = inside
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def measure_tiles(
    heights: FloatArray, corners: IntArray, strides: IntArray, low: FloatArray, high: FloatArray, error: FloatArray
) -> None:
    """Lowest and highest height (T,) of tiles, far edges included, and the height error (T, S) of each stride, m.

    The error is how far the ground drawn with a stride may be from a sample; a bound, as it takes both diagonals.
    """
    ny, nx = heights.shape
    for tile in range(corners.shape[0]):
        row0, column0 = corners[tile, 0], corners[tile, 1]
        last_row, last_column = min(row0 + TILE_CELLS, ny - 1), min(column0 + TILE_CELLS, nx - 1)
        least, most = heights[row0, column0], heights[row0, column0]
        for row in range(row0, last_row + 1):
            for column in range(column0, last_column + 1):
                least, most = min(least, heights[row, column]), max(most, heights[row, column])
        low[tile], high[tile] = least, most
        for s in range(strides.shape[0]):
            stride = strides[s]
            worst = 0.0
            for r0 in range(row0, last_row, stride):
                r1 = min(r0 + stride, last_row)
                for c0 in range(column0, last_column, stride):
                    c1 = min(c0 + stride, last_column)
                    a, b, c, d = heights[r0, c0], heights[r0, c1], heights[r1, c0], heights[r1, c1]
                    twist = abs(a - b - c + d) / 4.0
                    for row in range(r0, r1 + 1):
                        v = (row - r0) / (r1 - r0)
                        left, right = (1.0 - v) * a + v * c, (1.0 - v) * b + v * d
                        for column in range(c0, c1 + 1):
                            u = (column - c0) / (c1 - c0)
                            off = abs(heights[row, column] - ((1.0 - u) * left + u * right))
                            worst = max(worst, off + twist)
            error[tile, s] = worst
