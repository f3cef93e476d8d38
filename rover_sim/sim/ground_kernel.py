"""Bilinear heights of the ground for compiled code."""

from __future__ import annotations

from numba import njit

from worlds.types import FloatArray


@njit(cache=True)
def ground_height(heights: FloatArray, x0: float, y0: float, inverse_cell: float, x: float, y: float) -> float:
    """Height (m) at world x, y on a grid of ``1 / inverse_cell`` m from (x0, y0); its edge goes on outside."""
    rows, columns = heights.shape
    u = min(max((x - x0) * inverse_cell, 0.0), columns - 1.000001)
    v = min(max((y - y0) * inverse_cell, 0.0), rows - 1.000001)
    i, j = int(u), int(v)
    a, b = u - i, v - j
    near = heights[j, i] + a * (heights[j, i + 1] - heights[j, i])
    far = heights[j + 1, i] + a * (heights[j + 1, i + 1] - heights[j + 1, i])
    height: float = near + b * (far - near)
    return height
