"""Blobs of rock pixels: connected components with centre, moments and where they touch the border.

Coordinates are pixels with the centre of the first one at (0.5, 0.5). Angles are counter-clockwise as seen, from the
picture's right: the image row grows downwards, so the sign of the covariance is turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

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


def find_blobs(mask: BoolArray, min_area_px: int = 1) -> Blobs:
    """8-connected blobs of ``mask`` (H, W) with at least ``min_area_px`` pixels."""
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    order = np.argsort(-stats[1:, cv2.CC_STAT_AREA], kind="stable") + 1
    order = order[stats[order, cv2.CC_STAT_AREA] >= min_area_px]
    rank = np.zeros(count, dtype=np.int32)
    rank[order] = np.arange(1, len(order) + 1, dtype=np.int32)
    area = stats[order, cv2.CC_STAT_AREA].astype(np.int32)
    box = stats[order, :4].astype(np.int32)
    labels = rank[labels]
    centre = np.asarray(centres[order] + 0.5, dtype=np.float64)
    variance, axis = _principal(labels, area, centre)
    return Blobs(labels, area, box, centre, variance, axis, _touches(box, mask.shape))


def select(blobs: Blobs, keep: BoolArray) -> Blobs:
    """The blobs where ``keep`` (R,) holds, relabelled from 1 in the same order."""
    rank = np.zeros(len(blobs) + 1, dtype=np.int32)
    rank[1:][keep] = np.arange(1, int(keep.sum()) + 1, dtype=np.int32)
    return Blobs(
        rank[blobs.labels],
        blobs.area_px[keep],
        blobs.box_px[keep],
        blobs.centre_px[keep],
        blobs.variance_px2[keep],
        blobs.axis_rad[keep],
        blobs.border[keep],
    )


def _principal(labels: IntArray, area: IntArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal variances (R, 2) and axis directions (R,) from the second central moments."""
    rows, columns = np.nonzero(labels)
    owner = labels[rows, columns] - 1
    across = columns + 0.5 - centre[owner, 0]
    up = centre[owner, 1] - rows - 0.5
    size = len(area)

    def moment(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(owner, weights=values, minlength=size) / np.maximum(area, 1))

    xx, yy, xy = moment(across * across), moment(up * up), moment(across * up)
    # A pixel is a unit square, not a point: its own variance of 1/12 keeps thin blobs from having none.
    half_sum = (xx + yy) / 2.0 + 1.0 / 12.0
    half_span = np.hypot((xx - yy) / 2.0, xy)
    axis = np.mod(0.5 * np.arctan2(2.0 * xy, xx - yy), np.pi)
    return np.stack([half_sum + half_span, half_sum - half_span], axis=-1), axis


def _touches(box: IntArray, shape: tuple[int, ...]) -> BoolArray:
    x, y, width, height = box.T
    return np.stack([x == 0, y == 0, x + width == shape[1], y + height == shape[0]], axis=-1)
