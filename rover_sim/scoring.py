"""What the picture truly shows: terrain classes from the renderer's truth, for scoring only.

Clasts are rocks and the pebbles of the ground texture alike: whoever labels a picture by eye sees no difference.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from perception.class_definition import RESOLVED_PX, STAGES, WINDOW_PX, window_stages
from perception.ttam import ttam
from worlds.types import BoolArray, IntArray, TerrainClass

FAR_M = 15.0  # beyond it a 20 px window is an unresolved band near the horizon


def rock_extents_px(ids: IntArray) -> IntArray:
    """Longer side (pixels) of each clast's box in the whole picture, indexed by its id."""
    return _clasts(ids)[0]


def resolved(ids: IntArray) -> BoolArray:
    """Which pixels (H, W) show a clast that is large enough in the picture not to be a grain of soil."""
    return np.asarray((ids > 0) & (_clasts(ids)[1][np.maximum(ids, 0)] >= RESOLVED_PX))


def true_classes(ids: IntArray, depth_m: NDArray[np.float32]) -> NDArray[np.str_]:
    """True class letters (rows, columns) of the 20 x 20 px windows of one rendered picture (H, W).

    ``ids`` is -1 at the sky, 0 on bare ground and the clast's id elsewhere (`Renderer.clasts`). Windows that are
    mostly sky, or farther than 15 m, are U; the rest follows `window_stages`, as the hand labels of the six classes.
    """
    extent_px, area_px = _clasts(ids)
    letters = np.array(STAGES)[window_stages(ids, area_px, extent_px).astype(np.intp)]
    letters[_far_px(depth_m) > WINDOW_PX**2 / 2] = TerrainClass.UNCERTAIN.value
    return letters


@njit(cache=True, nogil=True)
def _clasts(ids: IntArray) -> tuple[IntArray, IntArray]:
    """Longer side of its box and area (ids,) of each clast, in pixels of the whole picture."""
    count = max(ids.max(), 0) + 1
    extent_px, area_px = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.int32)
    boxes = np.zeros((count, 4), dtype=np.int32)  # first and last row, first and last column
    for row in range(ids.shape[0]):
        for column in range(ids.shape[1]):
            clast = ids[row, column]
            if clast > 0:
                if area_px[clast] == 0:
                    boxes[clast, 0], boxes[clast, 2] = row, column
                area_px[clast] += 1
                boxes[clast, 1] = row
                boxes[clast, 2], boxes[clast, 3] = min(boxes[clast, 2], column), max(boxes[clast, 3], column)
                extent_px[clast] = max(row - boxes[clast, 0], boxes[clast, 3] - boxes[clast, 2]) + 1
    return extent_px, area_px


def _far_px(depth_m: NDArray[np.float32]) -> IntArray:
    """Pixels (rows, columns) of each window that are too far; the sky's depth is infinite."""
    rows, columns = depth_m.shape[0] // WINDOW_PX, depth_m.shape[1] // WINDOW_PX
    far = depth_m[: rows * WINDOW_PX, : columns * WINDOW_PX] > FAR_M
    return np.asarray(far.reshape(rows, WINDOW_PX, columns, WINDOW_PX).sum(axis=(1, 3)), dtype=np.int32)


def _resampled(buffer: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """The buffer's nearest pixels at another (rows, columns)."""
    rows, columns = (
        ((np.arange(count) + 0.5) * length / count).astype(int)
        for count, length in zip(size, buffer.shape, strict=True)
    )
    return buffer if buffer.shape == size else buffer[np.ix_(rows, columns)]


class ClassScore:
    """TTAM over all pictures of a traverse."""

    def __init__(self) -> None:
        self._true: list[NDArray[np.str_]] = []
        self._found: list[NDArray[np.str_]] = []

    def add(self, ids: IntArray, depth_m: NDArray[np.float32], found: NDArray[np.str_]) -> None:
        """Compare one picture's classes with the truth, seen at the size at which the classes were found."""
        size = found.shape[0] * WINDOW_PX, found.shape[1] * WINDOW_PX
        self._true.append(true_classes(_resampled(ids, size), _resampled(depth_m, size)))
        self._found.append(found)

    def ttam(self) -> float | None:
        """TTAM in percent with U at weight 1; None without a picture."""
        return ttam(np.stack(self._true), np.stack(self._found)) if self._true else None
