"""Clasts of a few pixels, and the definition of the classes over them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from perception.class_definition import STAGES, window_stages
from perception.clasts import clast_chance, clast_stages, first_planes, redness
from perception.evidence import chance_of
from perception.knowledge_base import load_knowledge
from perception.learn_clasts import ClastExample, clasts_toml, learn_clasts
from perception.pipeline import examine
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from worlds.errors import InputError
from worlds.types import BoolArray, ByteArray

RENDERED = load_knowledge("rendered")
SAND, PEBBLE = np.array([176.0, 144.0, 101.0]), np.array([138.0, 121.0, 97.0])


def scene(seed: int, pebbles: int) -> tuple[ByteArray, BoolArray]:
    """Sand in uneven light with ``pebbles`` squares of 2 to 6 pixels, and where they are; the camera's usual noise."""
    rng = np.random.default_rng(seed)
    clast = np.zeros((240, 320), dtype=bool)
    for _ in range(pebbles):
        size, row, column = rng.integers(2, 7), rng.integers(0, 230), rng.integers(0, 310)
        clast[row : row + size, column : column + size] = True
    light = rng.uniform(0.75, 1.0, clast.shape)
    picture = np.where(clast[..., None], PEBBLE, SAND) * light[..., None] + rng.normal(0.0, 1.5, (240, 320, 3))
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8), clast


def test_shade_does_not_change_redness_but_a_pebble_does() -> None:
    picture, clast = scene(1, 60)
    red = redness(picture, np.zeros(clast.shape, dtype=bool))
    assert abs(float(np.median(red[~clast]))) < 0.01
    assert red[clast].mean() == pytest.approx(np.log(138 / 97) - np.log(176 / 101), abs=0.02)
    assert red[~clast].std() < 0.03  # noise alone, though the light on it varies by a quarter


def test_evidence_learned_on_pictures_finds_pebbles_in_others() -> None:
    examples = [
        ClastExample(examine(picture, RENDERED).windows, clast, np.ones(clast.shape, dtype=bool))
        for picture, clast in (scene(seed, 150) for seed in range(3))
    ]
    know = learn_clasts(examples)
    picture, clast = scene(9, 150)
    windows = examine(picture, RENDERED).windows
    red = redness(picture, windows.hidden)
    chance = clast_chance(red, windows.grey, windows.score, windows.hidden, know)
    found = chance > 0.5
    assert (found & clast).sum() / (found | clast).sum() > 0.9
    hidden = np.ones(clast.shape, dtype=bool)
    assert not clast_chance(red, windows.grey, windows.score, hidden, know).any()


def test_a_look_adds_up_the_evidence_of_its_cues() -> None:
    assert RENDERED.clasts is not None
    cues = RENDERED.clasts.first
    picture, _ = scene(2, 40)
    windows = examine(picture, RENDERED).windows
    planes = first_planes(redness(picture, windows.hidden), windows.grey, windows.score)
    total = np.full(windows.hidden.shape, cues.bias)
    for name, cue in cues.named():
        total += np.interp(planes[name], cue.value, cue.evidence)
    expected = np.where(windows.hidden, 0.0, 1.0 / (1.0 + np.exp(-total)))
    apart = np.abs(chance_of(planes, cues.bias, cues.named(), windows.hidden) - expected)
    assert apart.mean() < 0.002
    assert (apart > 0.05).mean() < 0.001  # the kernel's tables have even steps: knots close together are cut short


def test_stages_follow_the_definition() -> None:
    chance = np.zeros((20, 120), dtype=np.float32)
    chance[3:5, 3:5] = 0.9  # one speck
    chance[5:8, 25:28] = 0.9  # 9 pixels
    chance[5:11, 45:51] = 0.9  # 36 pixels
    for row in range(0, 20, 5):
        chance[row : row + 2, 61:79] = 0.9  # four strips of 36 pixels: 36 %
    chance[:, 85:95] = 0.9  # one of 200 pixels
    chance[3:13, 105:115] = 0.4  # too doubtful
    stages = clast_stages(chance, 0.5)
    assert "".join(STAGES[int(stage)] for stage in stages[0]) == "SVmMBS"
    assert clast_stages(np.zeros((240, 320), dtype=np.float32), 0.5).max() == 0.0


def test_a_clast_counts_by_its_size_in_the_whole_picture() -> None:
    ids = np.zeros((20, 40), dtype=np.int32)
    ids[5, 18:22] = 1  # two pixels in either window
    ids[9:11, 2:4] = 2
    area, extent = np.array([0, 4, 4], dtype=np.int32), np.array([0, 4, 2], dtype=np.int32)
    assert window_stages(ids, area, extent).tolist() == [[1.0, 0.0]]
    area[1] = 3
    assert window_stages(ids, area, extent).tolist() == [[0.0, 0.0]]


def test_the_table_survives_its_text(tmp_path: Path) -> None:
    assert RENDERED.clasts is not None
    path = tmp_path / "own.toml"
    path.write_text(replace_tables(knowledge_text("rendered"), {"clasts": clasts_toml(RENDERED.clasts)}))
    assert load_knowledge(path).clasts == RENDERED.clasts


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[clasts.first]", "[clasts.first]\nchance = { value = [0.0, 1.0], evidence = [0.0, 1.0] }", "stand in second"),
        ("[clasts.first]", "[clasts.first]\nredd = 1", "redd"),
        ("[clasts.second]", "[clasts.second]\nred = { value = [1.0, 0.0], evidence = [0.0, 1.0] }", "red"),
    ],
)
def test_wrong_tables_are_named(tmp_path: Path, old: str, new: str, told: str) -> None:
    text = knowledge_text("rendered")
    path = tmp_path / "own.toml"
    if "red = " in new:
        text = "\n".join(line for line in text.splitlines() if not line.startswith("red = "))
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=told):
        load_knowledge(path)


def test_rules_that_ask_for_stones_need_the_table(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(replace_tables(knowledge_text("rendered"), {"clasts": ""}))
    with pytest.raises(InputError, match="needs the table clasts"):
        load_knowledge(path)
