"""Cuts between the rocks of one blob: measures by hand, and pictures of two rocks that touch."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.blobs import Blobs, measured_blobs
from perception.knowledge_base import PARTING_CUES, Cue, Parting, load_knowledge
from perception.pipeline import examine, perceive
from perception.rock_parting import DIRECTIONS, all_cuts, cut, part_rocks, side_of
from rover_sim.learning.knowledge_text import knowledge_text
from rover_sim.learning.rendered_views import make_world, rendered_views
from worlds.errors import InputError
from worlds.types import FloatArray, IntArray

UPRIGHT, LEVEL = 0, DIRECTIONS // 2  # directions of the normal: to the right, and down


def squares(*places: tuple[int, int, int, int]) -> IntArray:
    """One blob of rectangles x, y, width, height."""
    labels = np.zeros((40, 60), dtype=np.int32)
    for x, y, width, height in places:
        labels[y : y + height, x : x + width] = 1
    return labels


def evenly(labels: IntArray, light: float = 40.0, blue: float = 10.0) -> FloatArray:
    return np.tile(np.array([light, 2.0, blue]), (*labels.shape, 1))


def cuts_of(
    labels: IntArray, lab: FloatArray, score: FloatArray | None = None
) -> dict[tuple[int, int], dict[str, float]]:
    """Measures by direction and line."""
    blobs = measured_blobs(labels, 1)
    plane = np.ones(labels.shape) if score is None else score
    measures, lines = all_cuts(blobs.labels, lab.astype(np.float32), plane.astype(np.float32), 1, blobs.box_px[0], 10)
    return {
        (int(direction), int(line)): dict(zip(PARTING_CUES, row.tolist(), strict=True))
        for (direction, line), row in zip(lines, measures, strict=True)
    }


def test_measures_of_the_line_between_two_squares() -> None:
    """Two squares of 6 x 6 joined by a bridge of 2 x 2: the cut through the middle of the bridge."""
    labels = squares((10, 10, 6, 6), (18, 10, 6, 6), (16, 12, 2, 2))
    lab = evenly(labels)
    lab[:, 17:, 0] = 60.0  # the right half is brighter, of the same hue
    lab[:, 17:, 2] = 15.0
    found = cuts_of(labels, lab)[UPRIGHT, 7]
    assert found["area"] == pytest.approx(np.log10(76))
    assert found["smaller"] == pytest.approx(np.log10(38))
    assert found["chord"] == pytest.approx(2 / np.sqrt(38))
    assert found["level"] == found["above"] == found["lit_above"] == 0.0
    assert found["hue_beside"] == pytest.approx(0.0, abs=1e-6)
    assert found["light_step"] == pytest.approx(20.0 / np.sqrt(100.5))
    assert found["score_dip"] == found["score_drop"] == 0.0
    # The bridge lies 2 pixels under the upper sides of the squares and 2 over the lower ones.
    assert found["bend"] == found["lesser_bend"] == 2.0
    # A square fills the ellipse with its moments by 3 / pi; the halves are nearly squares.
    fill = 76 / (4 * np.pi * np.sqrt(18.018 * 2.860))
    assert found["whole_fill"] == pytest.approx(fill, abs=1e-4)
    assert found["least_fill"] == pytest.approx(3 / np.pi, abs=0.05)
    assert found["ellipse_lack"] == pytest.approx((1 - fill) * 2, abs=1e-3)
    assert found["ellipse_gain"] == pytest.approx((found["least_fill"] - fill) * 2, abs=1e-3)


def test_soil_and_light_along_a_cut_show() -> None:
    labels = squares((10, 10, 16, 5), (12, 15, 5, 9))
    score, lab = np.ones(labels.shape), evenly(labels)
    score[15], lab[15, :, 0] = 0.4, 20.0
    found = cuts_of(labels, lab, score)[LEVEL, 5]
    lower = (40 * 40 + 20 * 5) / 45  # the smaller part: a darker row of 5 in 45
    assert found["level"] == pytest.approx(1.0)
    assert found["above"] == pytest.approx(-1.0)
    assert found["lit_above"] == pytest.approx(40.0 - lower, abs=1e-4)
    assert found["hue_beside"] == pytest.approx(10 / lower - 10 / 40, abs=1e-6)
    assert found["score_dip"] == pytest.approx(0.4 - (125 - 5 * 0.6) / 125, abs=1e-6)
    assert found["score_drop"] == pytest.approx(0.4 - (45 - 5 * 0.6) / 45, abs=1e-6)


def test_a_bump_on_a_rock_bends_the_outline_at_both_ends_of_its_cut_and_a_corner_at_one() -> None:
    bump, corner = squares((10, 16, 30, 14), (20, 10, 7, 6)), squares((10, 16, 30, 14), (10, 10, 7, 6))
    found = cuts_of(bump, evenly(bump))[LEVEL, 6]
    assert (found["bend"], found["lesser_bend"]) == pytest.approx(
        (6.5, 5.0)
    )  # half of the 13 and 10 that the rock is broader
    found = cuts_of(corner, evenly(corner))[LEVEL, 6]
    assert (found["bend"], found["lesser_bend"]) == pytest.approx((11.5, 0.0))


def test_a_convex_blob_has_no_cuts_and_small_ones_neither() -> None:
    y, x = np.mgrid[:40, :60]
    disc = ((x - 30) ** 2 + (y - 20) ** 2 <= 81).astype(np.int32)
    assert not cuts_of(disc, evenly(disc))
    ell = squares((10, 10, 9, 1), (10, 10, 1, 9))
    assert not cuts_of(ell, evenly(ell))


@pytest.mark.parametrize("line", [(0, 7), (2, 9), (4, 4), (7, 12)])
def test_the_cut_is_where_its_side_says(line: tuple[int, int]) -> None:
    labels = squares((10, 10, 6, 6), (16, 12, 8, 6))
    blobs = measured_blobs(labels, 1)
    y, x = np.nonzero(blobs.labels)
    far = side_of(x - 10, y - 10, np.array(line, dtype=np.int32), blobs.box_px[0])
    cut(blobs.labels, 1, blobs.box_px[0], np.array(line, dtype=np.int32), 2)
    assert np.array_equal(blobs.labels[y, x] == 2, far)


def rule(**cues: Cue) -> Parting:
    """A blob is cut if the odds of all its lines reach 1: two hundred lines of no evidence have 0.2."""
    return Parting(bias=-7.0, threshold=0.0, least_px=10, **cues)


def parted(labels: IntArray, lab: FloatArray, know: Parting, least_px: int = 1) -> Blobs:
    plane = np.ones(labels.shape, dtype=np.float32)
    return part_rocks(measured_blobs(labels, 1), lab.astype(np.float32), plane, know, least_px)


def test_evidence_of_a_short_line_parts_three_rocks_in_a_row() -> None:
    labels = squares((2, 10, 8, 8), (12, 10, 8, 8), (22, 10, 8, 8), (10, 13, 12, 2))
    short = Cue(value=(0.26, 0.4), evidence=(12.0, -12.0))
    found = parted(labels, evenly(labels), rule(chord=short))
    assert len(found) == 3
    assert int(found.area_px.sum()) == int(labels.sum())
    assert len(parted(labels, evenly(labels), rule(chord=Cue(value=(0.26, 0.4), evidence=(4.0, -12.0))))) == 1
    assert len(parted(labels, evenly(labels), rule())) == 1


def test_evidence_of_hue_finds_the_border_of_two_rocks() -> None:
    labels = squares((10, 10, 14, 7), (20, 17, 12, 9))
    lab = evenly(labels)
    lab[17:, :, 2] = -4.0
    found = parted(labels, lab, rule(hue_beside=Cue(value=(0.0, 0.4), evidence=(-12.0, 14.0))))
    assert len(found) == 2
    assert sorted(found.area_px.tolist()) == [14 * 7, 12 * 9]


def test_a_line_that_cuts_a_crooked_blob_twice_leaves_three_parts() -> None:
    """A U lying on its back: the level cut through both arms leaves its floor and two arms."""
    labels = squares((10, 10, 6, 12), (26, 10, 6, 12), (10, 22, 22, 6))
    lab = evenly(labels)
    lab[:22, :, 2] = -4.0
    found = parted(labels, lab, rule(hue_beside=Cue(value=(0.0, 0.4), evidence=(-12.0, 14.0))))
    assert sorted(found.area_px.tolist()) == [72, 72, 132]
    for number in range(3):
        assert cv2.connectedComponents((found.labels == number + 1).astype(np.uint8))[0] == 2


def test_every_blob_of_a_rendered_picture_is_one_piece_and_perceived_alike_twice() -> None:
    view = next(rendered_views(make_world(302, 0.0), 1))
    know = load_knowledge("rendered")
    first, second = (perceive(view.frame, know) for _ in range(2))
    assert first.rocks == second.rocks
    for rock in first.rocks:
        assert cv2.connectedComponents((first.labels == rock.id).astype(np.uint8))[0] == 2


def test_parts_that_are_too_small_are_dropped() -> None:
    labels = squares((10, 10, 12, 12), (22, 14, 6, 2))
    short = Cue(value=(0.6, 0.8), evidence=(12.0, -12.0))
    assert len(parted(labels, evenly(labels), rule(chord=short))) == 2
    assert parted(labels, evenly(labels), rule(chord=short), least_px=13).area_px.tolist() == [144]


def test_the_shipped_evidence_parts_a_bright_rock_before_a_dark_one() -> None:
    picture = np.full((240, 320, 3), (176, 144, 101), dtype=np.uint8)
    picture += np.random.default_rng(3).integers(0, 4, picture.shape, dtype=np.uint8)
    picture[120:130, 150:170] = (60, 58, 52)
    picture[128:137, 164:178] = (190, 178, 150)
    know = load_knowledge("rendered")
    assert know.parting is not None
    assert len(examine(picture, know).rocks) == 2


def test_a_mistyped_cue_and_falling_knots_are_named(tmp_path: Path) -> None:
    text = knowledge_text("rendered")
    for old, new, told in (
        ("\nchord = ", "\nchords = ", "chords"),
        ("least_px = 10", "least_px = 0", "parting.least_px"),
    ):
        path = tmp_path / "own.toml"
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        with pytest.raises(InputError, match=told):
            load_knowledge(path)
