"""What the soil of one picture looks like: the reference that rock is judged against.

Soil is where the picture is smooth and neither among the darkest nor the brightest; sky and rover are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.knowledge_base import Sky, SoilKnowledge
from worlds.types import BoolArray

SingleArray = NDArray[np.float32]
_GREY_SATURATION = 0.5  # mean |a*| + |b*| under which a picture carries no colour


@dataclass(frozen=True, eq=False)
class SoilReference:
    """Median soil colour and its usual gradient."""

    lab: SingleArray  # (3,) CIE L*, a*, b*
    gradient: float  # lightness per pixel
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
    lightness = np.ascontiguousarray(half[..., 0])
    box = (know.window_px, know.window_px)
    mean = cv2.blur(lightness, box)
    variance = np.maximum(cv2.blur(lightness * lightness, box) - mean * mean, 0.0)
    dark, bright = np.percentile(lightness[seen], [know.dark_percentile, know.bright_percentile])
    soil = seen & (variance <= np.percentile(variance[seen], know.smooth_percentile))
    between = soil & (lightness > dark) & (lightness < bright)
    chosen = between if between.any() else soil
    colour = np.median(half[chosen], axis=0).astype(np.float32)
    colour[0] = max(float(colour[0]), 1.0)  # black soil would make every ratio to it meaningless
    gradient = mean_gradient(lab[..., 0], know.window_px)[::2, ::2][: half.shape[0], : half.shape[1]][seen]
    coloured = bool(np.abs(half[..., 1:]).mean() > _GREY_SATURATION)
    return SoilReference(
        colour, float(np.percentile(gradient, know.gradient_percentile)) + know.gradient_floor, coloured
    )


def sky_mask(lab: SingleArray, know: Sky) -> BoolArray:
    """Sky (H, W) of a picture of unknown attitude: a smooth, bright region that reaches the top edge.

    Navcam tops and hazy far ridges that are darker than the ground are missed.
    """
    lightness = lab[..., 0]
    lower = float(np.median(lightness[lightness.shape[0] // 2 :]))
    smooth = mean_gradient(lightness, 5) < know.max_gradient
    candidate = (smooth & (lightness > lower + know.brighter)).view(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(candidate, connectivity=4)
    large = stats[:, cv2.CC_STAT_AREA] >= know.min_share * lightness.size
    large[0] = False
    top = np.zeros(len(stats), dtype=bool)
    top[np.unique(labels[0])] = True
    return np.asarray((large & top)[labels])
