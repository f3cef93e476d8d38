"""What the six-class rules look at: measures of each 20x20 window of a picture, made for those that are asked for.

Textures are decimal logarithms of grey levels; shares are of the window; ``around_`` is the mean over the 3x3 windows
around. ``stones`` and ``stones_sure`` are what the working definition says of the clasts that `perception.clasts`
finds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from perception.class_definition import WINDOW_PX, window_parts
from perception.clasts import clast_stages, redness
from perception.soil_reference import SoilReference
from perception.texture import Texture, window_texture
from worlds.types import BoolArray, ByteArray, FloatArray, IntArray

SingleArray = NDArray[np.float32]
FAR_M = 100.0  # windows that see no ground count as this far away
STONE_CUTS = {"stones": 0.3, "stones_sure": 0.5}  # of a pixel's chance to show a clast
SKY_RED, SKYLINE_REACH_PX = -0.12, 40.0  # halfway from soil to sky; farther from the skyline nothing changes
_SIGMAS_FINE, _SIGMAS_COARSE_HALF = (0.8, 2.0), (1.5, 4.0)  # the latter at half resolution: 3 and 8 pixels
_BINS, _BIN = 1024, 0.125  # of the histograms that percentiles are read from, in grey levels
_FLOOR = 0.1  # grey levels; keeps logarithms finite


@dataclass(frozen=True, eq=False)
class WindowSource:
    """What was found in one picture, (H, W) each where not said otherwise."""

    picture: ByteArray  # grey, or RGB (H, W, 3)
    grey: ByteArray
    lab: SingleArray  # (H, W, 3) of the low-passed picture
    soil: SoilReference
    score: SingleArray  # rock evidence 0..1
    labels: IntArray  # rock id, 0 = none
    area_px: IntArray  # (R,) of the rocks
    hidden: BoolArray
    chance: SingleArray | None = None  # that a pixel shows a clast; inputs of clasts need it
    range_m: FloatArray | None = None  # (rows, columns) ground distance of the windows, NaN where there is no ground
    red: SingleArray | None = None  # the picture's `redness`, where it is known already


def window_features(source: WindowSource, names: tuple[str, ...]) -> dict[str, FloatArray]:
    """The features ``names``, each (rows, columns) over the whole windows of the picture, and always ``blank``.

    ``blank`` is 1 where a window has no variation at all and hence carries no picture. Raises KeyError for a feature
    that there is not.
    """
    parts = _Parts(source)
    return {name: FEATURES[name](parts) for name in dict.fromkeys((*names, "blank"))}


class _Parts:
    """Measures that several features share, each made once, when first asked for."""

    def __init__(self, source: WindowSource) -> None:
        self.source = source
        self.shape = (source.grey.shape[0] // WINDOW_PX, source.grey.shape[1] // WINDOW_PX)

    @cached_property
    def single(self) -> SingleArray:
        return np.asarray(self.source.grey, dtype=np.float32)

    @cached_property
    def fine(self) -> FloatArray:
        return self._band(self.single, _SIGMAS_FINE, WINDOW_PX)

    @cached_property
    def coarse(self) -> FloatArray:
        # A broad band needs no more than half the resolution.
        half = cv2.resize(self.single, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        return self._band(np.asarray(half, dtype=np.float32), _SIGMAS_COARSE_HALF, WINDOW_PX // 2)

    def _band(self, picture: SingleArray, sigmas: tuple[float, float], size: int) -> FloatArray:
        """Largest and 95th percentile (rows, columns, 2) of |G(s1) - G(s2)|, log10 grey levels."""
        low, high = (cv2.GaussianBlur(picture, (0, 0), sigma) for sigma in sigmas)
        return np.log10(np.maximum(_percentiles(np.asarray(cv2.absdiff(low, high)), size, 0.95), _FLOOR))

    @cached_property
    def rock_areas(self) -> IntArray:
        return np.concatenate([np.zeros(1, dtype=np.int32), self.source.area_px])

    @cached_property
    def rocks(self) -> IntArray:
        """Of each window: how many rocks, their pixels, those of the largest part, and whose that is."""
        return window_parts(self.source.labels, self.rock_areas, 1)

    @cached_property
    def co_occurrence(self) -> Texture:
        return window_texture(self.source.grey, WINDOW_PX)

    @cached_property
    def score(self) -> FloatArray:
        return window_mean(self.source.score)

    @cached_property
    def red(self) -> SingleArray:
        known = self.source.red
        return redness(self.source.picture, self.source.hidden) if known is None else known

    @property
    def clast_chance(self) -> SingleArray:
        assert self.source.chance is not None  # a knowledge file whose rules ask for stones has the table
        return self.source.chance

    def skyline(self) -> FloatArray:
        """How far the first ground from above lies under each window's upper edge, mean of its columns, in pixels."""
        first = _first_over(self.red, SKY_RED)
        rows, columns = self.shape
        first_px = first[: columns * WINDOW_PX].reshape(columns, WINDOW_PX).mean(axis=1)
        under = first_px - WINDOW_PX * np.arange(rows, dtype=np.float64)[:, None]
        return np.asarray(np.clip(under, -SKYLINE_REACH_PX, SKYLINE_REACH_PX))

    def around(self, values: FloatArray) -> FloatArray:
        return np.asarray(cv2.blur(values, (3, 3), borderType=cv2.BORDER_REPLICATE))

    def blank(self) -> FloatArray:
        grey = self.source.grey
        flat = window_reduce(np.maximum, grey, WINDOW_PX) == window_reduce(np.minimum, grey, WINDOW_PX)
        return np.asarray(flat.astype(np.float64))

    def range_log(self) -> FloatArray:
        away = np.full(self.shape, FAR_M) if self.source.range_m is None else self.source.range_m
        return np.asarray(np.log10(np.clip(np.nan_to_num(away, nan=FAR_M), 0.1, FAR_M)))

    def rock_size(self) -> FloatArray:
        return np.asarray(np.log10(1.0 + self.rock_areas[self.rocks[..., 3]]))


def _log_texture(values: FloatArray, parts: _Parts) -> FloatArray:
    return np.log10(np.maximum(values, 0.01)).reshape(parts.shape)


FEATURES: Mapping[str, Callable[[_Parts], FloatArray]] = {
    "fine": lambda p: p.fine[..., 0],  # largest |G(0.8) - G(2)|: one speck shows
    "grain": lambda p: p.fine[..., 1],  # 95th percentile of the same
    "coarse": lambda p: p.coarse[..., 1],  # 95th percentile of |G(3) - G(8)|: relief of the size of rocks
    "score": lambda p: p.score,  # mean evidence of rock: cover that counts doubt as half
    "score_spread": lambda p: np.sqrt(np.maximum(window_mean(np.square(p.source.score)) - p.score**2, 0.0)),
    "cover": lambda p: p.rocks[..., 1] / WINDOW_PX**2,  # share under rocks
    "largest": lambda p: p.rocks[..., 2] / WINDOW_PX**2,  # share under the rock that takes most of it
    "rest": lambda p: (p.rocks[..., 1] - p.rocks[..., 2]) / WINDOW_PX**2,  # share under all others
    "rock_size": _Parts.rock_size,  # log10 of 1 + that rock's pixels in the whole picture
    "around_score": lambda p: p.around(p.score),
    "around_largest": lambda p: p.around(p.rocks[..., 2] / WINDOW_PX**2),
    "around_fine": lambda p: p.around(p.fine[..., 0]),
    "around_coarse": lambda p: p.around(p.coarse[..., 1]),
    # Class that the definition gives to the clasts that are found, with some doubt and with less.
    **{name: partial(lambda cut, p: clast_stages(p.clast_chance, cut), cut) for name, cut in STONE_CUTS.items()},
    "contrast": lambda p: _log_texture(p.co_occurrence.contrast, p),
    "energy": lambda p: p.co_occurrence.energy.reshape(p.shape),
    "variance": lambda p: _log_texture(p.co_occurrence.variance, p),
    "entropy": lambda p: p.co_occurrence.entropy.reshape(p.shape),
    "homogeneity": lambda p: p.co_occurrence.homogeneity.reshape(p.shape),
    "area": lambda p: np.log10(1.0 + p.rocks[..., 2]),  # log10 of 1 + pixels of the largest rock in the window
    "range": _Parts.range_log,  # log10 metres
    "skyline": _Parts.skyline,  # pixels from the window's upper edge down to the first ground under the sky
    "unseen": lambda p: window_mean(p.source.hidden),  # share that shows no ground
    "blank": _Parts.blank,
}


def window_mean(values: NDArray[np.float32] | ByteArray | BoolArray) -> FloatArray:
    """Mean (rows, columns) of ``values`` (H, W) over each whole window."""
    rows, columns = values.shape[0] // WINDOW_PX, values.shape[1] // WINDOW_PX
    whole = values[: rows * WINDOW_PX, : columns * WINDOW_PX].astype(np.float32)
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.float64)


def window_reduce(function: np.ufunc, values: ByteArray, size: int) -> ByteArray:
    """``function`` (such as ``np.maximum``) over each whole ``size`` window of ``values`` (H, W)."""
    rows, columns = values.shape[0] // size, values.shape[1] // size
    lines = function.reduce(values[: rows * size].reshape(rows, size, -1), axis=1)
    return np.asarray(function.reduce(lines[:, : columns * size].reshape(rows, columns, size), axis=2))


@numba.njit(cache=True)
def _first_over(values: SingleArray, least: float) -> FloatArray:
    """First row (W,) of each column where the mean of 3 x 3 ``values`` (H, W) is over ``least``; H where there is none.

    Mirrored at the border.
    """
    height, width = values.shape
    first = np.full(width, float(height))
    for x in range(width):
        left, right = abs(x - 1), width - 1 - abs(width - 2 - x)
        for y in range(height):
            total = 0.0
            for row in (abs(y - 1), y, height - 1 - abs(height - 2 - y)):
                total += values[row, left] + values[row, x] + values[row, right]
            if total > 9.0 * least:
                first[x] = y
                break
    return first


@numba.njit(cache=True)
def _percentiles(values: SingleArray, size: int, share: float) -> FloatArray:
    """Largest value and percentile ``share`` (rows, columns, 2) of each window of ``values`` (H, W), none negative."""
    rows, columns = values.shape[0] // size, values.shape[1] // size
    out = np.empty((rows, columns, 2))
    counts = np.zeros(_BINS, dtype=np.int32)
    for row in range(rows):
        for column in range(columns):
            counts[:] = 0
            largest = 0.0
            for y in range(row * size, (row + 1) * size):
                for x in range(column * size, (column + 1) * size):
                    value = values[y, x]
                    largest = max(largest, value)
                    counts[min(int(value / _BIN), _BINS - 1)] += 1
            above, place = int((1.0 - share) * (size * size - 1) + 0.5), min(int(largest / _BIN), _BINS - 1)
            while above >= counts[place]:
                above -= counts[place]
                place -= 1
            out[row, column, 0] = largest
            out[row, column, 1] = min((place + 0.5) * _BIN, largest)
    return out
