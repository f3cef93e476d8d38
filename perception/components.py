"""Connected components of a mask with the size of each, found row by row from its runs of pixels."""

from __future__ import annotations

import numpy as np
from numba import njit

from worlds.types import BoolArray, IntArray


@njit(cache=True, nogil=True)
def components(mask: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
    """Labels (H, W) of the 8-connected components of ``mask``, area and longer side of the box (labels,) in pixels.

    Labels go up from 1 in reading order of each component's first pixel; 0 is what no component has, of size 0.
    """
    rows, starts, ends, parent = _runs(mask, True, 1)
    label_of, count = np.empty(len(rows), dtype=np.int32), 0
    for run in range(len(rows)):
        root = _root(parent, run)
        if root == run:
            count += 1
            label_of[run] = count
        else:
            label_of[run] = label_of[root]
    labels = np.zeros(mask.shape, dtype=np.int32)
    area, box = np.zeros(count + 1, dtype=np.int32), np.zeros((count + 1, 3), dtype=np.int32)  # left, right, top
    extent = np.zeros(count + 1, dtype=np.int32)
    for run in range(len(rows)):
        label, y, start, end = label_of[run], rows[run], starts[run], ends[run]
        labels[y, start:end] = label
        if area[label] == 0:
            box[label] = start, end, y
        area[label] += end - start
        box[label, 0], box[label, 1] = min(box[label, 0], start), max(box[label, 1], end)
        extent[label] = max(box[label, 1] - box[label, 0], y + 1 - box[label, 2])
    return labels, area, extent


@njit(cache=True, nogil=True)
def filled(mask: BoolArray) -> BoolArray:
    """``mask`` (H, W) with its holes: what no way, straight on from pixel to pixel, leads to from the border."""
    rows, starts, ends, parent = _runs(mask, False, 0)
    outside = np.zeros(len(rows), dtype=np.bool_)
    for run in range(len(rows)):
        edge = rows[run] == 0 or rows[run] == mask.shape[0] - 1 or starts[run] == 0 or ends[run] == mask.shape[1]
        if edge:
            outside[_root(parent, run)] = True
    answer = mask.copy()
    for run in range(len(rows)):
        if not outside[_root(parent, run)]:
            answer[rows[run], starts[run] : ends[run]] = True
    return answer


@njit(cache=True, nogil=True)
def _runs(mask: BoolArray, value: bool, reach: int) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Row, first column, column after the last and an earlier run of the same component (itself: none), (N,) each.

    Of the pixels with that ``value``; ``reach`` 1 connects along diagonals too, 0 does not.
    """
    height, width = mask.shape
    most = height * ((width + 1) // 2)
    rows, starts = np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32)
    ends, parent = np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32)
    count, above, above_end = 0, 0, 0
    for y in range(height):
        first, x = count, 0
        while x < width:
            if mask[y, x] != value:
                x += 1
                continue
            start = x
            while x < width and mask[y, x] == value:
                x += 1
            rows[count], starts[count], ends[count], parent[count] = y, start, x, count
            while above < above_end and ends[above] + reach <= start:
                above += 1
            touching = above
            while touching < above_end and starts[touching] < x + reach:
                one, other = _root(parent, count), _root(parent, touching)
                parent[max(one, other)] = min(one, other)
                touching += 1
            count += 1
        above, above_end = first, count
    return rows[:count], starts[:count], ends[:count], parent[:count]


@njit(cache=True, nogil=True)
def _root(parent: IntArray, run: int) -> int:
    while parent[run] != run:
        parent[run] = parent[parent[run]]
        run = parent[run]
    return int(run)
