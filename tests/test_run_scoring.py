from __future__ import annotations

import numpy as np

from rover_sim.scoring import rock_extents_px, true_classes


def _scene() -> tuple[np.ndarray, np.ndarray]:
    """One row of six windows: sky, one speck on sand, small clasts, a small rock, rubble and one big rock."""
    ids = np.zeros((20, 120), dtype=np.int32)
    ids[3:5, 30:32] = 20  # 4 pixels
    depth = np.full((20, 120), 3.0, dtype=np.float32)
    ids[:, :20], depth[:, :20] = -1, np.inf
    ids[5:8, 45:48] = 1  # 9 pixels
    ids[5:11, 65:71] = 2  # 36 pixels, 9 % cover
    for index, row in enumerate(range(0, 20, 5)):
        ids[row : row + 2, 80:100] = 3 + index  # four strips of 40 pixels: 40 % cover, none of them dominates
    ids[0:20, 100:112] = 9  # 60 % of the window, 20 pixels high
    return ids, depth


def test_each_window_gets_the_class_of_the_working_definition() -> None:
    ids, depth = _scene()
    assert "".join(true_classes(ids, depth)[0]) == "USVmMB"


def test_two_specks_are_more_than_one() -> None:
    ids = np.zeros((20, 20), dtype=np.int32)
    near = np.ones(ids.shape, dtype=np.float32)
    ids[2:4, 2:4] = 1
    assert true_classes(ids, near).tolist() == [["S"]]
    ids[9:11, 9:11] = 2
    assert true_classes(ids, near).tolist() == [["V"]]


def test_clasts_under_two_pixels_across_are_grains() -> None:
    ids = np.zeros((20, 40), dtype=np.int32)
    for index, column in enumerate(range(0, 18, 2)):
        ids[5, column : column + 1] = 1 + index  # nine clasts of one pixel
    ids[10:12, 19:22] = 30  # six pixels of one clast, four of them in the second window: resolved, a speck there
    assert true_classes(ids, np.ones(ids.shape, dtype=np.float32)).tolist() == [["S", "S"]]


def test_far_windows_are_uncertain_whatever_they_show() -> None:
    ids, _ = _scene()
    assert set(true_classes(ids, np.full(ids.shape, 20.0, dtype=np.float32)).ravel()) == {"U"}


def test_extents_span_windows_and_absent_ids_have_none() -> None:
    ids = np.zeros((40, 40), dtype=np.int32)
    ids[10:14, 15:30] = 2
    assert rock_extents_px(ids).tolist() == [0, 0, 15]


def test_a_picture_without_rocks_is_all_sand() -> None:
    letters = true_classes(np.zeros((240, 320), dtype=np.int32), np.ones((240, 320), dtype=np.float32))
    assert letters.shape == (12, 16)
    assert set(letters.ravel()) == {"S"}
