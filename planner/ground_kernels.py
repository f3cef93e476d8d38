"""Compiled inner loops over the cells of the ground."""

from __future__ import annotations

from math import ceil, cos, floor, sin, sqrt

import numba as nb
import numpy as np
from numpy.typing import NDArray

from worlds.types import BoolArray, ByteArray, FloatArray

Layer = NDArray[np.float32]


@nb.njit(cache=True)
def fill_polygon(mask: ByteArray, outline: FloatArray, value: int) -> None:
    """Sets the cells ``[row, column]`` whose middle lies inside a polygon (M, 2) of (column, row): even-odd rule."""
    rows, columns = mask.shape
    count = outline.shape[0]
    crossings = np.empty(count)
    for row in range(max(0, floor(outline[:, 1].min())), min(rows, ceil(outline[:, 1].max()))):
        y = row + 0.5
        met = 0
        for m in range(count):
            x0, y0 = outline[m - 1, 0], outline[m - 1, 1]
            x1, y1 = outline[m, 0], outline[m, 1]
            if (y0 > y) != (y1 > y):
                crossings[met] = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
                met += 1
        crossings[:met].sort()
        for pair in range(0, met - 1, 2):
            first = max(0, ceil(crossings[pair] - 0.5))
            last = min(columns - 1, ceil(crossings[pair + 1] - 0.5) - 1)
            for column in range(first, last + 1):
                mask[row, column] = value


@nb.njit(cache=True)
def nearest_values(centres: FloatArray, values: FloatArray, first: FloatArray, step: float, out: Layer) -> None:
    """Fills ``out`` [row, column] with the value of the nearest of ``centres`` (N, 2) within a metre, else NaN."""
    out[:] = np.nan
    nearest = np.ones(out.shape)  # squared distance
    reach = 1.0 / step + 1.0  # cells about a centre that it may be the nearest of
    for n in range(centres.shape[0]):
        at_column, at_row = (centres[n, 0] - first[0]) / step, (centres[n, 1] - first[1]) / step
        for row in range(max(0, floor(at_row - reach)), min(out.shape[0], ceil(at_row + reach))):
            for column in range(max(0, floor(at_column - reach)), min(out.shape[1], ceil(at_column + reach))):
                x, y = first[0] + column * step, first[1] + row * step
                dx, dy = centres[n, 0] - x, centres[n, 1] - y
                squared = dx * dx + dy * dy
                if squared < nearest[row, column]:
                    nearest[row, column] = squared
                    out[row, column] = values[n]


@nb.njit(cache=True)
def note_cells(
    mask: ByteArray,
    rough: Layer,
    block: int,
    place: FloatArray,
    cell: float,
    plane: tuple[float, float, float],
    errors: tuple[float, float],
    time_s: float,
    source: int,
    layers: tuple[ByteArray, Layer, Layer, Layer, Layer],
) -> None:
    """Takes a view into the window of the cells that ``mask`` marks.

    ``layers``: source, seen_s, height, variance, roughness, all ``[row, column]`` as the mask; ``rough``: the view's
    own roughness, one value a block of cells, NaN where it says nothing; ``place``: of the viewer, in cells of the
    window; ``plane``: height at the window's corner and its rise a cell along columns and rows; ``errors``: one sigma
    of the height at the viewer, and how much more a metre away.
    """
    sources, seen_s, height, variance, roughness = layers
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column] == 0:
                continue
            dx, dy = column + 0.5 - place[0], row + 0.5 - place[1]
            away = cell * sqrt(dx * dx + dy * dy)
            sd = errors[0] + errors[1] * away
            # All views share the error of the ground plane: the surest one is kept, not their mean.
            if sources[row, column] == 0 or sd * sd <= variance[row, column]:
                height[row, column] = plane[0] + plane[1] * (column + 0.5) + plane[2] * (row + 0.5)
                variance[row, column] = sd * sd
                sources[row, column] = source
            seen_s[row, column] = time_s
            value = rough[row // block, column // block]
            if np.isfinite(value):
                # Near views say more: half of a cell's value is replaced at 2 m, a sixth at 6 m.
                share = min(max(1.0 / max(away, 1.0), 0.1), 1.0)
                roughness[row, column] += share * (value - roughness[row, column])


@nb.njit(cache=True)
def sample_grid(
    sources: ByteArray,
    roughness: Layer,
    first: FloatArray,
    cell: float,
    frame: tuple[float, float, float],
    grid: tuple[float, float, float, float],
    unseen: Layer,
    rough: Layer,
) -> None:
    """Fills ``unseen`` (1 or 0) and ``rough`` (nx, ny) from the cells ``[iy, ix]`` whose corner lies at ``first``.

    ``frame``: origin and heading of the grid's own frame; ``grid``: its first point and its steps.
    """
    x0, y0, heading = frame
    c, s = cos(heading), sin(heading)
    rows, columns = sources.shape
    for i in range(unseen.shape[0]):
        along = grid[0] + i * grid[2]
        for j in range(unseen.shape[1]):
            across = grid[1] + j * grid[3]
            column = floor((x0 + along * c - across * s - first[0]) / cell)
            row = floor((y0 + along * s + across * c - first[1]) / cell)
            known = 0 <= column < columns and 0 <= row < rows
            unseen[i, j] = 0.0 if known and sources[row, column] > 0 else 1.0
            rough[i, j] = roughness[row, column] if known else 0.0


@nb.njit(cache=True)
def nearest_views(
    sources: ByteArray,
    variance: Layer,
    first: FloatArray,
    cell: float,
    errors: tuple[float, float],
    place: tuple[float, float],
    low: tuple[float, float],
    step: float,
    shape: tuple[int, int],
) -> Layer:
    """Distance ``shape`` (nx, ny) from which places were seen at the nearest, or are now where they never were.

    The places lie ``step`` apart from ``low`` on; ``place`` is the rover's. A view's error of height, ``errors`` at the
    rover and a metre away, tells how far off it was.
    """
    rows, columns = sources.shape
    away = np.empty(shape, dtype=np.float32)
    for i in range(shape[0]):
        x = low[0] + i * step
        column = floor((x - first[0]) / cell)
        for j in range(shape[1]):
            y = low[1] + j * step
            row = floor((y - first[1]) / cell)
            now = sqrt((x - place[0]) ** 2 + (y - place[1]) ** 2)
            if 0 <= column < columns and 0 <= row < rows and sources[row, column] > 0:
                now = min(now, max(sqrt(variance[row, column]) - errors[0], 0.0) / errors[1])
            away[i, j] = now
    return away


@nb.njit(cache=True)
def inside_polygon(outline: FloatArray, points: FloatArray) -> BoolArray:
    """Which points (N, 2) lie inside a polygon (M, 2): even-odd rule."""
    inside = np.zeros(len(points), dtype=np.bool_)
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        for m in range(len(outline)):
            ax, ay = outline[m, 0], outline[m, 1]
            bx, by = outline[(m + 1) % len(outline), 0], outline[(m + 1) % len(outline), 1]
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside[n] = not inside[n]
    return inside
