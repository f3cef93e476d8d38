"""Sampling of height fields: the bilinear surface over the grid, its gradient and its normal."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from worlds.types import BoolArray, FloatArray, HeightField, IntArray

_BAND_ROWS = 512  # worked out at a time, so that a large map needs little memory


def height_at(field: HeightField, x_m: ArrayLike, y_m: ArrayLike) -> FloatArray:
    """Height in metres of the bilinear surface at world points, in the broadcast shape of ``x_m`` and ``y_m``.

    Outside the map the nearest edge height is continued; `contains` tells the two apart.
    """
    row, column, v, u = _cell(field, x_m, y_m)
    h00, h01, h10, h11 = _corners(field, row, column)
    return np.asarray((1 - v) * ((1 - u) * h00 + u * h01) + v * ((1 - u) * h10 + u * h11))


def gradient_at(field: HeightField, x_m: ArrayLike, y_m: ArrayLike) -> FloatArray:
    """Slope (..., 2) along x and y of the surface that `height_at` samples; it jumps from cell to cell."""
    row, column, v, u = _cell(field, x_m, y_m)
    h00, h01, h10, h11 = _corners(field, row, column)
    along_x = (1 - v) * (h01 - h00) + v * (h11 - h10)
    along_y = (1 - u) * (h10 - h00) + u * (h11 - h01)
    return np.stack([along_x, along_y], axis=-1) / field.resolution_m


def normal_at(field: HeightField, x_m: ArrayLike, y_m: ArrayLike) -> FloatArray:
    """Unit upward normal (..., 3) of the surface at world points."""
    slope = gradient_at(field, x_m, y_m)
    normal = np.concatenate([-slope, np.ones((*slope.shape[:-1], 1))], axis=-1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def contains(field: HeightField, x_m: ArrayLike, y_m: ArrayLike, margin_m: float = 0.0) -> BoolArray:
    """Whether world points lie on the map, at least ``margin_m`` inside its edge."""
    x, y = np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64)
    (west, east), (south, north) = field.x_limits_m, field.y_limits_m
    inside_x = (x >= west + margin_m) & (x <= east - margin_m)
    return np.asarray(inside_x & (y >= south + margin_m) & (y <= north - margin_m))


def window(field: HeightField, x_limits_m: tuple[float, float], y_limits_m: tuple[float, float]) -> HeightField:
    """The part of the field between some x and some y, limits included; a view, not a copy."""
    x, y = grid_points(field)
    slack = 1e-6 * field.resolution_m
    (left, right), (bottom, top) = (
        np.searchsorted(axis, (low - slack, high + slack)).tolist()
        for axis, (low, high) in ((x, x_limits_m), (y, y_limits_m))
    )
    origin = (field.origin_m[0] + left * field.resolution_m, field.origin_m[1] + bottom * field.resolution_m)
    return HeightField(field.heights_m[bottom:top, left:right], field.resolution_m, origin)


def slope_deg(field: HeightField) -> FloatArray:
    """Steepness (ny, nx) in degrees at the grid points, by central differences."""
    steepness = np.empty(field.heights_m.shape)
    for first in range(0, len(steepness), _BAND_ROWS):
        last, before = min(first + _BAND_ROWS, len(steepness)), max(first - 1, 0)
        along_y, along_x = np.gradient(field.heights_m[before : last + 1], field.resolution_m)
        rise = np.hypot(along_x, along_y)[first - before : last - before]
        steepness[first:last] = np.degrees(np.arctan(rise))
    return steepness


def grid_points(field: HeightField) -> tuple[FloatArray, FloatArray]:
    """World x (nx,) of the columns and y (ny,) of the rows."""
    ny, nx = field.heights_m.shape
    x = field.origin_m[0] + field.resolution_m * np.arange(nx)
    y = field.origin_m[1] + field.resolution_m * np.arange(ny)
    return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


def _cell(field: HeightField, x_m: ArrayLike, y_m: ArrayLike) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Row and column of the cell under each point, and the place within it, 0 to 1 (across rows, across columns)."""
    ny, nx = field.heights_m.shape
    x, y = np.broadcast_arrays(np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64))
    column = np.clip((x - field.origin_m[0]) / field.resolution_m, 0, nx - 1)
    row = np.clip((y - field.origin_m[1]) / field.resolution_m, 0, ny - 1)
    left = np.minimum(column.astype(np.int32), nx - 2)
    low = np.minimum(row.astype(np.int32), ny - 2)
    return low, left, row - low, column - left


def _corners(field: HeightField, row: IntArray, column: IntArray) -> tuple[FloatArray, ...]:
    h = field.heights_m
    return h[row, column], h[row, column + 1], h[row + 1, column], h[row + 1, column + 1]
