"""Disparities finer than block matching gives them, and not smeared over the outlines of rocks.

A block that covers both a rock and the ground behind it tells a disparity between the two: the rock comes out too low,
the ground around it too high. Here each pixel's disparity is sought again by the intensity gradient (Lucas and Kanade,
IJCAI 1981, along the row), in a window of which only the pixels of its own surface count.
"""

from __future__ import annotations

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from worlds.types import BoolArray, ByteArray, IntArray

SingleArray = NDArray[np.float32]
_SMOOTH_PX = 0.6  # one sigma: less is noise, more brings the other surface in
_HALF_PX, _ROUNDS = 2, 3  # of the window; steps of the search
_RING_PX = 5  # of ground around rocks that is sought again
_NOISE = 2.0  # square of grey levels a pixel, summed: where the window shows no more, a disparity stays
_MOST_STEP, _MOST_PX = 0.5, 0.7  # in one step, and in all: what went farther lost its surface
_LEAST_PX = 7.0  # of disparity: farther rocks are too small for windows of their own
_STILL = 0.01


def sharpened(disparity: SingleArray, left: ByteArray, right: ByteArray, labels: IntArray) -> SingleArray:
    """The ``disparity`` (H, W) with that of rocks, and of the ground around them, sought again.

    ``labels`` (H, W) tell surfaces apart, 0 is ground; where nothing was matched it stays NaN.
    """
    rocks = (labels > 0).astype(np.uint8)
    side = 2 * _RING_PX + 1
    which = (cv2.dilate(rocks, np.ones((side, side), np.uint8)) > 0) & (disparity > _LEAST_PX)
    smooth = [
        np.asarray(cv2.GaussianBlur(picture.astype(np.float32), (0, 0), _SMOOTH_PX), np.float32)
        for picture in (left, right)
    ]
    return _sought(smooth[0], smooth[1], labels.astype(np.int32), disparity, np.asarray(which))


@numba.njit(cache=True)
def _sought(
    left: SingleArray, right: SingleArray, labels: IntArray, disparity: SingleArray, which: BoolArray
) -> SingleArray:
    height, width = left.shape
    answer = disparity.copy()
    for y in range(height):
        for x in range(width):
            if not which[y, x]:
                continue
            found = _by_gradient(left, right, labels, x, y, disparity[y, x])
            if abs(found - disparity[y, x]) < _MOST_PX:
                answer[y, x] = found
    return answer


@numba.njit(cache=True)
def _by_gradient(left: SingleArray, right: SingleArray, labels: IntArray, x: int, y: int, start: float) -> float:
    height, width = left.shape
    disparity = start
    for _ in range(_ROUNDS):
        slope_error, slope_square = 0.0, _NOISE
        for v in range(max(y - _HALF_PX, 0), min(y + _HALF_PX + 1, height)):
            for u in range(max(x - _HALF_PX, 0), min(x + _HALF_PX + 1, width)):
                partner = u - disparity
                column = int(np.floor(partner))
                if labels[v, u] != labels[y, x] or column < 1 or column >= width - 2:
                    continue
                share = partner - column
                here, there = right[v, column], right[v, column + 1]
                slope = 0.5 * ((1.0 - share) * (there - right[v, column - 1]) + share * (right[v, column + 2] - here))
                error = left[v, u] - ((1.0 - share) * here + share * there)
                weight = 1.0 / (1.0 + ((u - x) ** 2 + (v - y) ** 2) / _HALF_PX**2)
                slope_error += weight * slope * error
                slope_square += weight * slope * slope
        step = min(max(-slope_error / slope_square, -_MOST_STEP), _MOST_STEP)
        disparity += step
        if abs(step) < _STILL:
            break
    return disparity
