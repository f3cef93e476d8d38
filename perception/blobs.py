"""Blobs of rock pixels: connected components with centre, moments and where they touch the border.

Coordinates are pixels with the centre of the first one at (0.5, 0.5). Angles are counter-clockwise as seen, from the
picture's right: the image row grows downwards, so the sign of the covariance is turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from perception.touching_rocks import part_at_necks
from worlds.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Blobs:
    """R blobs, largest first; blob i has the label i + 1."""

    labels: IntArray  # (H, W), 0 = none
    area_px: IntArray  # (R,)
    box_px: IntArray  # (R, 4) x, y, width, height
    centre_px: FloatArray  # (R, 2) column, row
    variance_px2: FloatArray  # (R, 2) along the first and the second principal axis
    axis_rad: FloatArray  # (R,) direction of the first principal axis, in [0, pi)
    border: BoolArray  # (R, 4) touches the left, top, right, bottom edge

    def __len__(self) -> int:
        return len(self.area_px)


def find_blobs(mask: BoolArray, min_area_px: int = 1, neck_ratio: float = 0.0) -> Blobs:
    """8-connected blobs of ``mask`` (H, W) with at least ``min_area_px`` pixels, parted at narrow necks."""
    return measured_blobs(part_at_necks(mask, neck_ratio), min_area_px)


def measured_blobs(labels: IntArray, min_area_px: int) -> Blobs:
    """Blobs of a picture of ``labels`` (H, W), relabelled by size, without those under ``min_area_px`` pixels."""
    area, box, moments = _measured(labels)
    order = np.argsort(-area, kind="stable")
    order = order[area[order] >= min_area_px]
    rank = np.zeros(len(area) + 1, dtype=np.int32)
    rank[order + 1] = np.arange(1, len(order) + 1, dtype=np.int32)
    area, box = area[order], box[order]
    centre, variance, axis, border = _principal(area, box, moments[order], labels.shape[0], labels.shape[1])
    return Blobs(_renamed(labels, rank), area, box, centre, variance, axis, border)


def select(blobs: Blobs, keep: BoolArray) -> Blobs:
    """The blobs where ``keep`` (R,) holds, relabelled from 1 in the same order."""
    if keep.all():
        return blobs
    rank = np.zeros(len(blobs) + 1, dtype=np.int32)
    rank[1:][keep] = np.arange(1, int(keep.sum()) + 1, dtype=np.int32)
    return Blobs(
        _renamed(blobs.labels, rank),
        blobs.area_px[keep],
        blobs.box_px[keep],
        blobs.centre_px[keep],
        blobs.variance_px2[keep],
        blobs.axis_rad[keep],
        blobs.border[keep],
    )


@numba.njit(cache=True)
def _measured(labels: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Area (R,), box (R, 4) and raw moments (R, 5) of the labels 1..R; a label without pixels has area 0.

    The moments are sums of x, y, x^2, y^2 and x y over pixel centres.
    """
    count = labels.max()
    area = np.zeros(count, dtype=np.int32)
    corners = np.zeros((count, 4), dtype=np.int32)  # left, top, right, bottom
    moments = np.zeros((count, 5))
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            label = labels[y, x] - 1
            if label < 0:
                continue
            if area[label] == 0:
                corners[label] = x, y, x, y
            area[label] += 1
            corners[label, 0] = min(corners[label, 0], x)
            corners[label, 2] = max(corners[label, 2], x)
            corners[label, 3] = y
            across, down = x + 0.5, y + 0.5
            moments[label, 0] += across
            moments[label, 1] += down
            moments[label, 2] += across * across
            moments[label, 3] += down * down
            moments[label, 4] += across * down
    corners[:, 2:] += 1 - corners[:, :2]
    return area, corners, moments


@numba.njit(cache=True)
def _renamed(labels: IntArray, names: IntArray) -> IntArray:
    """``labels`` (H, W) as ``names`` (labels,) calls them."""
    answer = np.empty_like(labels)
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            answer[y, x] = names[np.uint32(labels[y, x])]
    return answer


@numba.njit(cache=True)
def _principal(
    area: IntArray, box: IntArray, moments: FloatArray, height: int, width: int
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Centres (R, 2), principal variances (R, 2) and axis directions (R,) from raw moments; sides touched (R, 4)."""
    count = len(area)
    centre, variance, axis = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
    border = np.empty((count, 4), dtype=np.bool_)
    for blob in range(count):
        x, y, square_x, square_y, product = moments[blob] / area[blob]
        xx, yy, xy = square_x - x * x, square_y - y * y, x * y - product  # rows grow downwards
        # A pixel is a unit square, not a point: its own variance of 1/12 keeps thin blobs from having none.
        half_sum, half_span = (xx + yy) / 2.0 + 1.0 / 12.0, np.hypot((xx - yy) / 2.0, xy)
        centre[blob] = x, y
        variance[blob] = half_sum + half_span, half_sum - half_span
        axis[blob] = 0.5 * np.arctan2(2.0 * xy, xx - yy) % np.pi
        left, top, across, down = box[blob]
        border[blob] = left == 0, top == 0, left + across == width, top + down == height
    return centre, variance, axis, border
