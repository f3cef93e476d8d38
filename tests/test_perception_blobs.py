from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.binarize import clean, close_edges, threshold_map
from perception.blobs import find_blobs, select
from perception.evidence import evidence_table
from perception.knowledge_base import load_knowledge
from perception.pipeline import skyline_bands
from perception.rock_geometry import formation, outlines, probe_sections
from worlds.types import BoolArray

KNOW = load_knowledge("mars")


def ellipse(angle_deg: float, length: int = 60, width: int = 24, centre: tuple[int, int] = (100, 80)) -> BoolArray:
    """Ellipse with its long axis turned counter-clockwise as seen."""
    picture = np.zeros((160, 200), dtype=np.uint8)
    cv2.ellipse(picture, centre, (length // 2, width // 2), -angle_deg, 0, 360, (1,), -1)
    return picture.astype(bool)


def test_a_rectangle_worked_by_hand() -> None:
    mask = np.zeros((20, 30), dtype=bool)
    mask[4:8, 10:22] = True
    blobs = find_blobs(mask)
    assert len(blobs) == 1
    assert blobs.area_px[0] == 48
    assert blobs.box_px[0].tolist() == [10, 4, 12, 4]
    assert blobs.centre_px[0].tolist() == [16.0, 6.0]
    # A rectangle of sides a, b has variances a^2/12 and b^2/12.
    assert blobs.variance_px2[0] == pytest.approx([12.0, 16 / 12])
    assert blobs.axis_rad[0] == pytest.approx(0.0)
    assert not blobs.border.any()


def test_blobs_come_largest_first_and_small_ones_not_at_all() -> None:
    mask = np.zeros((20, 30), dtype=bool)
    mask[0:2, 0:2] = mask[5:8, 0:3] = mask[10:15, 10:15] = mask[19, 29] = True
    blobs = find_blobs(mask, min_area_px=4)
    assert blobs.area_px.tolist() == [25, 9, 4]
    assert [int(blobs.labels[y, x]) for y, x in ((12, 12), (6, 1), (0, 0), (19, 29))] == [1, 2, 3, 0]
    assert blobs.border.tolist() == [[False] * 4, [True, False, False, False], [True, True, False, False]]
    kept = select(blobs, np.array([False, True, True]))
    assert kept.area_px.tolist() == [9, 4]
    assert sorted(np.unique(kept.labels)) == [0, 1, 2]
    assert kept.labels[6, 1] == 1


def test_an_empty_mask_has_no_blobs() -> None:
    blobs = find_blobs(np.zeros((20, 30), dtype=bool))
    shape = outlines(blobs, 1.25)
    assert len(blobs) == 0
    assert shape.sections_px.shape == (0, 9)


@given(st.integers(0, 179))
def test_the_axis_follows_a_turned_ellipse(angle_deg: int) -> None:
    blobs = find_blobs(ellipse(angle_deg))
    error = (np.rad2deg(blobs.axis_rad[0]) - angle_deg + 90) % 180 - 90
    assert abs(error) < 3.0
    length, sections = probe_sections(blobs)
    assert length[0] == pytest.approx(61, abs=3.0)
    assert sections[0, 4] == pytest.approx(25, abs=3.0)
    # Across an ellipse the chord at 3/4 of the half length is sqrt(1 - 9/16) of the middle one.
    assert sections[0, 1] == pytest.approx(25 * np.sqrt(7 / 16), abs=4.0)
    assert sections[0, [0, 8]].max() < 0.6 * sections[0, 4]


def test_formations_are_sectors_of_twenty_degrees() -> None:
    axis = np.deg2rad([0.0, 19.9, 20.1, 90.0, 179.9])
    assert formation(axis, np.full(5, 2.0), 1.25).tolist() == [1, 1, 2, 5, 9]
    assert formation(axis, np.full(5, 1.2), 1.25).tolist() == [0] * 5


def test_outline_rows_leave_a_spur_out() -> None:
    mask = np.zeros((60, 60), dtype=bool)
    mask[20:30, 10:50] = True
    mask[30:45, 12:14] = True  # two of forty columns hang down
    shape = outlines(find_blobs(mask), 1.25)
    assert (shape.left_px[0], shape.right_px[0]) == (10.0, 50.0)
    assert (shape.top_px[0], shape.base_px[0]) == (20.0, 30.0)


def test_cleaning_fills_holes_and_drops_hair() -> None:
    rock = np.zeros((60, 60), dtype=bool)
    rock[10:40, 10:40] = True
    rock[20:25, 20:25] = False
    rock[50, 5:55] = True
    found = clean(rock, KNOW.binarization)
    assert found[22, 22]
    assert not found[50].any()
    assert found[12:38, 12:38].all()


def test_edges_only_grow_a_rock_that_they_touch() -> None:
    grey = np.full((60, 60), 100, dtype=np.uint8)
    grey[20:40, 20:40] = 200
    rock = np.zeros((60, 60), dtype=bool)
    rock[21:39, 21:39] = True
    score = np.full((60, 60), 0.4, dtype=np.float32)
    grown = close_edges(rock, score, grey, KNOW.binarization)
    assert grown.sum() > rock.sum()
    assert not grown[:18].any()
    assert (close_edges(rock, 0 * score, grey, KNOW.binarization) == rock).all()


def test_a_threshold_map_has_an_optimum_where_two_classes_are_and_no_seams() -> None:
    score = np.full((240, 320), 0.1, dtype=np.float32)
    score[100:120, 100:110] = 0.52
    how = KNOW.binarization
    found = threshold_map(score, how, 20)
    # Otsu between 0.1 and 0.52 parts them right above the lower class; the span stops it at 0.3.
    assert found.min() == pytest.approx(how.threshold_span[0], abs=0.02)
    assert found[10, 10] == pytest.approx(how.threshold)
    assert np.abs(np.diff(found, axis=0)).max() < 0.02
    assert np.abs(np.diff(found, axis=1)).max() < 0.02


def test_an_evidence_table_holds_the_knots() -> None:
    cue = dict(KNOW.cues.named())["lightness"]
    table = evidence_table(cue.value, cue.evidence)
    for value, evidence in zip(cue.value, cue.evidence, strict=True):
        assert table[2 + round((value - table[0]) * table[1])] == pytest.approx(evidence, abs=0.05)


def test_a_strip_under_the_skyline_is_no_rock_but_a_boulder_there_is() -> None:
    hidden = np.zeros((60, 80), dtype=bool)
    hidden[:20] = True
    mask = np.zeros_like(hidden)
    mask[20:23, 5:45] = True  # hangs on the skyline, thin
    mask[20:34, 50:65] = True  # hangs on it, stout
    mask[40:42, 5:45] = True  # thin, but on the ground
    blobs = find_blobs(mask)
    bands = skyline_bands(blobs, hidden)
    assert [tuple(box) for box in blobs.box_px[bands]] == [(5, 20, 40, 3)]
