"""What speaks for rock or soil at each pixel: planes of measures against the picture's own soil."""

from __future__ import annotations

from collections.abc import Collection

import numba
import numpy as np
from numpy.typing import NDArray

from perception.evidence import Planes
from perception.soil_reference import SoilReference, mean_gradient
from worlds.types import BoolArray

SingleArray = NDArray[np.float32]
COLOUR_CUES = frozenset({"green_red", "blue_yellow"})
_CHANNELS = {"lightness": 0, "green_red": 1, "blue_yellow": 2}
_BINS = (16, 8, 8)  # of the colour histogram, in L*, a* and b*
_REACH = np.array([50.0, 16.0, 20.0], dtype=np.float32)  # that the bins cover on either side of the soil
_PRIOR = 3.0  # pixels of the picture's average that each bin starts with


def cue_planes(
    lab: SingleArray, soil: SoilReference, names: Collection[str], shade_compensation: float, window_px: int
) -> Planes:
    """The measures ``names``, each (H, W), of a smoothed picture ``lab`` (H, W, 3); see `CueSet` for what each is."""
    channels = _against_soil(lab, soil.lab, shade_compensation)
    planes = {name: channels[_CHANNELS[name]] for name in names if name in _CHANNELS}
    if "roughness" in names:
        planes["roughness"] = mean_gradient(channels[0], window_px) * np.float32(1.0 / soil.gradient)
    return planes


def colour_likeness(lab: SingleArray, score: SingleArray, soil: SoilReference, hidden: BoolArray) -> SingleArray:
    """Mean of a first ``score`` (H, W) over the seen pixels of the picture that have a pixel's colour, (H, W).

    Colours are cells of a coarse histogram around the soil's, smoothed over neighbouring cells.
    """
    cells = _colour_cells(lab, soil.lab, _REACH, _BINS)
    sums = _histograms(cells, score, hidden, int(np.prod(_BINS))).reshape(2, *_BINS)
    rock, count = _spread(sums).reshape(2, -1)
    usual = float(rock.sum() / max(float(count.sum()), 1.0))
    share = ((rock + _PRIOR * usual) / (count + _PRIOR)).astype(np.float32)
    return np.asarray(share[cells])


@numba.njit(cache=True)
def _against_soil(lab: SingleArray, soil: SingleArray, compensation: float) -> SingleArray:
    """Planes (3, H, W): ``lab`` (H, W, 3) minus the soil's; colours minus those of soil lit like the pixel.

    As far as ``compensation`` says: soil lit less keeps its hue, and Lab scales a* and b* about as it scales L*.
    """
    planes = np.empty((3, lab.shape[0], lab.shape[1]), dtype=np.float32)
    green, blue = (1.0 - compensation) * soil[1], (1.0 - compensation) * soil[2]
    green_slope, blue_slope = compensation * soil[1] / soil[0], compensation * soil[2] / soil[0]
    for y in range(lab.shape[0]):
        for x in range(lab.shape[1]):
            light = lab[y, x, 0]
            planes[0, y, x] = light - soil[0]
            planes[1, y, x] = lab[y, x, 1] - green - green_slope * light
            planes[2, y, x] = lab[y, x, 2] - blue - blue_slope * light
    return planes


@numba.njit(cache=True)
def _colour_cells(
    lab: SingleArray, centre: SingleArray, reach: SingleArray, bins: tuple[int, int, int]
) -> NDArray[np.int32]:
    cells = np.empty(lab.shape[:2], dtype=np.int32)
    for y in range(lab.shape[0]):
        for x in range(lab.shape[1]):
            cell = 0
            for axis in range(3):
                place = (lab[y, x, axis] - centre[axis] + reach[axis]) / (2.0 * reach[axis]) * bins[axis]
                cell = cell * bins[axis] + min(max(int(place), 0), bins[axis] - 1)
            cells[y, x] = cell
    return cells


@numba.njit(cache=True)
def _histograms(cells: NDArray[np.int32], score: SingleArray, hidden: BoolArray, size: int) -> SingleArray:
    """Summed score and count (2, size) of the seen pixels of each cell."""
    sums = np.zeros((2, size), dtype=np.float32)
    for y in range(cells.shape[0]):
        for x in range(cells.shape[1]):
            if not hidden[y, x]:
                sums[0, cells[y, x]] += score[y, x]
                sums[1, cells[y, x]] += 1.0
    return sums


def _spread(sums: SingleArray) -> SingleArray:
    """``sums`` (2, bins...) smoothed over neighbouring cells with weights 1/4, 1/2, 1/4 along each axis of bins."""
    for axis in range(1, sums.ndim):
        line = np.moveaxis(sums, axis, -1)
        beside = np.concatenate([line[..., :1], line, line[..., -1:]], axis=-1)
        line = np.float32(0.25) * (beside[..., :-2] + 2 * line + beside[..., 2:])
        sums = np.asarray(np.moveaxis(line, -1, axis), dtype=np.float32)
    return sums
