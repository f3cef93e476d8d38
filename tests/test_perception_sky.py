from __future__ import annotations

from itertools import product

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.knowledge_base import SKY_CUES, load_knowledge
from perception.learn_sky import WindowCounts, compare_windows, learn_sky, sky_samples, window_truth
from perception.pipeline import examine, smoothed
from perception.sky import cell_evidence, over_line, sky_cues, sky_mask, skyline
from tests.data import data_path
from worlds.types import BoolArray, ByteArray, FloatArray


def scene(ridge_row: int, seed: int = 0) -> ByteArray:
    """Bright smooth sky over rough brown ground."""
    rng = np.random.default_rng(seed)
    picture = np.clip(np.array([120, 85, 55]) + rng.normal(0, 18, (240, 320, 1)), 0, 255)
    picture[:ridge_row] = (205, 195, 165)
    return picture.astype(np.uint8)


def score(evidence: FloatArray, line: tuple[int, ...], step: float, least: float) -> float:
    gain = sum(evidence[:y, x].sum() - (least if y else 0.0) for x, y in enumerate(line))
    return float(gain - step * np.abs(np.diff(line)).sum())


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 3.0), st.floats(0.0, 4.0))
def test_no_line_is_better_than_the_skyline(seed: int, step: float, least: float) -> None:
    evidence = np.random.default_rng(seed).normal(0.0, 2.0, (4, 4))
    best = max(score(evidence, line, step, least) for line in product(range(5), repeat=4))
    found = tuple(int(y) for y in skyline(evidence, step, least))
    assert score(evidence, found, step, least) == pytest.approx(best)


def test_the_line_is_drawn_between_the_middles_of_its_cells() -> None:
    mask = over_line(np.array([2, 2, 4, 4], dtype=np.int32), (20, 16))
    assert mask.sum(axis=0).tolist() == [8] * 6 + [9, 11, 13, 15] + [16] * 6


def test_sky_is_found_down_to_the_ground_and_rocks_are_not_sky() -> None:
    know = load_knowledge("mars")
    found = examine(scene(80), know)
    assert (found.classes[:4] == "U").all()
    assert not (found.classes[5:] == "U").any()
    downward = scene(0)
    cv2.ellipse(downward, (60, 30), (50, 30), 0, 0, 360, (90, 92, 95), -1)  # a smooth grey rock at the top
    assert not examine(downward, know).hidden.any()


def test_missing_data_over_the_sky_does_not_hide_it() -> None:
    picture = scene(80)
    picture[:24, :200] = 0
    found = examine(picture, load_knowledge("mars"))
    assert (found.classes[:4] == "U").all()


@pytest.mark.parametrize("fill", [0, 1, 127, 255])
def test_pictures_of_one_value_have_no_cues_that_are_not_finite(fill: int) -> None:
    picture = np.full((240, 320, 3), fill, np.uint8)
    lab, _ = smoothed(picture, 1.0)
    hidden = np.full((240, 320), fill == 0)
    cues, missing = sky_cues(lab, hidden)
    assert all(np.isfinite(values).all() for values in cues.values())
    assert missing.all() == (fill == 0)
    assert sky_mask(lab, hidden, load_knowledge("mars").sky).shape == (240, 320)


def test_evidence_adds_up_as_the_file_says() -> None:
    lab, _ = smoothed(scene(80), 1.0)
    cues, missing = sky_cues(lab, np.zeros((240, 320), bool))
    table = load_knowledge("mars").sky.colour
    found = cell_evidence(cues, missing, table)
    by_hand = table.bias + sum(np.interp(cues[n][50, 40], c.value, c.evidence) for n, c in table.named())
    assert found[50, 40] == pytest.approx(np.clip(by_hand, -8.0, 8.0))


def test_a_window_is_what_most_of_it_is() -> None:
    sky, known = np.zeros((240, 320), bool), np.ones((240, 320), bool)
    sky[:10] = True  # half of the top windows: a draw goes to sky
    known[:11, :20] = False  # most of the first window is unknown
    truth, counted = window_truth(sky, known)
    assert truth[0].tolist() == [False, *[True] * 15]
    assert not truth[1:].any()
    assert counted.sum() == 191
    assert not counted[0, 0]
    found = np.zeros((12, 16), bool)
    found[0, :5] = True
    found[3, :2] = True
    counts = compare_windows(found, sky, known)
    assert counts == WindowCounts(sky=15, missed=11, other=176, wrong=2)
    assert (counts + counts).recall == pytest.approx(4 / 15)


def test_learning_repeats_and_finds_what_it_was_taught() -> None:
    def truth(row: int) -> BoolArray:
        return np.repeat(np.arange(240)[:, None] < row, 320, axis=1)

    known = np.ones((240, 320), bool)
    rows = (40, 60, 90, 0)
    samples = [sky_samples(scene(row, i), truth(row), known, coloured=True) for i, row in enumerate(rows)]
    first, second = (learn_sky(samples, SKY_CUES, 10.0) for _ in range(2))
    assert first == second
    lab, _ = smoothed(scene(75, 9), 1.0)
    sky = load_knowledge("mars").sky
    found = sky_mask(lab, np.zeros((240, 320), bool), type(sky)(colour=first, grey=first))
    assert (found ^ truth(75)).mean() < 0.02


def test_real_sky_and_ridge_become_u() -> None:
    folder = data_path("mars", "terrain_all")
    total = WindowCounts()
    for name in ("ms_137_1", "ms_344_2", "ms_388_1", "ms_404_2", "ms_147_1"):
        picture = cv2.imread(str(folder / f"{name}.jpg"))
        label = cv2.imread(str(folder / f"{name}_sem.png"), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        assert label is not None
        classes = examine(np.asarray(picture[..., ::-1], dtype=np.uint8), load_knowledge("mars")).classes
        total += compare_windows(np.asarray(classes == "U"), np.isin(label, (6, 7)), ~np.isin(label, (5, 255)))
    # The shipped evidence has seen these pictures: a check of wiring, not of skill.
    assert total.recall > 0.9
    assert total.wrong_share < 0.03
