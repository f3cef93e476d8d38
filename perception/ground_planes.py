"""The ground that the wheels stand on when a rock is between them: a plane through what is seen of it around.

Soft ground rolls by a centimetre or two within a rover's length. A rock's height over the ground at its own foot is
not what the belly meets; its height over the plane of the wheels is.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from worlds.types import FloatArray

_CELL_M, _REACH_M = 0.1, 4.2  # of the cells that the points are averaged in, and how far they go
_ABOUT_M = 0.6  # around a place: as far as wheels stand that straddle it
_LEAST_POINTS, _LEAST_CELLS = 3, 30  # in a cell, and around a place
_LEVEL_M2 = 0.002  # ground is level rather than steep: variance of place that a slope has to overcome


@dataclass(frozen=True, eq=False)
class GroundPlanes:
    """Sums over the cells around each cell (rows, columns), from which its plane is solved."""

    eye_w: FloatArray  # (2,) the middle of the cells
    sums: FloatArray  # (6, rows, columns): 1, x, y, xx, xy, yy from the cell, in metres
    heights: FloatArray  # (3, rows, columns): the height times 1, x, y

    def height_m(self, place_w: FloatArray) -> float:
        """Height of the plane at a place (2,) over the plane that the points' heights are over; NaN where unknown."""
        size = self.sums.shape[1]
        column, row = np.floor((place_w - self.eye_w) / _CELL_M).astype(int) + size // 2
        if not (0 <= row < size and 0 <= column < size) or self.sums[0, row, column] < _LEAST_CELLS:
            return float("nan")
        n, x, y, xx, xy, yy = self.sums[:, row, column]
        level = _LEVEL_M2 * n
        plane = np.linalg.solve([[n, x, y], [x, xx + level, xy], [y, xy, yy + level]], self.heights[:, row, column])
        middle = self.eye_w + (np.array([column, row]) - size // 2 + 0.5) * _CELL_M
        return float(plane @ [1.0, *(place_w - middle)])


def ground_planes(places_w: FloatArray, heights_m: FloatArray, eye_w: FloatArray) -> GroundPlanes:
    """Planes by the ``heights_m`` (N,) of ground seen at ``places_w`` (N, 2), from an eye above ``eye_w`` (2,)."""
    size = 2 * int(_REACH_M / _CELL_M)
    column, row = np.floor((places_w - eye_w) / _CELL_M).astype(int).T + size // 2
    inside = (row >= 0) & (row < size) & (column >= 0) & (column < size)
    cell = row[inside] * size + column[inside]
    count = np.bincount(cell, minlength=size**2)
    total = np.bincount(cell, heights_m[inside], minlength=size**2)
    known = (count >= _LEAST_POINTS).astype(float)
    height = known * total / np.maximum(count, 1)
    steps = np.arange(-int(_ABOUT_M / _CELL_M), int(_ABOUT_M / _CELL_M) + 1) * _CELL_M
    x, y = np.meshgrid(steps, steps)
    one = (np.hypot(x, y) <= _ABOUT_M).astype(float)

    def around(layer: FloatArray, weight: FloatArray) -> FloatArray:
        return np.asarray(
            cv2.filter2D(layer.reshape(size, size), cv2.CV_64F, one * weight, borderType=cv2.BORDER_CONSTANT)
        )

    return GroundPlanes(
        eye_w,
        np.stack([around(known, weight) for weight in (np.ones_like(x), x, y, x * x, x * y, y * y)]),
        np.stack([around(height, weight) for weight in (np.ones_like(x), x, y)]),
    )
