"""Connected components and their sizes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perception.components import components, filled


def test_sizes_and_labels_worked_by_hand() -> None:
    rows = ["#..#.", ".#.#.", "#....", "#..##", "..#.."]  # diagonals connect
    labels, area, extent = components(np.array([[cell == "#" for cell in row] for row in rows]))
    assert labels.tolist() == [[1, 0, 0, 2, 0], [0, 1, 0, 2, 0], [1, 0, 0, 0, 0], [1, 0, 0, 3, 3], [0, 0, 3, 0, 0]]
    assert area.tolist() == [0, 4, 2, 3]
    assert extent.tolist() == [0, 4, 2, 3]


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4, 0.5, 0.6, 0.9, 1.0])
def test_components_are_those_of_opencv(share: float) -> None:
    mask = np.random.default_rng(3).random((97, 131)) < share
    labels, area, extent = components(mask)
    count, theirs, told, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    assert len(area) == count
    assert len(np.unique(np.stack([labels, theirs], axis=-1).reshape(-1, 2), axis=0)) == len(np.unique(theirs))
    place = [int(np.flatnonzero(labels == label)[0]) for label in range(1, count)]
    told = told[theirs.ravel()[place]]
    assert area[1:].tolist() == told[:, cv2.CC_STAT_AREA].tolist()
    assert extent[1:].tolist() == told[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1).tolist()


def test_holes_are_what_no_straight_way_leads_to_from_the_border() -> None:
    rows = ["..###.", ".#...#", ".#.#.#", ".#...#", "..###.", "......"]
    found = filled(np.array([[cell == "#" for cell in row] for row in rows]))
    assert ["".join("#" if cell else "." for cell in row) for row in found] == [
        "..###.", ".#####", ".#####", ".#####", "..###.", "......",
    ]  # fmt: skip


@pytest.mark.parametrize("share", [0.0, 0.4, 0.6, 0.7, 1.0])
def test_holes_are_those_of_a_flood(share: float) -> None:
    mask = np.random.default_rng(4).random((60, 90)) < share
    framed = np.pad(mask.astype(np.uint8), 1)
    cv2.floodFill(framed, None, (0, 0), 2)
    np.testing.assert_array_equal(filled(mask), framed[1:-1, 1:-1] != 2)
