"""Parts of rocks on depths worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from perception.rejoining import rejoined
from worlds.types import FloatArray, IntArray

SHAPE = (40, 60)


def two_parts(step_m: float, depth_m: float = 2.0) -> tuple[IntArray, FloatArray]:
    """A part over another one, 100 pixels each, the upper one farther by a step."""
    labels, depth = np.zeros(SHAPE, np.int32), np.full(SHAPE, depth_m)
    labels[10:20, 20:30], labels[20:30, 20:30] = 2, 1
    depth[:20] += step_m
    return labels, depth


@pytest.mark.parametrize(("step_m", "count"), [(0.0, 1), (0.04, 1), (-0.04, 1), (0.06, 2), (-0.06, 2), (0.5, 2)])
def test_a_step_of_depth_tells_two_rocks_from_parts_of_one(step_m: float, count: int) -> None:
    labels, depth = two_parts(step_m)
    blobs, owner = rejoined(labels, int(labels.max()), depth)
    assert len(blobs) == count
    assert sorted(set(owner.tolist())) == list(range(count))
    assert blobs.area_px.sum() == 200
    for label in (1, 2):
        assert (blobs.labels[labels == label] == owner[label - 1] + 1).all()


def test_side_by_side_parts_and_chains_are_put_together() -> None:
    labels, depth = np.zeros(SHAPE, np.int32), np.full(SHAPE, 1.5)
    for part in range(4):
        labels[10:20, 10 + 8 * part : 18 + 8 * part] = part + 1
    labels[30:38, 10:20] = 5
    blobs, owner = rejoined(labels, int(labels.max()), depth)
    assert blobs.area_px.tolist() == [320, 80]
    assert owner.tolist() == [0, 0, 0, 0, 1]


def test_what_is_small_far_or_not_matched_stays_apart() -> None:
    labels, depth = two_parts(0.0)
    small = labels.copy()
    small[10:16] = 0
    assert len(rejoined(small, 2, depth)[0]) == 2
    assert len(rejoined(labels, int(labels.max()), depth + 2.0)[0]) == 2
    unmatched = depth.copy()
    unmatched[18:20] = np.nan
    assert len(rejoined(labels, int(labels.max()), unmatched)[0]) == 2


def test_a_picture_without_rocks_has_none() -> None:
    blobs, owner = rejoined(np.zeros(SHAPE, np.int32), 0, np.full(SHAPE, 2.0))
    assert len(blobs) == 0
    assert len(owner) == 0


def test_a_face_goes_to_the_rock_that_it_continues_and_else_is_none() -> None:
    labels, depth = np.zeros(SHAPE, np.int32), np.full(SHAPE, 1.5)
    labels[10:14, 20:30] = 1  # a small part of a rock, 40 pixels
    labels[14:30, 20:30] = 2  # its face, by depth alone
    labels[10:30, 45:55] = 3  # ground that rises somewhere
    blobs, owner = rejoined(labels, 1, depth)
    assert blobs.area_px.tolist() == [200]
    assert owner.tolist() == [0, 0, -1]
    depth[:14] += 0.2
    blobs, owner = rejoined(labels, 1, depth)
    assert blobs.area_px.tolist() == [40]
    assert owner.tolist() == [0, -1, -1]
