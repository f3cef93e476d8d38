"""Parts of one rock are put together again where two eyes see no step between them.

One picture parts rocks by their outline and light, and cuts a rock with a ridge or two lobes in two; each part then
counts as a lower rock of its own. Where one rock stands before another, the depth jumps at the cut between them; on a
rock it goes on. Of cuts on a rock seven to nine in ten are found so, of those between two rocks up to three in ten.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from perception.blobs import Blobs, measured_blobs
from worlds.types import FloatArray, IntArray

Places = NDArray[np.int64]
_STEP_M = 0.05  # of depth across a cut: more, and it parts two rocks
_REACH_M = 2.3  # beyond it a step is below the noise
_LEAST_PX, _LEAST_PAIRS = 50, 4  # of either part, and of pixels along the cut
_INSIDE_PX = 2  # of either part, whose depths count


def rejoined(labels: IntArray, rocks: int, depth_m: FloatArray) -> tuple[Blobs, IntArray]:
    """Blobs of the labels (H, W) 1 to R with parts of one rock put together; which blob (R,) each label went to.

    Labels over ``rocks`` are no rocks by themselves: those that belong to none are left out, as blob -1. ``depth_m``
    (H, W) is NaN where nothing was matched.
    """
    area_px = np.bincount(labels.ravel(), minlength=rocks + 1)[1:]
    count = len(area_px)
    first, second, step, depth = _across(labels, depth_m)
    which, pair = np.unique(first * (count + 1) + second, return_inverse=True)
    many = np.bincount(pair, minlength=len(which))
    mean_step, mean_depth = (np.bincount(pair, part, len(which)) / np.maximum(many, 1) for part in (step, depth))
    low, high = which // (count + 1), which % (count + 1)
    large = (np.minimum(area_px[low - 1], area_px[high - 1]) >= _LEAST_PX) | (high > rocks)
    same = large & (many >= _LEAST_PAIRS) & (mean_depth < _REACH_M) & (np.abs(mean_step) < _STEP_M)
    name = np.arange(count + 1)
    for a, b in zip(low[same].tolist(), high[same].tolist(), strict=True):
        first_name, second_name = sorted((int(name[a]), int(name[b])))
        name[name == second_name] = first_name  # that of a rock, if either is one
    name[name > rocks] = 0
    joined = name.astype(np.int32)[labels]
    blobs = measured_blobs(joined, 1)
    owner = np.zeros(count + 1, dtype=np.int32)
    owner[joined.ravel()] = blobs.labels.ravel()
    return blobs, owner[name[1:]] - 1


@numba.njit(cache=True)
def _across(labels: IntArray, depth: FloatArray) -> tuple[Places, Places, FloatArray, FloatArray]:
    """Each pair of neighbouring pixels of two parts: the lower label, the higher, the step of depth, the mean depth."""
    height, width = labels.shape
    first, second = np.empty(labels.size, dtype=np.int64), np.empty(labels.size, dtype=np.int64)
    step, mean = np.empty(labels.size), np.empty(labels.size)
    count = 0
    for y in range(height - 1):
        for x in range(width - 1):
            here = labels[y, x]
            for down in (0, 1):
                across = 1 - down
                there = labels[y + down, x + across]
                if min(here, there) == 0 or here == there or count == labels.size:
                    continue
                near = _inside(labels, depth, y, x, -down, -across)
                far = _inside(labels, depth, y + down, x + across, down, across)
                if np.isnan(near) or np.isnan(far):
                    continue
                first[count], second[count] = min(here, there), max(here, there)
                step[count] = far - near if here < there else near - far
                mean[count] = 0.5 * (near + far)
                count += 1
    return first[:count], second[:count], step[:count], mean[:count]


@numba.njit(cache=True)
def _inside(labels: IntArray, depth: FloatArray, y: int, x: int, down: int, across: int) -> float:
    """Mean depth of a pixel and of those behind it, away from the cut, that are of its part; NaN for none."""
    total, count = 0.0, 0
    for k in range(_INSIDE_PX):
        row, column = y + k * down, x + k * across
        inside = 0 <= row < labels.shape[0] and 0 <= column < labels.shape[1]
        if inside and labels[row, column] == labels[y, x] and not np.isnan(depth[row, column]):
            total += depth[row, column]
            count += 1
    return total / count if count > 0 else np.nan
