"""Rocks that touch in the picture are parted at their necks.

Pixels are flooded from the deepest of each blob, depth being the distance to the outline. Where two floods meet, the
depth there is half the width of the neck between two basins: a neck narrower than a share of the width of the smaller
basin keeps them apart, a wider one joins them. This is the watershed of the distance transform with the basins merged
by relative depth (Vincent and Soille, IEEE PAMI 13(6), 1991, for watersheds by flooding).
"""

from __future__ import annotations

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from perception.components import components
from worlds.types import BoolArray, ByteArray, IntArray

LEAST_PX = 60  # a basin smaller than this is a spur of its neighbour
_LEAST_DEPTH = 3.0
_STEPS = 8  # depth levels a pixel
_MARGIN_PX = 2  # rows without rock that outlines are measured against


def part_at_necks(mask: BoolArray, neck_ratio: float) -> IntArray:
    """Labels (H, W) of the parts of ``mask``, 1 and up in no special order; neck_ratio 0 parts nothing."""
    labels, area, _ = components(mask)
    if neck_ratio > 0.0 and area.max() > LEAST_PX:
        large, top, bottom = _of_area(labels, area, LEAST_PX)
        shown = slice(max(top - _MARGIN_PX, 0), bottom + _MARGIN_PX)
        # A picture full of rock has no outline: OpenCV then answers the largest number there is.
        depth = np.minimum(cv2.distanceTransform(large[shown], cv2.DIST_L2, 5), sum(mask.shape)).astype(np.float32)
        _flood(depth, _deepest_first(depth), neck_ratio, labels[shown], len(area))
    return labels


@numba.njit(cache=True)
def _of_area(labels: IntArray, area: IntArray, least_px: int) -> tuple[ByteArray, int, int]:
    """Pixels (H, W) of the components with more than ``least_px``; its first row and the one after the last."""
    large, top, bottom = np.zeros(labels.shape, dtype=np.uint8), labels.shape[0], 0
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            if area[np.uint32(labels[y, x])] > least_px:
                large[y, x] = 1
                top, bottom = min(top, y), y + 1
    return large, top, bottom


@numba.njit(cache=True)
def _deepest_first(depth: NDArray[np.float32]) -> IntArray:
    """Flat places of the pixels with depth, sorted by counting; equal depths in reading order."""
    flat = depth.ravel()
    top = 0
    for value in flat:
        top = max(top, int(value * _STEPS))
    start = np.zeros(top + 2, dtype=np.int32)
    for value in flat:
        if value > 0.0:
            start[top - int(value * _STEPS) + 1] += 1
    start = np.cumsum(start).astype(np.int32)
    order = np.empty(start[-1], dtype=np.int32)
    for place in range(flat.shape[0]):
        if flat[place] > 0.0:
            level = top - int(flat[place] * _STEPS)
            order[start[level]] = place
            start[level] += 1
    return order


@numba.njit(cache=True)
def _flood(depth: NDArray[np.float32], order: IntArray, neck_ratio: float, labels: IntArray, first: int) -> None:
    """Write the basin of each pixel with ``depth`` (H, W) into ``labels`` (H, W), counted from ``first``."""
    height, width = depth.shape
    flat = depth.ravel()
    owner = np.zeros((height + 2, width + 2), dtype=np.int32)  # basin of each pixel, with a rim that belongs to none
    parent = np.zeros(len(order) + 1, dtype=np.int32)
    peak = np.zeros(len(order) + 1, dtype=np.float32)
    area = np.zeros(len(order) + 1, dtype=np.int32)
    count = 0
    for place in order:
        y, x = place // width + 1, place % width + 1
        here = 0
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                if owner[y + dy, x + dx] > 0:
                    other = _root(parent, owner[y + dy, x + dx])
                    if here == 0:
                        here = other
                    elif other != here:
                        here = _meet(parent, peak, area, here, other, flat[place], neck_ratio)
        if here == 0:
            count += 1
            here = count
            parent[here], peak[here] = here, flat[place]
        owner[y, x] = here
        area[here] += 1
    for place in order:
        y, x = place // width, place % width
        labels[y, x] = first - 1 + _root(parent, owner[y + 1, x + 1])


@numba.njit(cache=True)
def _root(parent: IntArray, basin: int) -> int:
    while parent[basin] != basin:
        parent[basin] = parent[parent[basin]]
        basin = parent[basin]
    return int(basin)


@numba.njit(cache=True)
def _meet(
    parent: IntArray,
    peak: NDArray[np.float32],
    area: IntArray,
    first: int,
    second: int,
    depth: float,
    neck_ratio: float,
) -> int:
    """Join two basins that meet at ``depth``, or keep them apart; the answer is the one that takes the pixel."""
    deep, shallow = (first, second) if peak[first] >= peak[second] else (second, first)
    narrow = depth < neck_ratio * peak[shallow]
    if not (narrow and area[shallow] >= LEAST_PX and peak[shallow] >= _LEAST_DEPTH):
        parent[shallow] = deep
        area[deep] += area[shallow]
    return deep
