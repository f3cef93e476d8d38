"""From a picture to rock pixels: low-pass, evidence against the soil, a threshold per window, edges, clean-up.

The 2004 paper binarises each 20x20 sub-window with an optimum threshold of its own (sections 3 and 4). Grey levels
alone part rock from soil badly, so what is thresholded here is a score: additive evidence of lightness, colour and
roughness against the picture's own soil, for dark and bright rocks alike. Otsu's threshold of each window (Otsu, IEEE
Trans. SMC 9(1), 1979) is interpolated between the window centres, so that no seams appear.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from perception.cues import cue_planes, used_cues
from perception.knowledge_base import Binarization, Knowledge, RockCues
from perception.soil_reference import SoilReference
from worlds.types import BoolArray, ByteArray, FloatArray

SingleArray = NDArray[np.float32]
_SCORE_BINS = 64
_TABLE_STEPS = 2048  # of sampled evidence: the largest error is about 0.02 where the steepest cue bends
_LOGISTIC_REACH = 16.0  # beyond it a score is 0 or 1


@dataclass(frozen=True, eq=False)
class Binarized:
    """Rock score (H, W) in 0..1 and the pixels that pass for rock."""

    score: SingleArray
    mask: BoolArray


def binarize(lab: SingleArray, grey: ByteArray, soil: SoilReference, hidden: BoolArray, know: Knowledge) -> Binarized:
    """Rock pixels of a smoothed picture: ``lab`` (H, W, 3) CIE Lab, ``grey`` (H, W) the same in 8 bits.

    ``hidden`` (H, W) marks sky and what else is no ground.
    """
    how = know.binarization
    score = rock_score(lab, soil, know.cues, how.roughness_window_px)
    score[hidden] = 0.0
    rock = score > threshold_map(score, how, 20)
    return Binarized(score, clean(close_edges(rock, score, grey, how), how))


def rock_score(lab: SingleArray, soil: SoilReference, cues: RockCues, window_px: int) -> SingleArray:
    """Score (H, W) in 0..1 that a pixel is rock; without colour, lightness and roughness alone judge."""
    names = used_cues(cues, coloured=soil.coloured)
    planes = cue_planes(lab, soil, names, cues.shade_compensation, window_px)
    return np.asarray(_score_kernel(planes, evidence_tables(cues, names)))


def threshold_map(score: SingleArray, how: Binarization, window_px: int) -> SingleArray:
    """Threshold (H, W): the optimum of each ``window_px`` window, interpolated between window centres."""
    grid = _window_thresholds(score, window_px, how.threshold, how.threshold_span[0], how.threshold_span[1], how.spread)
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
    closed = cv2.morphologyEx(rock.view(np.uint8), cv2.MORPH_CLOSE, _disc(how.close_px))
    contours, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(closed, contours, -1, 1, thickness=cv2.FILLED)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, _disc(how.open_px))
    return np.asarray(opened.view(np.bool_))


def _disc(size_px: int) -> ByteArray:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size_px, size_px)), dtype=np.uint8)


def evidence_tables(cues: RockCues, names: tuple[str, ...]) -> SingleArray:
    """Sampled evidence of the cues ``names`` and the logistic curve, (K + 1, 2 + samples), for the compiled kernel."""
    rows = [_samples(getattr(cues, name).value, np.array(getattr(cues, name).evidence)) for name in names]
    logistic = np.linspace(-_LOGISTIC_REACH, _LOGISTIC_REACH, _TABLE_STEPS + 1)
    rows.append(_samples(tuple(logistic), 1.0 / (1.0 + np.exp(-logistic - cues.bias))))
    return np.array(rows, dtype=np.float32)


def _samples(knots: tuple[float, ...], evidence: FloatArray) -> FloatArray:
    values = np.interp(np.linspace(knots[0], knots[-1], _TABLE_STEPS + 1), knots, evidence)
    return np.concatenate([[knots[0], _TABLE_STEPS / (knots[-1] - knots[0])], values])


@numba.njit(cache=True)
def _evidence(value: float, table: SingleArray) -> float:
    """Evidence at ``value``: first entries of the table are its start and its steps a unit, the rest the samples."""
    place = min(max((value - table[0]) * table[1], 0.0), _TABLE_STEPS)
    return float(table[2 + int(place + 0.5)])


@numba.njit(cache=True)
def _score_kernel(planes: SingleArray, tables: SingleArray) -> SingleArray:
    """Logistic curve of the summed evidence: ``planes`` (K, H, W), ``tables`` (K + 1, 2 + samples), the curve last."""
    count, height, width = planes.shape
    score = np.empty((height, width), dtype=np.float32)
    for y in range(height):
        for x in range(width):
            total = 0.0
            for cue in range(count):
                total += _evidence(planes[cue, y, x], tables[cue])
            score[y, x] = _evidence(total, tables[count])
    return score


@numba.njit(cache=True)
def _window_thresholds(
    score: SingleArray, size: int, default: float, low: float, high: float, spread: float
) -> SingleArray:
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
