"""Texture of picture regions: co-occurrence measures of the 2004 paper, and band-pass measures.

Co-occurrence follows Haralick, Shanmugam and Dinstein, IEEE Trans. SMC 3(6), 1973, over 32 grey levels (8-bit value
// 8), distance 1, the four directions 0, 45, 90 and 135 degrees, symmetric and normalised; each measure is the mean
over the directions. The paper prints entropy as ``-sum (i-j)^2 log P`` and homogeneity as ``sum P/(i-j)^2`` without the
diagonal; here both are Haralick's: ``-sum P log P`` (0 log 0 = 0) and ``sum P/(1+(i-j)^2)``. Energy is the paper's
equation 1, ``sum P^2``; variance is that of the 8-bit grey values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from worlds.types import ByteArray, FloatArray, IntArray

LEVELS = 32
_BAND_SIGMAS = ((0.8, 2.0), (3.0, 8.0))  # fine grain, coarse relief


@dataclass(frozen=True, eq=False)
class Texture:
    """Measures of R regions, each (R,)."""

    contrast: FloatArray
    energy: FloatArray
    variance: FloatArray
    entropy: FloatArray
    homogeneity: FloatArray


def region_texture(grey: ByteArray, labels: IntArray, boxes: IntArray) -> Texture:
    """Texture of the regions 1..R of ``labels`` (H, W) in ``grey`` (H, W).

    ``boxes`` (R, 4) holds x, y, width, height of each region. Only pairs with both pixels in the region count; a
    region without any pair has contrast 0, energy 1, entropy 0 and homogeneity 1.
    """
    measures = _region_kernel(grey, labels, np.ascontiguousarray(boxes, dtype=np.int32))
    return Texture(*measures.T)


def window_texture(grey: ByteArray, window_px: int) -> Texture:
    """Texture of all whole ``window_px`` windows of ``grey``, row by row from the top."""
    rows, columns = grey.shape[0] // window_px, grey.shape[1] // window_px
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    labels = np.zeros(grey.shape, dtype=np.int32)
    labels[: rows * window_px, : columns * window_px] = (index + 1).repeat(window_px, 0).repeat(window_px, 1)
    corner = np.stack([index % columns, index // columns], axis=-1).reshape(-1, 2) * window_px
    return region_texture(grey, labels, np.concatenate([corner, np.full_like(corner, window_px)], axis=1))


@dataclass(frozen=True, eq=False)
class BandTexture:
    """Band-pass measures of windows, each (rows, columns), in 8-bit grey levels."""

    fine: FloatArray  # largest |G(0.8) - G(2)|: one speck shows
    coarse: FloatArray  # 95th percentile of |G(3) - G(8)|: relief of the size of rocks


def band_texture(grey: ByteArray, window_px: int) -> BandTexture:
    """Differences of Gaussians over all whole windows of ``grey``; they part ripples (coarse) from pebbles (fine)."""
    single = grey.astype(np.float32)
    fine, coarse = (
        np.asarray(cv2.absdiff(cv2.GaussianBlur(single, (0, 0), low), cv2.GaussianBlur(single, (0, 0), high)))
        for low, high in _BAND_SIGMAS
    )
    tiles = _windows(coarse.astype(np.float32, copy=False), window_px)
    rank = round(0.95 * (tiles.shape[-1] - 1))
    return BandTexture(
        window_reduce(np.maximum, fine, window_px).astype(np.float64),
        np.partition(tiles, rank, axis=-1)[..., rank].astype(np.float64),
    )


def window_reduce(function: np.ufunc, values: NDArray[Any], size: int) -> NDArray[Any]:
    """``function`` (such as ``np.maximum``) over each whole ``size`` window of ``values`` (H, W)."""
    rows, columns = values.shape[0] // size, values.shape[1] // size
    lines = function.reduce(values[: rows * size].reshape(rows, size, -1), axis=1)
    return np.asarray(function.reduce(lines[:, : columns * size].reshape(rows, columns, size), axis=2))


def _windows(values: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    rows, columns = values.shape[0] // size, values.shape[1] // size
    tiles = values[: rows * size, : columns * size].reshape(rows, size, columns, size)
    return np.ascontiguousarray(tiles.transpose(0, 2, 1, 3)).reshape(rows, columns, size * size)


@numba.njit(cache=True)
def _region_kernel(grey: ByteArray, labels: IntArray, boxes: IntArray) -> FloatArray:
    measures = np.zeros((boxes.shape[0], 5))
    counts = np.zeros((LEVELS, LEVELS))
    for region in range(boxes.shape[0]):
        measures[region, 2] = _variance(grey, labels, region + 1, boxes[region])
        for dx, dy in ((1, 0), (1, -1), (0, 1), (1, 1)):
            total = _count_pairs(grey, labels, region + 1, boxes[region], dx, dy, counts)
            _add_measures(counts, total, measures[region])
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
    grey: ByteArray, labels: IntArray, label: int, box: IntArray, dx: int, dy: int, counts: FloatArray
) -> float:
    """Fill ``counts`` with the pairs (pixel, pixel + (dx, dy)) inside the region; the answer is how many."""
    counts[:] = 0.0
    total = 0.0
    for y in range(max(box[1], box[1] - dy), min(box[1] + box[3], box[1] + box[3] - dy)):
        for x in range(box[0], box[0] + box[2] - dx):
            if labels[y, x] == label and labels[y + dy, x + dx] == label:
                counts[grey[y, x] >> 3, grey[y + dy, x + dx] >> 3] += 1.0
                total += 1.0
    return total


@numba.njit(cache=True)
def _add_measures(counts: FloatArray, total: float, out: FloatArray) -> None:
    """Add a quarter of one direction's measures to ``out`` (contrast, energy, -, entropy, homogeneity)."""
    if total == 0.0:
        out[1] += 0.25
        out[4] += 0.25
        return
    for i in range(LEVELS):
        for j in range(LEVELS):
            both = counts[i, j] + counts[j, i]
            if both > 0.0:
                p = both / (2.0 * total)
                square = float((i - j) ** 2)
                out[0] += 0.25 * square * p
                out[1] += 0.25 * p * p
                out[3] -= 0.25 * p * np.log(p)
                out[4] += 0.25 * p / (1.0 + square)
