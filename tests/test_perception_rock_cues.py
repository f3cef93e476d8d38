from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.binarize import evidence_score, looks, rock_score
from perception.blobs import find_blobs
from perception.cues import colour_likeness, cue_planes
from perception.faithful import paper_rocks, paper_rules
from perception.knowledge_base import Cue, CueSet, RockCues, load_knowledge
from perception.learn_rocks import Example, learn_rocks, learned_tables
from perception.soil_reference import SoilReference
from perception.touching_rocks import part_at_necks
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from tests.test_perception_pipeline import BASALT, LIMESTONE, sand, with_rock
from worlds.errors import InputError
from worlds.fuzzy import rule_strengths
from worlds.types import BoolArray

MARS = load_knowledge("mars")
SOIL = SoilReference(np.array([50.0, 4.0, 8.0], dtype=np.float32), 1.0, np.zeros(6, dtype=np.float32), coloured=True)
STEP = Cue(value=(0.0, 10.0), evidence=(0.0, 5.0))
SEEN = np.zeros((4, 6), dtype=bool)


def flat_lab(values: tuple[float, float, float], shape: tuple[int, int] = (4, 6)) -> np.ndarray:
    return np.full((*shape, 3), values, dtype=np.float32)


def test_evidence_adds_up_and_saturates() -> None:
    planes = {"lightness": np.array([[-5.0, 4.0, 99.0]], dtype=np.float32)}
    found = evidence_score(planes, CueSet(bias=-1.0, lightness=STEP))
    assert found[0] == pytest.approx(1 / (1 + np.exp([1.0, -1.0, -4.0])), abs=0.003)


def test_cues_are_taken_against_soil_as_dark_as_the_pixel() -> None:
    lab = flat_lab((25.0, 2.0, 4.0))  # the soil's hue at half its light
    plain = cue_planes(lab, SOIL, ("green_red", "blue_yellow", "lightness"), 0.0, 9)
    shaded = cue_planes(lab, SOIL, ("green_red", "blue_yellow", "lightness"), 1.0, 9)
    assert [float(plain[n][0, 0]) for n in plain] == [-2.0, -4.0, -25.0]
    assert [float(shaded[n][0, 0]) for n in shaded] == [0.0, 0.0, -25.0]


def test_likeness_is_the_mean_score_of_a_colour() -> None:
    lab = flat_lab((50.0, 4.0, 8.0), (40, 60))
    lab[:, 30:, 0] = 90.0
    score = np.full((40, 60), 0.1, dtype=np.float32)
    score[:, 30:50] = 0.9  # two thirds of the bright half pass for rock
    likeness = colour_likeness(lab, score, SOIL, np.zeros((40, 60), dtype=bool))
    assert likeness[:, :30] == pytest.approx(0.1, abs=0.01)
    assert likeness[:, 30:] == pytest.approx((2 * 0.9 + 0.1) / 3, abs=0.01)
    hidden = np.zeros((40, 60), dtype=bool)
    hidden[:, 50:] = True  # what is hidden does not count, but is answered
    assert colour_likeness(lab, score, SOIL, hidden)[:, 30:] == pytest.approx(0.9, abs=0.02)


def test_a_second_look_finds_what_has_the_colour_of_rock() -> None:
    first = RockCues(bias=-2.0, lightness=STEP)
    second = CueSet(bias=-2.0, likeness=Cue(value=(0.0, 1.0), evidence=(0.0, 8.0)))
    know = replace(MARS, cues=first, second_cues=second, grey_cues=None)
    lab = flat_lab((50.0, 4.0, 8.0), (40, 60))
    lab[:, 30:] = (60.0, 12.0, 8.0)
    hidden = np.zeros((40, 60), dtype=bool)
    hidden[0] = True
    score = rock_score(lab, SOIL, hidden, know)
    assert score[1:, 30:].min() > 0.9
    assert score[1:, :30].max() < 0.4
    assert not score[0].any()


def test_pictures_without_colour_have_evidence_of_their_own() -> None:
    grey = CueSet(bias=1.0, lightness=STEP)
    know = replace(MARS, grey_cues=grey)
    assert looks(know, coloured=False) == (grey, None)
    assert looks(know, coloured=True) == (know.cues, know.second_cues)
    left = looks(replace(know, grey_cues=None), coloured=False)[0]
    assert {name for name, _ in left.named()} == {"lightness", "roughness"}


def test_likeness_needs_a_look_before_it(tmp_path: Path) -> None:
    cue = "likeness = { value = [0.0, 1.0], evidence = [0.0, 1.0] }\n"
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(replace_tables(knowledge_text("mars"), {"cues": f"[cues]\nbias = 0.5\n{cue}"}), encoding="utf-8")
    with pytest.raises(InputError, match="cues: likeness needs a look before it"):
        load_knowledge(wrong)
    right = tmp_path / "right.toml"
    tables = {"second_cues": f"[second_cues]\nbias = 0.5\n{cue}"}
    right.write_text(replace_tables(knowledge_text("mars"), tables), encoding="utf-8")
    learned = load_knowledge(right).second_cues
    assert learned is not None
    assert [name for name, _ in learned.named()] == ["likeness"]


def discs(*places: tuple[int, int, int]) -> BoolArray:
    picture = np.zeros((120, 200), dtype=np.uint8)
    for x, y, radius in places:
        cv2.circle(picture, (x, y), radius, (1,), -1)
    return picture.astype(bool)


def test_touching_discs_are_parted_at_their_neck() -> None:
    mask = discs((60, 60, 25), (104, 60, 22))
    assert len(find_blobs(mask, 1, 0.0)) == 1
    parts = find_blobs(mask, 1, 0.6)
    assert len(parts) == 2
    assert parts.area_px.sum() == mask.sum()
    assert parts.centre_px[0] == pytest.approx((60.5, 60.5), abs=3.0)
    assert parts.centre_px[1] == pytest.approx((104.5, 60.5), abs=3.0)


def test_a_wide_neck_and_a_spur_part_nothing() -> None:
    assert len(find_blobs(discs((60, 60, 25), (80, 60, 25)), 1, 0.6)) == 1
    spur = discs((60, 60, 25))
    spur[58:62, 80:100] = True
    assert len(find_blobs(spur, 1, 0.9)) == 1
    assert part_at_necks(np.zeros((10, 10), dtype=bool), 0.5).max() == 0
    assert len(np.unique(part_at_necks(np.ones((50, 50), dtype=bool), 0.5))) == 1


def test_some_rule_of_the_paper_fires_everywhere() -> None:
    rules = paper_rules()
    rng = np.random.default_rng(0)
    inputs = {v.name: rng.uniform(v.low, v.high, 4000) for v in rules.inputs}
    assert set(inputs) == {"contrast", "energy", "variance", "area"}
    assert rule_strengths(rules, inputs).max(axis=1).min() > 0.0


def test_the_papers_own_means_find_a_dark_rough_rock() -> None:
    # Smaller than a window: the inside of a larger rock has no two classes to part.
    picture = with_rock(sand(), (200, 150), (13, 9), BASALT)
    found = paper_rocks(picture, MARS) > 0
    truth = cv2.ellipse(np.zeros((240, 320), np.uint8), (200, 150), (13, 9), 0, 0, 360, (1,), -1) > 0
    assert (found & truth).sum() / truth.sum() > 0.8
    assert not found[:, :120].any()
    assert not (paper_rocks(sand(), MARS) > 0).any()


def test_learning_brings_all_its_tables_and_they_read_back(tmp_path: Path) -> None:
    examples = []
    for seed, colour in enumerate([BASALT, LIMESTONE, BASALT]):
        mask = cv2.ellipse(np.zeros((240, 320), np.uint8), (120 + 40 * seed, 120), (40, 28), 0, 0, 360, (1,), -1) > 0
        examples.append(Example(with_rock(sand(seed), (120 + 40 * seed, 120), (40, 28), colour), mask))
    learned = learn_rocks(examples, MARS)
    path = tmp_path / "own.toml"
    path.write_text(replace_tables(knowledge_text("mars"), learned_tables(learned)), encoding="utf-8")
    assert load_knowledge(path) == learned
