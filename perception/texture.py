"""Texture of picture regions: the co-occurrence measures of the 2004 paper.

Co-occurrence follows Haralick, Shanmugam and Dinstein, IEEE Trans. SMC 3(6), 1973, over 32 grey levels (8-bit value
// 8), the four directions 0, 45, 90 and 135 degrees at any distances, symmetric and normalised; each measure is the
mean over directions and distances. The paper prints entropy as ``-sum (i-j)^2 log P`` (equation 2) and homogeneity as
``sum P/(i-j)^2`` without the diagonal (equation 4); here both are Haralick's: ``-sum P log P`` (0 log 0 = 0) and
``sum P/(1+(i-j)^2)``. Energy is the paper's equation 1, ``sum P^2``; variance is that of the 8-bit grey values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from worlds.types import ByteArray, FloatArray, IntArray

LEVELS = 32
DISTANCES_PX = (1,)
_LOGS = np.log(np.maximum(np.arange(4096), 1)).astype(np.float64)  # of pair counts; larger ones are rare


@dataclass(frozen=True, eq=False)
class Texture:
    """Measures of R regions, each (R,)."""

    contrast: FloatArray
    energy: FloatArray
    variance: FloatArray
    entropy: FloatArray
    homogeneity: FloatArray


def region_texture(
    grey: ByteArray, labels: IntArray, boxes: IntArray, distances_px: tuple[int, ...] = DISTANCES_PX
) -> Texture:
    """Texture of the regions 1..R of ``labels`` (H, W) in ``grey`` (H, W).

    ``boxes`` (R, 4) holds x, y, width, height of each region. Only pairs with both pixels in the region count; a
    region without any pair has contrast 0, energy 1, entropy 0 and homogeneity 1. Distances are along rows and columns:
    a diagonal neighbour at distance 2 is two rows and two columns away.
    """
    steps = np.array([(dx * d, dy * d) for d in distances_px for dx, dy in ((1, 0), (1, -1), (0, 1), (1, 1))])
    measures = _region_kernel(grey, labels, np.ascontiguousarray(boxes, dtype=np.int32), steps.astype(np.int32))
    return Texture(*measures.T)


def window_texture(grey: ByteArray, window_px: int, distances_px: tuple[int, ...] = DISTANCES_PX) -> Texture:
    """Texture of all whole ``window_px`` windows of ``grey``, row by row from the top."""
    rows, columns = grey.shape[0] // window_px, grey.shape[1] // window_px
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    labels = np.zeros(grey.shape, dtype=np.int32)
    labels[: rows * window_px, : columns * window_px] = (index + 1).repeat(window_px, 0).repeat(window_px, 1)
    corner = np.stack([index % columns, index // columns], axis=-1).reshape(-1, 2) * window_px
    boxes = np.concatenate([corner, np.full_like(corner, window_px)], axis=1)
    return region_texture(grey, labels, boxes, distances_px)


@numba.njit(cache=True)
def _region_kernel(grey: ByteArray, labels: IntArray, boxes: IntArray, steps: IntArray) -> FloatArray:
    measures = np.zeros((boxes.shape[0], 5))
    counts = np.zeros(LEVELS * LEVELS, dtype=np.int32)
    met = np.empty(LEVELS * LEVELS, dtype=np.int32)
    for region in range(boxes.shape[0]):
        measures[region, 2] = _variance(grey, labels, region + 1, boxes[region])
        for step in range(steps.shape[0]):
            dx, dy = steps[step, 0], steps[step, 1]
            number = _count_pairs(grey, labels, region + 1, boxes[region], dx, dy, counts, met)
            _add_measures(counts, met, number, steps.shape[0], measures[region])
    return measures


@numba.njit(cache=True)
def _variance(grey: ByteArray, labels: IntArray, label: int, box: IntArray) -> float:
    count, total, squares = 0, 0.0, 0.0
    for y in range(box[1], box[1] + box[3]):
        for x in range(box[0], box[0] + box[2]):
            if labels[y, x] == label:
                value = float(grey[y, x])
                count += 1
                total += value
                squares += value * value
    return squares / count - (total / count) ** 2 if count else 0.0


@numba.njit(cache=True)
def _count_pairs(
    grey: ByteArray, labels: IntArray, label: int, box: IntArray, dx: int, dy: int, counts: IntArray, met: IntArray
) -> int:
    """Count the pairs (pixel, pixel + (dx, dy)) inside the region by their two levels, the smaller one first.

    ``met`` lists the cells of ``counts`` that are not 0; the answer is how many.
    """
    number = 0
    for y in range(max(box[1], box[1] - dy), min(box[1] + box[3], box[1] + box[3] - dy)):
        for x in range(box[0], box[0] + box[2] - dx):
            if labels[y, x] == label and labels[y + dy, x + dx] == label:
                one, other = grey[y, x] >> 3, grey[y + dy, x + dx] >> 3
                cell = min(one, other) * LEVELS + max(one, other)
                if counts[cell] == 0:
                    met[number] = cell
                    number += 1
                counts[cell] += 1
    return number


@numba.njit(cache=True)
def _add_measures(counts: IntArray, met: IntArray, number: int, steps: int, out: FloatArray) -> None:
    """Add one direction's share of ``out`` (contrast, energy, -, entropy, homogeneity) and clear its counts."""
    total = 0
    for place in range(number):
        total += counts[met[place]]
    if total == 0:
        out[1] += 1.0 / steps
        out[4] += 1.0 / steps
        return
    log_total = np.log(total)
    for place in range(number):
        cell = met[place]
        count = counts[cell]
        counts[cell] = 0
        share = count / total
        log_share = (_LOGS[count] if count < _LOGS.shape[0] else np.log(count)) - log_total
        square = float((cell // LEVELS - cell % LEVELS) ** 2)
        # Off the diagonal a pair stands in two cells of the symmetric matrix, with half of its share in each.
        mirrored = cell // LEVELS != cell % LEVELS
        out[0] += square * share / steps
        out[1] += share * share * (0.5 if mirrored else 1.0) / steps
        out[3] -= share * (log_share - (np.log(2.0) if mirrored else 0.0)) / steps
        out[4] += share / (1.0 + square) / steps
