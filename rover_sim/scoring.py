"""What the picture truly shows: terrain classes from the renderer's truth, for scoring only.

Clasts are rocks and the pebbles of the ground texture alike: whoever labels a picture by eye sees no difference.
"""

from __future__ import annotations

from typing import Any

import numpy as np
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
    rows, columns = np.nonzero(ids > 0)
    owner = ids[rows, columns]
    count = int(owner.max(initial=0)) + 1
    low = np.full((count, 2), np.iinfo(np.int32).max)
    high = np.full((count, 2), -1)
    for axis, values in enumerate((rows, columns)):
        np.minimum.at(low[:, axis], owner, values)
        np.maximum.at(high[:, axis], owner, values)
    return np.asarray(np.maximum((high - low + 1).max(axis=1), 0), dtype=np.int32)


def resolved(ids: IntArray) -> IntArray:
    """``ids`` (H, W) with the clasts that cover less than `RESOLVED_PX` of the picture taken for ground."""
    lifted = np.maximum(ids, 0)
    small = np.bincount(lifted.ravel()) < RESOLVED_PX
    return np.where((ids > 0) & small[lifted], 0, ids)


def _window_class(pixels: IntArray, extent_px: IntArray) -> TerrainClass:
    """Class of one near window with at least one clast pixel, by the working definitions of the six classes."""
    owners, counts = np.unique(pixels[pixels > 0], return_counts=True)
    cover = counts.sum() / pixels.size
    largest = int(np.argmax(counts))
    if extent_px[owners[largest]] >= BIG_EXTENT_PX and counts[largest] >= BIG_COVER * pixels.size:
        return TerrainClass.BIG_ROCK
    if cover > VERY_ROUGH_COVER:
        return TerrainClass.VERY_ROUGH
    if cover >= ROUGH_COVER or counts[largest] > VERY_SMALL_PX:
        return TerrainClass.ROUGH
    return TerrainClass.SAND if len(counts) == 1 and counts[0] <= SPECK_PX else TerrainClass.VERY_SMALL_ROCKS


def true_classes(ids: IntArray, depth_m: NDArray[np.float32]) -> NDArray[np.str_]:
    """True class letters (rows, columns) of the 20 x 20 px windows of one rendered picture (H, W).

    ``ids`` is -1 at the sky, 0 on bare ground and the clast's id elsewhere (`Renderer.clasts`). Windows that are
    mostly sky, or farther than 15 m, are U. Cover and extent of clasts decide the rest, as in the hand labels of the
    six classes: S no clast or one speck; V clasts up to about 4 px; m larger ones, or from 10 % cover; M over 35 %; B
    one rock from 20 px long on 40 % of the window.
    """
    rows, columns = ids.shape[0] // WINDOW_PX, ids.shape[1] // WINDOW_PX
    ids = resolved(ids)
    extent_px = rock_extents_px(ids)
    shape = (rows, WINDOW_PX, columns, WINDOW_PX)
    crop = np.s_[: rows * WINDOW_PX, : columns * WINDOW_PX]
    tiles = ids[crop].reshape(shape).transpose(0, 2, 1, 3).reshape(rows, columns, -1)
    far = (depth_m[crop] > FAR_M).reshape(shape).mean(axis=(1, 3)) > 0.5  # the sky's depth is infinite
    letters = np.full((rows, columns), TerrainClass.SAND.value, dtype="<U1")
    for row, column in zip(*np.nonzero((tiles > 0).any(axis=2) & ~far), strict=True):
        letters[row, column] = _window_class(tiles[row, column], extent_px).value
    letters[far] = TerrainClass.UNCERTAIN.value
    return letters


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
