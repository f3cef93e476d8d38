"""Clasts down to a few pixels, pebbles as well as rocks: how likely each pixel shows one, by evidence that adds up.

What gives them away is that they are less red than the soil. The ratio of red to blue does not change with the light
on a surface, and of all mixtures of channels with that property it stands out most from noise that is alike in all
channels. Where a knowledge file has this evidence, rocks are made of these pixels too (`perception.pipeline`); the
evidence of rock (`perception.binarize`) is one of its cues.

Two looks: the first judges each pixel by itself and its neighbourhood; the second, where the first found anything
near, also by what the first says of its neighbours.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from perception.class_definition import window_stages
from perception.components import components
from perception.evidence import Planes, SingleArray, chance_of
from perception.knowledge_base import ClastKnowledge
from perception.soil_reference import percentile
from worlds.types import BoolArray, ByteArray, FloatArray

AROUND_PX, LIGHT_AROUND_PX = 7, 13
GATE = 0.05  # of the first look's chances at a pixel and its eight neighbours; under it there is no second look
_NEAR = np.ones((3, 3), dtype=np.uint8)
_LOGARITHMS = np.log(np.arange(256) + 1.0).astype(np.float32)


def redness(picture: ByteArray, hidden: BoolArray) -> SingleArray:
    """Logarithm of red over blue (H, W) of a picture, grey (H, W) or RGB (H, W, 3), minus its median where seen."""
    colour = picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2)
    seen = _logarithm_of_ratio(colour[::4, ::4], 0.0)[~hidden[::4, ::4]]
    return _logarithm_of_ratio(colour, percentile(seen, 50.0) if seen.size else 0.0)


def clast_chance(
    red: SingleArray, grey: ByteArray, score: SingleArray, hidden: BoolArray, know: ClastKnowledge
) -> SingleArray:
    """Chance (H, W) in 0..1 that a pixel shows a clast; 0 where ``hidden``.

    ``red`` (H, W) is the picture's `redness`, ``grey`` (H, W) its 8-bit grey, ``score`` (H, W) the evidence of rock.
    """
    seen = np.flatnonzero(~hidden.all(axis=1))
    top = max(int(seen[0]) - LIGHT_AROUND_PX, 0) if seen.size else len(red)  # what is measured reaches no farther
    chance = np.zeros_like(red)
    if top < len(red):
        chance[top:] = _two_looks(red[top:], grey[top:], score[top:], hidden[top:], know)
    return chance


def _two_looks(
    red: SingleArray, grey: ByteArray, score: SingleArray, hidden: BoolArray, know: ClastKnowledge
) -> SingleArray:
    planes = first_planes(red, grey, score)
    chance = chance_of(planes, know.first.bias, know.first.named(), hidden)
    add_second_planes(planes, chance)
    unlikely = hidden | (planes["chance_most"] < GATE)
    return chance_of(planes, know.second.bias, know.second.named(), unlikely, chance)


def clast_stages(chance: SingleArray, cut: float) -> FloatArray:
    """Place in `STAGES` (rows, columns) of each window, were all pixels with more ``chance`` (H, W) clasts."""
    return window_stages(*components(chance > cut))


def first_planes(red: SingleArray, grey: ByteArray, score: SingleArray) -> Planes:
    """The measures of a pixel and its neighbourhood, each (H, W)."""
    light = np.asarray(cv2.LUT(grey, _LOGARITHMS), dtype=np.float32)
    around = _mean(red, AROUND_PX)
    return {
        "red": red,
        "red_median": np.asarray(cv2.medianBlur(red, 3), dtype=np.float32),
        "red_mean": _mean(red, 3),
        "red_over": red - around,
        "red_most": np.asarray(cv2.dilate(red, _NEAR)) - around,
        "red_least": np.asarray(cv2.erode(red, _NEAR)) - around,
        "score": score,
        "score_around": _mean(score, AROUND_PX),
        "light_over": light - _mean(light, LIGHT_AROUND_PX),
        "light_detail": light - _mean(light, 3),
        "light_range": np.asarray(cv2.morphologyEx(light, cv2.MORPH_GRADIENT, _NEAR), dtype=np.float32),
    }


def add_second_planes(planes: Planes, chance: SingleArray) -> None:
    """Add the measures of what the first look found, ``chance`` (H, W)."""
    planes["chance"] = chance
    planes["chance_mean"] = _mean(chance, 3)
    planes["chance_most"] = np.asarray(cv2.dilate(chance, _NEAR))
    planes["chance_least"] = np.asarray(cv2.erode(chance, _NEAR))
    planes["chance_around"] = _mean(chance, AROUND_PX)


def _mean(plane: SingleArray, size_px: int) -> SingleArray:
    return np.asarray(cv2.blur(plane, (size_px, size_px)), dtype=np.float32)


@njit(cache=True, nogil=True)
def _logarithm_of_ratio(picture: ByteArray, usual: float) -> SingleArray:
    """Logarithm of red over blue (H, W), minus the ``usual`` one."""
    less = np.float32(usual)
    ratio = np.empty(picture.shape[:2], dtype=np.float32)
    for y in range(picture.shape[0]):
        for x in range(picture.shape[1]):
            ratio[y, x] = _LOGARITHMS[picture[y, x, 0]] - _LOGARITHMS[picture[y, x, 2]] - less
    return ratio
