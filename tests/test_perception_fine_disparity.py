"""Known answers on pictures of two walls, one behind the other."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perception.fine_disparity import sharpened
from worlds.types import ByteArray, FloatArray, IntArray

NEAR, FAR = 12.4, 10.7  # pixels
SHAPE = (60, 120)


def walls() -> tuple[ByteArray, ByteArray, IntArray, FloatArray]:
    """A pair of pictures of a wall and a nearer board before it; labels and true disparities of the left one."""
    rng = np.random.default_rng(0)
    cloth = [cv2.GaussianBlur(rng.uniform(0.0, 255.0, SHAPE), (0, 0), 1.5) * 2.0 - 128.0 for _ in range(2)]
    columns, rows = np.meshgrid(np.arange(SHAPE[1], dtype=np.float32), np.arange(SHAPE[0], dtype=np.float32))
    board = (np.abs(columns - 60) < 18) & (np.abs(rows - 30) < 9)
    seen = (np.abs(columns + NEAR - 60) < 18) & (np.abs(rows - 30) < 9)
    moved = [
        cv2.remap(surface, columns + np.float32(shift), rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        for surface, shift in zip(cloth, (FAR, NEAR), strict=True)
    ]
    left, right = np.where(board, cloth[1], cloth[0]), np.where(seen, moved[1], moved[0])
    pictures = [np.clip(np.rint(p + rng.normal(0.0, 1.0, SHAPE)), 0, 255).astype(np.uint8) for p in (left, right)]
    return pictures[0], pictures[1], board.astype(np.int32), np.where(board, NEAR, FAR)


def test_a_disparity_between_two_surfaces_becomes_that_of_its_own() -> None:
    left, right, labels, true = walls()
    smeared = cv2.blur(true, (9, 9)).astype(np.float32)
    found = sharpened(smeared, left, right, labels)
    inside = labels == 1
    ring = (cv2.dilate(labels.astype(np.uint8), np.ones((11, 11), np.uint8)) > 0) & ~inside
    ring[:, :44] = False  # what the second eye sees the board before
    for part in (inside, ring):
        before, after = (np.abs(p - true)[part] for p in (smeared, found))
        assert np.median(after) < 0.06
        assert np.quantile(before, 0.75) > 0.4 > 3.0 * np.quantile(after, 0.75)


def test_what_lies_apart_from_rocks_or_was_not_matched_is_left() -> None:
    left, right, labels, true = walls()
    start = true.astype(np.float32)
    start[28:32] = np.nan
    found = sharpened(start, left, right, labels)
    assert np.isnan(found[28:32]).all()
    np.testing.assert_array_equal(found[:10], start[:10])


@pytest.mark.parametrize("wrong_px", [0.7, -0.7])
def test_where_there_is_no_texture_nothing_moves(wrong_px: float) -> None:
    flat, labels = np.full(SHAPE, 90, np.uint8), np.zeros(SHAPE, np.int32)
    labels[20:40, 40:70] = 1
    start = np.full(SHAPE, 11.0 + wrong_px, np.float32)
    np.testing.assert_array_equal(sharpened(start, flat, flat, labels), start)
