"""How well rock pixels and rock objects agree with labels.

Objects are 8-connected components of the label. One that shares more than half of the union with a found rock (IoU)
matches it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray

from worlds.types import BoolArray, IntArray

LEAST_OBJECT_PX = 150  # smaller ones are often left unlabelled by people
MATCH_IOU = 0.5


@dataclass(frozen=True)
class RockCounts:
    """Counts of one picture, or summed over several: pixels and objects in both, only found, only labelled."""

    both_px: int = 0
    extra_px: int = 0
    missed_px: int = 0
    matched: int = 0
    extra: int = 0
    missed: int = 0

    def __add__(self, other: RockCounts) -> RockCounts:
        return RockCounts(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    @property
    def iou(self) -> float:
        """Of the pixels; 1 where nothing is rock and nothing was found."""
        return _share(self.both_px, self.both_px + self.extra_px + self.missed_px)

    @property
    def precision(self) -> float:
        """Share of the found pixels that are rock."""
        return _share(self.both_px, self.both_px + self.extra_px)

    @property
    def recall(self) -> float:
        """Share of the rock pixels that were found."""
        return _share(self.both_px, self.both_px + self.missed_px)

    @property
    def object_precision(self) -> float:
        """Share of the found objects that match one."""
        return _share(self.matched, self.matched + self.extra)

    @property
    def object_recall(self) -> float:
        """Share of the objects that were found."""
        return _share(self.matched, self.matched + self.missed)

    @property
    def object_f1(self) -> float:
        """Harmonic mean of object precision and recall."""
        return _share(2 * self.matched, 2 * self.matched + self.extra + self.missed)


def count_rocks(found: IntArray, truth: BoolArray) -> RockCounts:
    """Counts of a picture from rock ids ``found`` (H, W), 0 = none, and labelled rock ``truth`` (H, W)."""
    mask = found > 0
    labels = np.asarray(cv2.connectedComponents(truth.view(np.uint8), connectivity=8)[1], dtype=np.int32)
    return RockCounts(
        int((mask & truth).sum()), int((mask & ~truth).sum()), int((truth & ~mask).sum()), *match_objects(found, labels)
    )


def match_objects(found: IntArray, true: IntArray) -> tuple[int, int, int]:
    """Objects matched, only found, only true, of id pictures (H, W); objects under `LEAST_OBJECT_PX` are left out."""
    columns = int(true.max()) + 1
    pairs, common = np.unique(found.astype(np.int64) * columns + true, return_counts=True)
    area_found, area_true = np.bincount(found.ravel()), np.bincount(true.ravel())
    left, right = pairs // columns, pairs % columns
    overlap = common / (area_found[left] + area_true[right] - common)
    large = (left > 0) & (right > 0) & (area_found[left] >= LEAST_OBJECT_PX) & (area_true[right] >= LEAST_OBJECT_PX)
    # Above one half no object can have two partners: no order of matching is needed.
    matched = int((large & (overlap > MATCH_IOU)).sum())
    return matched, _large(area_found) - matched, _large(area_true) - matched


def _large(area: NDArray[np.int64]) -> int:
    return int((area[1:] >= LEAST_OBJECT_PX).sum())


def _share(part: int, whole: int) -> float:
    return part / whole if whole else 1.0
