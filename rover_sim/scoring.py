"""What the picture truly shows: terrain classes from the renderer's truth, for scoring only.

Clasts are rocks and the pebbles of the ground texture alike: whoever labels a picture by eye sees no difference.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from perception.ttam import ttam
from worlds.types import IntArray, TerrainClass

WINDOW_PX = 20
FAR_M = 15.0  # beyond it a 20 px window is an unresolved band near the horizon
RESOLVED_PX = 4  # 2 x 2 pixels: a clast that covers less of the picture is not told from a grain of soil
SPECK_PX = 4  # one clast of no more in a window leaves it sand
VERY_SMALL_PX = 16  # a clast's part in a window up to 4 x 4 pixels is a very small rock
BIG_EXTENT_PX = 20
BIG_COVER = 0.40
VERY_ROUGH_COVER = 0.35
ROUGH_COVER = 0.10


def rock_extents_px(ids: IntArray) -> IntArray:
    """Longer side (pixels) of each clast's box in the whole picture, indexed by its id."""
    return _clasts(ids)[0]


def true_classes(ids: IntArray, depth_m: NDArray[np.float32]) -> NDArray[np.str_]:
    """True class letters (rows, columns) of the 20 x 20 px windows of one rendered picture (H, W).

    ``ids`` is -1 at the sky, 0 on bare ground and the clast's id elsewhere (`Renderer.clasts`). Windows that are
    mostly sky, or farther than 15 m, are U; clasts that cover less than `RESOLVED_PX` of the picture are ground. Cover
    and extent of clasts decide the rest, as in the hand labels of the six classes: S no clast or one speck; V clasts up
    to about 4 px; m larger ones, or from 10 % cover; M over 35 %; B one rock from 20 px long on 40 % of the window.
    """
    far, cover, number, largest, longest = _windows(ids, depth_m, *_clasts(ids))
    size = WINDOW_PX**2
    letters = np.full(far.shape, TerrainClass.VERY_SMALL_ROCKS.value, dtype="<U1")
    letters[(number == 0) | ((number == 1) & (largest <= SPECK_PX))] = TerrainClass.SAND.value
    letters[(cover >= ROUGH_COVER * size) | (largest > VERY_SMALL_PX)] = TerrainClass.ROUGH.value
    letters[cover > VERY_ROUGH_COVER * size] = TerrainClass.VERY_ROUGH.value
    letters[(longest >= BIG_EXTENT_PX) & (largest >= BIG_COVER * size)] = TerrainClass.BIG_ROCK.value
    letters[far > size / 2] = TerrainClass.UNCERTAIN.value
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


@njit(cache=True, nogil=True)
def _windows(ids: IntArray, depth_m: NDArray[np.float32], extent_px: IntArray, area_px: IntArray) -> IntArray:
    """Of each window (5, rows, columns): pixels too far, pixels of clasts, their number, pixels and extent of the main.

    Of clasts with as many pixels the one with the lowest id is the main one.
    """
    rows, columns = ids.shape[0] // WINDOW_PX, ids.shape[1] // WINDOW_PX
    told = np.zeros((5, rows, columns), dtype=np.int32)
    counts, met = np.zeros(len(area_px), dtype=np.int32), np.empty(WINDOW_PX**2, dtype=np.int32)
    for row in range(rows):
        for column in range(columns):
            number = 0
            for y in range(row * WINDOW_PX, (row + 1) * WINDOW_PX):
                for x in range(column * WINDOW_PX, (column + 1) * WINDOW_PX):
                    told[0, row, column] += depth_m[y, x] > FAR_M  # the sky's depth is infinite
                    clast = ids[y, x]
                    if clast > 0 and area_px[clast] >= RESOLVED_PX:
                        if counts[clast] == 0:
                            met[number] = clast
                            number += 1
                        counts[clast] += 1
            main = 0
            for clast in met[:number]:
                told[1, row, column] += counts[clast]
                if main == 0 or (counts[clast], main) > (counts[main], clast):
                    main = clast
            told[2, row, column], told[3, row, column], told[4, row, column] = number, counts[main], extent_px[main]
            counts[met[:number]] = 0
    return told


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
