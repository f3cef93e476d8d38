"""Fuzzy rock classifier: how certain each blob is a rock (the paper's FLTC, section 4, steps 4 to 6).

Inputs are the paper's contrast, energy, variance and area, and the mean rock score of the blob. The paper prints its
membership functions as figures only; ours stand in the knowledge file, with the logarithms of contrast and variance.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from perception.blobs import Blobs
from perception.texture import region_texture
from worlds.fuzzy import RuleBase, evaluate
from worlds.types import ByteArray, FloatArray, IntArray

_FLOOR = 0.01  # keeps the logarithm of a flat blob finite


def blob_features(grey: ByteArray, score: NDArray[np.float32], blobs: Blobs) -> dict[str, FloatArray]:
    """Inputs of the classifier, each (R,): log10 contrast, energy, log10 variance, log10 area in pixels, mean score."""
    texture = region_texture(grey, blobs.labels, blobs.box_px)
    area = np.maximum(blobs.area_px, 1).astype(np.float64)
    return {
        "contrast": np.log10(np.maximum(texture.contrast, _FLOOR)),
        "energy": texture.energy,
        "variance": np.log10(np.maximum(texture.variance, _FLOOR)),
        "area": np.log10(area),
        "strength": _sums(blobs.labels, score, len(blobs)) / area,
    }


def rock_certainty(features: dict[str, FloatArray], rules: RuleBase) -> FloatArray:
    """Certainty (R,) in 0..1 that each blob is a rock; 0 where no rule speaks for anything."""
    if len(features["area"]) == 0:
        return np.empty(0)
    return np.nan_to_num(evaluate(rules, features), nan=0.0)


@numba.njit(cache=True)
def _sums(labels: IntArray, values: NDArray[np.float32], count: int) -> FloatArray:
    """Sum (count,) of ``values`` (H, W) over each label from 1."""
    sums = np.zeros(count + 1)
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            if labels[y, x] > 0:
                sums[labels[y, x]] += values[y, x]
    return sums[1:]
