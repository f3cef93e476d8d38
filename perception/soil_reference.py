"""What the soil of one picture looks like: the reference that rock is judged against.

Soil is where the picture is smooth and neither among the darkest nor the brightest; sky and rover are left out. A
quadratic surface through its lightness takes out vignetting and light that falls off across the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from perception.knowledge_base import SoilKnowledge
from worlds.types import BoolArray, FloatArray

SingleArray = NDArray[np.float32]
_TREND_ROUNDS, _TREND_STRIDE = 3, 7  # a seventh of the soil pixels tells the trend as well
_SAMPLE_STRIDE = 3  # a third of the pixels at half resolution tells a percentile as well
_RIDGE = np.array([1e-6, 1.0, 1.0, 1.0, 1.0, 1.0])  # the level is free
_GREY_SATURATION = 0.5  # mean |a*| + |b*| under which a picture carries no colour


@dataclass(frozen=True, eq=False)
class SoilReference:
    """Median soil colour and its usual gradient."""

    lab: SingleArray  # (3,) CIE L*, a*, b*
    gradient: float  # lightness per pixel
    trend: SingleArray  # (6,) lightness over the median: coefficients of 1, x, y, x^2, x y, y^2, x and y in -1..1
    coloured: bool  # the picture has colour at all


def mean_gradient(lightness: SingleArray, window_px: int) -> SingleArray:
    """Gradient magnitude of ``lightness`` (H, W) per pixel, averaged over a square window."""
    return np.asarray(cv2.blur(_gradient(np.ascontiguousarray(lightness)), (window_px, window_px)), dtype=np.float32)


def soil_reference(lab: SingleArray, hidden: BoolArray, know: SoilKnowledge) -> SoilReference:
    """Soil of the smoothed picture ``lab`` (H, W, 3), read at half resolution outside ``hidden`` (H, W)."""
    half = cv2.resize(lab, (lab.shape[1] // 2, lab.shape[0] // 2), interpolation=cv2.INTER_AREA)
    seen = ~hidden[::2, ::2][: half.shape[0], : half.shape[1]]
    if not seen.any():
        seen = np.ones_like(seen)
    lightness = np.ascontiguousarray(half[..., 0], dtype=np.float32)
    box = (know.window_px, know.window_px)
    mean = cv2.blur(lightness, box)
    variance = np.maximum(cv2.blur(lightness * lightness, box) - mean * mean, 0.0)
    sample = np.flatnonzero(seen)[::_SAMPLE_STRIDE]
    light = lightness.take(sample)
    dark, bright = percentile(light, know.dark_percentile), percentile(light, know.bright_percentile)
    soil = seen & (variance <= percentile(variance.take(sample), know.smooth_percentile))
    between = soil & (lightness > dark) & (lightness < bright)
    chosen = between if between.any() else soil
    places: NDArray[np.int64] = np.flatnonzero(chosen).astype(np.int64, copy=False)
    trend = _fit_trend(lightness, places[::_TREND_STRIDE], know.trend_stiffness)
    usual_lab = half.reshape(-1, 3).take(places[::_SAMPLE_STRIDE], axis=0).T
    colour = np.array([percentile(channel, 50.0) for channel in usual_lab], dtype=np.float32)
    colour[0] = max(float(colour[0]), 1.0)  # black soil would make every ratio to it meaningless
    gradient = mean_gradient(lab[..., 0], know.window_px)[::2, ::2][: half.shape[0], : half.shape[1]].take(sample)
    coloured = is_coloured(np.asarray(half, dtype=np.float32))
    usual = percentile(gradient, know.gradient_percentile) + know.gradient_floor
    return SoilReference(colour, usual, trend, coloured)


def is_coloured(lab: SingleArray) -> bool:
    """Whether a picture ``lab`` (H, W, 3) has colour at all."""
    return bool(np.abs(lab[::2, ::2, 1:]).mean() > _GREY_SATURATION)


def even_light(lab: SingleArray, soil: SoilReference) -> SingleArray:
    """``lab`` (H, W, 3) with the trend of the soil's lightness taken out."""
    return _without_trend(lab, soil.trend, _axes(lab.shape[1]), _axes(lab.shape[0]))


def percentile(values: FloatArray | SingleArray, share: float) -> float:
    """Percentile ``share`` (0..100) of ``values`` (N,), on the straight line between neighbours, as NumPy's own."""
    place = (len(values) - 1) * share / 100.0
    rank = int(place)
    parted = np.partition(values, rank)
    low = float(parted[rank])
    return low + (place - rank) * (float(parted[rank + 1 :].min(initial=np.inf)) - low) if place > rank else low


def _axes(count: int) -> SingleArray:
    """Pixel centres of a row or column from -1 to 1."""
    return ((np.arange(count, dtype=np.float32) + 0.5) * (2.0 / count) - 1.0).astype(np.float32)


def _fit_trend(lightness: SingleArray, places: NDArray[np.int64], stiffness: float) -> SingleArray:
    """Quadratic surface (6,) through the lightness at flat ``places``, without outliers; a stiff one stays level."""
    values = lightness.take(places).astype(np.float64)
    values -= percentile(values, 50.0)
    terms = _quadratic(places, _axes(lightness.shape[1]), _axes(lightness.shape[0]))
    limit = np.inf
    coefficients: FloatArray = np.zeros(6)
    rest = np.zeros_like(values)
    for _ in range(_TREND_ROUNDS):
        square, product = _normal_equations(terms, values, rest <= limit)
        square[np.diag_indices(6)] += stiffness * max(square[0, 0], 1.0) * _RIDGE
        coefficients = np.asarray(np.linalg.solve(square, product))
        rest = np.abs(values - terms @ coefficients)
        limit = 3.0 * percentile(rest, 50.0) + 0.1
    return coefficients.astype(np.float32)


@numba.njit(cache=True)
def _quadratic(places: NDArray[np.int64], x: SingleArray, y: SingleArray) -> FloatArray:
    """Terms (N, 6) 1, x, y, x^2, x y, y^2 at flat ``places`` (N,)."""
    terms = np.empty((len(places), 6))
    for i in range(len(places)):
        across, down = np.float64(x[places[i] % len(x)]), np.float64(y[places[i] // len(x)])
        terms[i] = 1.0, across, down, across * across, across * down, down * down
    return terms


@numba.njit(cache=True)
def _normal_equations(terms: FloatArray, values: FloatArray, kept: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Square (6, 6) and product (6,) of the least squares over the samples that are ``kept``."""
    square, product = np.zeros((6, 6)), np.zeros(6)
    for i in range(len(values)):
        if kept[i]:
            for a in range(6):
                product[a] += terms[i, a] * values[i]
                for b in range(a + 1):
                    square[a, b] += terms[i, a] * terms[i, b]
    return square + np.tril(square, -1).T, product


@numba.njit(cache=True)
def _without_trend(lab: SingleArray, c: SingleArray, x: SingleArray, y: SingleArray) -> SingleArray:
    even = np.empty_like(lab)
    for row in range(lab.shape[0]):
        for column in range(lab.shape[1]):
            level = c[0] + c[1] * x[column] + c[3] * x[column] * x[column]
            even[row, column, 0] = lab[row, column, 0] - (level + (c[2] + c[5] * y[row] + c[4] * x[column]) * y[row])
            even[row, column, 1] = lab[row, column, 1]
            even[row, column, 2] = lab[row, column, 2]
    return even


@numba.njit(cache=True, fastmath=True)
def _gradient(values: SingleArray) -> SingleArray:
    """Magnitude (H, W) of the gradient by Sobel's kernel, mirrored at the border."""
    rows, columns = values.shape
    answer = np.empty_like(values)
    smooth, across = np.empty(columns, dtype=np.float32), np.empty(columns, dtype=np.float32)
    eighth = np.float32(0.125)  # a Sobel kernel sums to eight times the slope
    for row in range(rows):
        above, below = values[min(abs(row - 1), rows - 1)], values[max(rows - 1 - abs(rows - 2 - row), 0)]
        for x in range(columns):
            smooth[x] = above[x] + values[row, x] + values[row, x] + below[x]
            across[x] = below[x] - above[x]
        for x in range(1, columns - 1):
            dx = (smooth[x + 1] - smooth[x - 1]) * eighth
            dy = (across[x - 1] + across[x] + across[x] + across[x + 1]) * eighth
            answer[row, x] = np.sqrt(dx * dx + dy * dy)
        # Mirrored, the slope along the row is zero there.
        answer[row, 0] = abs(across[0] + across[min(1, columns - 1)]) * np.float32(0.25)
        answer[row, columns - 1] = abs(across[columns - 1] + across[max(columns - 2, 0)]) * np.float32(0.25)
    return answer
