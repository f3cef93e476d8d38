"""From a picture to rock pixels: low-pass, evidence against the soil, a threshold per window, edges, clean-up.

The 2004 paper binarises each 20x20 sub-window with an optimum threshold of its own (sections 3 and 4). Grey levels
alone part rock from soil badly, so what is thresholded here is a score: additive evidence of lightness, colour and
roughness against the picture's own soil, for dark and bright rocks alike. Otsu's threshold of each window (Otsu, IEEE
Trans. SMC 9(1), 1979) is interpolated between the window centres, so that no seams appear.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import msgspec
import numba
import numpy as np
from numpy.typing import NDArray

from perception.components import filled
from perception.cues import COLOUR_CUES, colour_likeness, cue_planes
from perception.evidence import Planes, chance_of
from perception.knowledge_base import Binarization, CueSet, Knowledge
from perception.soil_reference import SoilReference
from worlds.types import BoolArray, ByteArray, FloatArray

SingleArray = NDArray[np.float32]
_SCORE_BINS = 64


@dataclass(frozen=True, eq=False)
class Binarized:
    """Rock score (H, W) in 0..1 and the pixels that pass for rock."""

    score: SingleArray
    mask: BoolArray


def rock_mask(score: SingleArray, grey: ByteArray, how: Binarization) -> BoolArray:
    """Pixels (H, W) whose ``score`` passes their window's threshold, with closed outlines, cleaned."""
    rock = score > threshold_map(score, how, 20)
    return clean(close_edges(rock, score, grey, how), how)


def rock_score(lab: SingleArray, soil: SoilReference, hidden: BoolArray, know: Knowledge) -> SingleArray:
    """Score (H, W) in 0..1 that a pixel is rock: a first look, and a second one that knows what the first found.

    Pictures without colour have one look, with evidence of their own.
    """
    first, second = looks(know, coloured=soil.coloured)
    names = {name for cues in (first, second) if cues is not None for name, _ in cues.named()}
    if not names:  # cues of colour only, and a picture without
        return np.zeros(lab.shape[:2], dtype=np.float32)
    planes = cue_planes(lab, soil, names, know.cues.shade_compensation, know.binarization.roughness_window_px)
    score = evidence_score(planes, first, hidden)
    if second is not None:
        planes["likeness"] = colour_likeness(lab, score, soil, hidden)
        score = evidence_score(planes, second, hidden)
    return score


def looks(know: Knowledge, *, coloured: bool) -> tuple[CueSet, CueSet | None]:
    """The cues of the first look and those of the second, where there is one."""
    if coloured:
        return know.cues, know.second_cues
    if know.grey_cues is not None:
        return know.grey_cues, None
    return msgspec.structs.replace(know.cues, **dict.fromkeys(COLOUR_CUES)), None


def evidence_score(planes: Planes, cues: CueSet, hidden: BoolArray | None = None) -> SingleArray:
    """Logistic curve (H, W) of the evidence that all ``cues`` give together; 0 where ``hidden``."""
    return chance_of(planes, cues.bias, cues.named(), hidden)


def threshold_map(score: SingleArray, how: Binarization, window_px: int) -> SingleArray:
    """Threshold (H, W): the optimum of each ``window_px`` window, interpolated between window centres."""
    grid = window_thresholds(score, window_px, how.threshold, how.threshold_span[0], how.threshold_span[1], how.spread)
    size = (score.shape[1], score.shape[0])
    return np.asarray(cv2.resize(grid, size, interpolation=cv2.INTER_LINEAR), dtype=np.float32)


def close_edges(rock: BoolArray, score: SingleArray, grey: ByteArray, how: Binarization) -> BoolArray:
    """``rock`` grown by Canny edge pixels that touch it and still score somewhat."""
    if not rock.any():
        return rock
    edges = cv2.Canny(grey, how.edge_low, how.edge_high) > 0
    beside = cv2.dilate(rock.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.asarray(rock | (edges & beside & (score > how.edge_score)))


def clean(rock: BoolArray, how: Binarization) -> BoolArray:
    """``rock`` closed, with its holes filled, and opened."""
    return _morphed(filled(_morphed(rock, cv2.MORPH_CLOSE, how.close_px)), cv2.MORPH_OPEN, how.open_px)


def _morphed(rock: BoolArray, operation: int, size_px: int) -> BoolArray:
    """Closed or opened by a disc; one of a single pixel changes nothing."""
    if size_px <= 1:
        return rock
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size_px, size_px))
    return np.asarray(cv2.morphologyEx(rock.view(np.uint8), operation, disc).view(np.bool_))


@numba.njit(cache=True)
def window_thresholds(
    score: SingleArray, size: int, default: float, low: float, high: float, spread: float
) -> SingleArray:
    """Otsu's threshold, held between ``low`` and ``high``, of each whole window; ``default`` under that ``spread``."""
    rows, columns = score.shape[0] // size, score.shape[1] // size
    grid = np.full((rows, columns), default, dtype=np.float32)
    histogram = np.zeros(_SCORE_BINS)
    for row in range(rows):
        for column in range(columns):
            histogram[:] = 0.0
            total, squares = 0.0, 0.0
            for y in range(row * size, (row + 1) * size):
                for x in range(column * size, (column + 1) * size):
                    value = score[y, x]
                    total += value
                    squares += value * value
                    histogram[min(int(value * _SCORE_BINS), _SCORE_BINS - 1)] += 1.0
            count = size * size
            if squares / count - (total / count) ** 2 >= spread * spread:
                grid[row, column] = min(max(_otsu(histogram), low), high)
    return grid


@numba.njit(cache=True)
def _otsu(histogram: FloatArray) -> float:
    """Upper edge (0..1) of the bin that parts ``histogram`` with the largest variance between the two classes."""
    bins = histogram.shape[0]
    weight, moment = 0.0, 0.0
    for i in range(bins):
        weight += histogram[i]
        moment += histogram[i] * i
    best, answer, below, below_moment = -1.0, 0.5, 0.0, 0.0
    for i in range(bins - 1):
        below += histogram[i]
        below_moment += histogram[i] * i
        above = weight - below
        if below > 0.0 and above > 0.0:
            gap = below_moment / below - (moment - below_moment) / above
            if below * above * gap * gap > best:
                best = below * above * gap * gap
                answer = (i + 1.0) / bins
    return answer
