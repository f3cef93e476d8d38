"""What speaks for rock or soil at each pixel: planes of measures against the picture's own soil."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from perception.knowledge_base import CUE_NAMES, RockCues
from perception.soil_reference import SoilReference, mean_gradient

SingleArray = NDArray[np.float32]
COLOUR_CUES = ("green_red", "blue_yellow")


def cue_planes(
    lab: SingleArray, soil: SoilReference, names: tuple[str, ...], shade_compensation: float, window_px: int
) -> SingleArray:
    """The measures ``names`` (K, H, W) of a smoothed picture ``lab`` (H, W, 3); see `RockCues` for what each is."""
    planes = np.empty((len(names), *lab.shape[:2]), dtype=np.float32)
    for plane, name in zip(planes, names, strict=True):
        if name == "roughness":
            np.multiply(mean_gradient(lab[..., 0], window_px), np.float32(1.0 / soil.gradient), out=plane)
        else:
            _against_soil(lab, CUE_NAMES.index(name), soil.lab, shade_compensation, plane)
    return planes


def used_cues(cues: RockCues, *, coloured: bool) -> tuple[str, ...]:
    """Names of the cues that speak: without colour, those of colour are silent."""
    return tuple(name for name, _ in cues.named() if coloured or name not in COLOUR_CUES)


@numba.njit(cache=True)
def _against_soil(
    lab: SingleArray, channel: int, reference: SingleArray, compensation: float, out: SingleArray
) -> None:
    """Channel minus the soil's; colours minus those of soil lit like the pixel, as far as ``compensation`` says."""
    for y in range(lab.shape[0]):
        for x in range(lab.shape[1]):
            # Soil lit less keeps its hue: Lab then scales a* and b* about as it scales L*.
            dim = 1.0
            if channel > 0:
                dim = 1.0 - compensation + compensation * lab[y, x, 0] / reference[0]
            out[y, x] = lab[y, x, channel] - dim * reference[channel]
