"""Features of the windows of a picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perception.blobs import find_blobs
from perception.clasts import clast_chance, redness
from perception.knowledge_base import TERRAIN_INPUTS, load_knowledge
from perception.pipeline import examine
from perception.soil_reference import SoilReference
from perception.window_features import FEATURES, WindowSource, window_features, window_mean, window_reduce
from tests.data import data_path
from worlds.types import BoolArray, ByteArray

RENDERED = load_knowledge("rendered")
SOIL = SoilReference(np.array([60.0, 10.0, 20.0], dtype=np.float32), 1.0, np.zeros(6, dtype=np.float32), coloured=True)


def source(picture: ByteArray, rock: BoolArray | None = None, hidden: BoolArray | None = None) -> WindowSource:
    """A picture, grey or RGB, with rocks of known outline."""
    grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    none = np.zeros(grey.shape, dtype=bool)
    blobs = find_blobs(none if rock is None else rock)
    lab = np.broadcast_to(SOIL.lab, (*grey.shape, 3)).copy()
    score = (blobs.labels > 0).astype(np.float32)
    seen = none if hidden is None else hidden
    assert RENDERED.clasts is not None
    chance = clast_chance(redness(picture, seen), grey, score, seen, RENDERED.clasts)
    return WindowSource(picture, grey, lab, SOIL, score, blobs.labels, blobs.area_px, seen, chance)


def test_every_input_that_rules_may_name_is_measured() -> None:
    assert set(FEATURES) == {*TERRAIN_INPUTS, "blank"}
    grey = np.random.default_rng(1).integers(0, 256, (60, 80), dtype=np.uint8)
    found = window_features(source(grey), TERRAIN_INPUTS)
    assert all(values.shape == (3, 4) and np.isfinite(values).all() for values in found.values())


def test_pebbles_are_fine_and_ripples_are_coarse() -> None:
    _, x = np.mgrid[0:240, 0:320]
    ripples = (128 + 30 * np.sin(2 * np.pi * x / 24)).astype(np.uint8)
    pebbles = np.full((240, 320), 128, dtype=np.uint8)
    pebbles[::10, ::10] = 220
    wave, dots = (window_features(source(grey), ("fine", "coarse")) for grey in (ripples, pebbles))
    assert wave["coarse"].mean() > 0.7 + dots["coarse"].mean()  # five times, in decimal logarithms
    assert dots["fine"].mean() > 0.7 + wave["fine"].mean()


def test_rock_measures_worked_by_hand() -> None:
    rock = np.zeros((40, 40), dtype=bool)
    rock[4:8, 2:12] = True  # 40 pixels in the first window
    rock[14:26, 14:19] = True  # 30 in the first, 30 in the one below
    grey = np.random.default_rng(2).integers(0, 256, rock.shape, dtype=np.uint8)
    names = ("cover", "largest", "rest", "rock_size", "area", "score", "around_largest")
    found = window_features(source(grey, rock), names)
    assert found["cover"].tolist() == [pytest.approx([70 / 400, 0]), pytest.approx([30 / 400, 0])]
    assert found["largest"][0, 0] == pytest.approx(0.1)
    assert found["rest"][0, 0] == pytest.approx(30 / 400)
    assert found["rock_size"][1, 0] == pytest.approx(np.log10(61))  # the whole rock, not its part
    assert found["area"][1, 0] == pytest.approx(np.log10(31))
    np.testing.assert_allclose(found["score"], found["cover"], atol=1e-6)
    # The border repeats: the first window counts four times, each neighbour along an edge twice.
    assert found["around_largest"][0, 0] == pytest.approx((4 * 0.1 + 2 * 30 / 400) / 9)


def test_the_skyline_is_told_from_each_window() -> None:
    picture = np.empty((160, 40, 3), dtype=np.uint8)
    picture[:] = (176, 144, 101)
    picture[:25, :20] = picture[:50, 20:] = (212, 186, 148)  # sky is far less red
    found = window_features(source(picture), ("skyline",))["skyline"][:4]
    assert found == pytest.approx(np.array([[25, 40], [5, 30], [-15, 10], [-35, -10]]), abs=1.0)


def test_a_window_without_any_variation_is_blank() -> None:
    grey = np.full((40, 40), 90, dtype=np.uint8)
    grey[:20, :20] += np.random.default_rng(0).integers(0, 3, (20, 20), dtype=np.uint8)
    assert window_features(source(grey), ())["blank"].tolist() == [[0.0, 1.0], [1.0, 1.0]]


def test_window_mean_counts_pixels_and_part_windows_are_left_out() -> None:
    mask = np.zeros((47, 60), dtype=np.uint8)
    mask[0:10, 0:20] = mask[20:40, 40:60] = 1
    assert window_mean(mask).tolist() == pytest.approx(np.array([[0.5, 0, 0], [0, 0, 1]]))
    values = np.arange(5 * 7, dtype=np.uint8).reshape(5, 7)
    assert window_reduce(np.maximum, values, 2).tolist() == [[8, 10, 12], [22, 24, 26]]


def test_a_black_picture_is_uncertain_everywhere() -> None:
    for name in ("mars", "rendered"):
        found = examine(np.zeros((240, 320, 3), dtype=np.uint8), load_knowledge(name))
        assert set(found.classes.ravel()) == {"U"}


def test_a_real_slope_of_boulders_is_no_sand() -> None:
    picture = cv2.imread(str(data_path("mars", "rocks", "md_1044_1044MR0045730190204467E01.png")))
    assert picture is not None
    letters = examine(np.asarray(picture[..., ::-1], dtype=np.uint8), load_knowledge("mars")).classes
    assert np.isin(letters, ["m", "M", "B"]).mean() > 0.4
    assert (letters == "S").mean() < 0.1
