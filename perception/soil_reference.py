"""What the soil of one picture looks like: the reference that rock is judged against.

Soil is where the picture is smooth and neither among the darkest nor the brightest; sky and rover are left out. A
quadratic surface through its lightness takes out vignetting and light that falls off across the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.knowledge_base import SoilKnowledge
from worlds.types import BoolArray, FloatArray

SingleArray = NDArray[np.float32]
_TREND_ROUNDS, _TREND_STRIDE = 3, 7  # a seventh of the soil pixels tells the trend as well
_SAMPLE_STRIDE = 3  # a third of the pixels at half resolution tells a percentile as well
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
    single = np.ascontiguousarray(lightness)
    # A Sobel kernel sums to eight times the slope.
    across = cv2.Sobel(single, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(single, cv2.CV_32F, 0, 1, scale=0.125)
    return np.asarray(cv2.blur(cv2.magnitude(across, down), (window_px, window_px)), dtype=np.float32)


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
    dark, bright = np.percentile(lightness.take(sample), [know.dark_percentile, know.bright_percentile])
    soil = seen & (variance <= np.percentile(variance.take(sample), know.smooth_percentile))
    between = soil & (lightness > dark) & (lightness < bright)
    chosen = between if between.any() else soil
    trend = _fit_trend(lightness, chosen, know.trend_stiffness)
    colour = np.median(half.reshape(-1, 3)[np.flatnonzero(chosen)[::_SAMPLE_STRIDE]], axis=0).astype(np.float32)
    colour[0] = max(float(colour[0]), 1.0)  # black soil would make every ratio to it meaningless
    gradient = mean_gradient(lab[..., 0], know.window_px)[::2, ::2][: half.shape[0], : half.shape[1]].take(sample)
    coloured = is_coloured(np.asarray(half, dtype=np.float32))
    usual = float(np.percentile(gradient, know.gradient_percentile)) + know.gradient_floor
    return SoilReference(colour, usual, trend, coloured)


def is_coloured(lab: SingleArray) -> bool:
    """Whether a picture ``lab`` (H, W, 3) has colour at all."""
    return bool(np.abs(lab[::2, ::2, 1:]).mean() > _GREY_SATURATION)


def even_light(lab: SingleArray, soil: SoilReference) -> SingleArray:
    """``lab`` (H, W, 3) with the trend of the soil's lightness taken out."""
    x, y = _axes(lab.shape[1]), _axes(lab.shape[0])[:, None]
    c = soil.trend
    even = lab.copy()
    even[..., 0] -= (c[0] + c[1] * x + c[3] * x * x) + (c[2] + c[5] * y + c[4] * x) * y
    return even


def _axes(count: int) -> SingleArray:
    """Pixel centres of a row or column from -1 to 1."""
    return ((np.arange(count, dtype=np.float32) + 0.5) * (2.0 / count) - 1.0).astype(np.float32)


def _fit_trend(lightness: SingleArray, soil: BoolArray, stiffness: float) -> SingleArray:
    """Quadratic surface (6,) through the lightness of soil pixels, without outliers; a stiff one stays level."""
    rows, columns = (index[::_TREND_STRIDE] for index in np.nonzero(soil))
    x, y = _axes(soil.shape[1])[columns].astype(np.float64), _axes(soil.shape[0])[rows].astype(np.float64)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    values = lightness[rows, columns].astype(np.float64)
    values -= float(np.median(values))
    kept = np.ones(len(values), dtype=bool)
    coefficients: FloatArray = np.zeros(6)
    for _ in range(_TREND_ROUNDS):
        ridge = stiffness * max(int(kept.sum()), 1) * np.diag([1e-6, 1.0, 1.0, 1.0, 1.0, 1.0])
        coefficients = np.asarray(np.linalg.solve(terms[kept].T @ terms[kept] + ridge, terms[kept].T @ values[kept]))
        rest = np.abs(values - terms @ coefficients)
        kept = rest <= 3.0 * float(np.median(rest)) + 0.1
    return coefficients.astype(np.float32)
