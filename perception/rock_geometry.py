"""Shape of rock blobs in the picture: formation, sections A0..A8, outline rows.

Our reading of the paper's figure 3 (section 4): a blob is probed along nine parallel segments A0..A8 across its first
principal axis, at equal steps from tip to tip, A4 through the middle. Formations 1..9 are the nine 20-degree sectors
of that axis's direction over 180 degrees; 0 is the hemisphere, for blobs with nearly equal principal extents.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from perception.blobs import Blobs
from worlds.types import FloatArray, IntArray

SECTIONS = 9
_SECTOR_RAD = np.pi / 9.0
_PROBE_PX = 0.25
_FAR = 1 << 20  # probes: farther than any picture reaches
_OUTLINE_QUANTILE = 0.1  # of a blob's columns: a spur of a pixel or two does not move its base


@dataclass(frozen=True, eq=False)
class RockOutlines:
    """Shape of R blobs; all lengths in pixels."""

    formation: IntArray  # (R,) 0..9
    length_px: FloatArray  # (R,) from tip to tip along the first principal axis
    sections_px: FloatArray  # (R, 9) diameters A0..A8 across it
    left_px: FloatArray  # (R,) outermost columns
    right_px: FloatArray
    top_px: FloatArray  # (R,) row of the upper outline
    base_px: FloatArray  # (R,) row of the base line: the near edge where the rock leaves the ground
    area_px: FloatArray  # (R,) of the silhouette, square pixels


def outlines(blobs: Blobs, round_ratio: float) -> RockOutlines:
    """Shape of each blob; extents that differ by less than ``round_ratio`` make a hemisphere."""
    x, _, width, _ = blobs.box_px.T.astype(np.float64)
    top, base = _outline_rows(blobs.labels, blobs.box_px, _OUTLINE_QUANTILE).T
    length, sections = probe_sections(blobs)
    ratio = np.sqrt(blobs.variance_px2[:, 0] / blobs.variance_px2[:, 1])
    which, area = formation(blobs.axis_rad, ratio, round_ratio), blobs.area_px.astype(np.float64)
    return RockOutlines(which, length, sections, x, x + width, top, base, area)


def formation(axis_rad: FloatArray, ratio: FloatArray, round_ratio: float) -> IntArray:
    """Formation (R,) of axis directions in [0, pi) and ratios of the principal extents."""
    sector = np.floor(np.mod(axis_rad, np.pi) / _SECTOR_RAD).astype(np.int32) + 1
    return np.asarray(np.where(ratio < round_ratio, 0, np.minimum(sector, 9)), dtype=np.int32)


def probe_sections(blobs: Blobs) -> tuple[FloatArray, FloatArray]:
    """Length (R,) along the first principal axis and diameters (R, 9) across it, in pixels."""
    return _probe_kernel(blobs.labels, blobs.box_px, blobs.centre_px, blobs.axis_rad)


@numba.njit(cache=True)
def _outline_rows(labels: IntArray, boxes: IntArray, quantile: float) -> FloatArray:
    """Upper and lower outline row (R, 2): quantiles over the columns of the blob's first and last pixel edges."""
    answer = np.zeros((boxes.shape[0], 2))
    for region in range(boxes.shape[0]):
        x, y, width, height = boxes[region]
        tops, bases = np.zeros(width), np.zeros(width)
        for column in range(width):
            first, last = y, y + height - 1
            while labels[first, x + column] != region + 1 and first < last:
                first += 1
            while labels[last, x + column] != region + 1 and first < last:
                last -= 1
            tops[column], bases[column] = first, last + 1
        tops.sort()
        bases.sort()
        rank = int(quantile * (width - 1))
        answer[region, 0] = tops[rank]
        answer[region, 1] = bases[width - 1 - rank]
    return answer


@numba.njit(cache=True)
def _probe_kernel(
    labels: IntArray, boxes: IntArray, centres: FloatArray, axes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    count = boxes.shape[0]
    lengths, sections = np.zeros(count), np.zeros((count, SECTIONS))
    for region in range(count):
        cos, sin = np.cos(axes[region]), -np.sin(axes[region])  # rows grow downwards
        low, high = _extent(labels, boxes[region], region + 1, centres[region], cos, sin)
        lengths[region] = high - low
        for i in range(SECTIONS):
            # The tips are probed half a pixel inside, where the outermost pixels have their centres.
            along = low + 0.5 + (high - low - 1.0) * i / (SECTIONS - 1.0)
            x, y = centres[region, 0] + along * cos, centres[region, 1] + along * sin
            sections[region, i] = _diameter(labels, region + 1, boxes[region], x, y, -sin, cos)
    return lengths, sections


@numba.njit(cache=True)
def _extent(
    labels: IntArray, box: IntArray, label: int, centre: FloatArray, cos: float, sin: float
) -> tuple[float, float]:
    """Outermost positions along the axis, half a pixel beyond the outermost pixel centres."""
    low, high = np.inf, -np.inf
    for y in range(box[1], box[1] + box[3]):
        for x in range(box[0], box[0] + box[2]):
            if labels[y, x] == label:
                along = (x + 0.5 - centre[0]) * cos + (y + 0.5 - centre[1]) * sin
                low, high = min(low, along), max(high, along)
    return low - 0.5, high + 0.5


@numba.njit(cache=True)
def _diameter(labels: IntArray, label: int, box: IntArray, x: float, y: float, dx: float, dy: float) -> float:
    """Distance between the outermost pixels of the region along the line through (x, y); 0 where it misses."""
    first, last = _inside(x, dx, box[0], box[0] + box[2])
    low, high = _inside(y, dy, box[1], box[1] + box[3])
    first, last = max(first, low), min(last, high)
    while first <= last and not _hits(labels, label, x + first * _PROBE_PX * dx, y + first * _PROBE_PX * dy):
        first += 1
    while first < last and not _hits(labels, label, x + last * _PROBE_PX * dx, y + last * _PROBE_PX * dy):
        last -= 1
    return (last - first + 1) * _PROBE_PX if first <= last else 0.0


@numba.njit(cache=True)
def _inside(start: float, slope: float, low: float, high: float) -> tuple[int, int]:
    """First and last probe of a line that may lie between ``low`` and ``high`` along one axis."""
    if abs(slope) < 1e-9:
        return (-_FAR, _FAR) if low <= start <= high else (_FAR, -_FAR)
    ends = (low - start) / slope / _PROBE_PX, (high - start) / slope / _PROBE_PX
    return max(int(np.floor(min(ends))), -_FAR), min(int(np.ceil(max(ends))), _FAR)


@numba.njit(cache=True)
def _hits(labels: IntArray, label: int, x: float, y: float) -> bool:
    column, row = int(np.floor(x)), int(np.floor(y))
    return bool(0 <= row < labels.shape[0] and 0 <= column < labels.shape[1] and labels[row, column] == label)
