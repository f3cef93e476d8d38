"""The working definition of the classes S, V, m, M and B by the clasts of each window; used on found and true clasts.

Kernels take clasts as ids (H, W), 0 or less where there is none, with area and extent (ids,) in the whole picture.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from worlds.types import FloatArray, IntArray

STAGES = ("S", "V", "m", "M", "B")  # ever more under stone; what `window_stages` counts
WINDOW_PX = 20  # the paper's sub-window
RESOLVED_PX = 4  # 2 x 2 pixels: a clast that covers less of the picture is not told from a grain of soil
SPECK_PX = 4  # one clast of no more in a window leaves it sand
VERY_SMALL_PX = 16  # a clast's part in a window up to 4 x 4 pixels is a very small rock
BIG_EXTENT_PX = 20
BIG_COVER = 0.40
VERY_ROUGH_COVER = 0.35
ROUGH_COVER = 0.10


@njit(cache=True, nogil=True)
def window_stages(ids: IntArray, area_px: IntArray, extent_px: IntArray) -> FloatArray:
    """Place in `STAGES` (rows, columns) of the class of each whole window.

    S no clast or one speck; V small clasts only; m larger ones, or from 10 % cover; M over 35 %; B one rock from 20 px
    long on 40 % of the window. Clasts under `RESOLVED_PX` are ground.
    """
    parts = window_parts(ids, area_px, RESOLVED_PX)
    stages = np.zeros(parts.shape[:2])
    for row in range(parts.shape[0]):
        for column in range(parts.shape[1]):
            number, cover, largest, main = parts[row, column]
            stages[row, column] = _stage(number, cover, largest, extent_px[main])
    return stages


@njit(cache=True, nogil=True)
def window_parts(ids: IntArray, area_px: IntArray, least_px: int) -> IntArray:
    """How many clasts of at least ``least_px`` each whole window shows, their pixels, the largest's, and its id.

    (rows, columns, 4). Of clasts with as many pixels in the window the one with the lowest id is the largest.
    """
    rows, columns = ids.shape[0] // WINDOW_PX, ids.shape[1] // WINDOW_PX
    parts = np.zeros((rows, columns, 4), dtype=np.int32)
    counts, met = np.zeros(len(area_px), dtype=np.int32), np.empty(WINDOW_PX**2, dtype=np.int32)
    for row in range(rows):
        for column in range(columns):
            number, cover = 0, 0
            for y in range(row * WINDOW_PX, (row + 1) * WINDOW_PX):
                for x in range(column * WINDOW_PX, (column + 1) * WINDOW_PX):
                    clast = ids[y, x]
                    if clast > 0 and area_px[clast] >= least_px:
                        if counts[clast] == 0:
                            met[number] = clast
                            number += 1
                        counts[clast] += 1
                        cover += 1
            largest, main = 0, 0
            for clast in met[:number]:
                if counts[clast] > largest or (counts[clast] == largest and clast < main):
                    largest, main = counts[clast], clast
            counts[met[:number]] = 0
            parts[row, column] = number, cover, largest, main
    return parts


@njit(cache=True, nogil=True)
def _stage(number: int, cover: int, largest: int, extent_px: int) -> int:
    size = WINDOW_PX**2
    if extent_px >= BIG_EXTENT_PX and largest >= BIG_COVER * size:
        return 4
    if cover > VERY_ROUGH_COVER * size:
        return 3
    if cover >= ROUGH_COVER * size or largest > VERY_SMALL_PX:
        return 2
    return 0 if number == 0 or (number == 1 and largest <= SPECK_PX) else 1
