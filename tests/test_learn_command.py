from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.knowledge_base import load_knowledge
from rover_sim.cli import main
from rover_sim.learning.knowledge_text import knowledge_text, replace_tables
from tests.test_perception_command import written
from tests.test_perception_pipeline import BASALT, LIMESTONE, sand, with_rock


def labelled_folder(folder: Path) -> Path:
    """Four pictures of three scenes, a dark or a bright rock in each, with its mask."""
    for seed, (sol, colour) in enumerate([(10, BASALT), (11, LIMESTONE), (50, LIMESTONE), (90, BASALT)]):
        centre = (80 + 40 * seed, 120 + 10 * seed)
        written(folder / f"md_{sol}_{seed}.png", with_rock(sand(seed), centre, (34, 24), colour))
        mask = np.zeros((240, 320), dtype=np.uint8)
        cv2.ellipse(mask, centre, (34, 24), 0, 0, 360, (255,), -1)
        written(folder / f"md_{sol}_{seed}_mask.png", mask)
    return folder


def run(command: str, folder: Path, *words: str | Path) -> int:
    return main([command, "--images", str(folder), "--labels", str(folder), "--workers", "1", *map(str, words)])


def test_score_of_plain_rocks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("score", labelled_folder(tmp_path), "--out", tmp_path / "out") == 0
    report = json.loads((tmp_path / "out" / "score.json").read_text())
    assert len(report["pictures"]) == 4
    assert report["methods"]["colour"]["iou"] > 0.85
    assert report["methods"]["colour"]["object_f1"] == 1.0
    assert (tmp_path / "out" / "score.png").is_file()
    assert "IoU" in capsys.readouterr().out


def test_learning_leaves_knowledge_and_report_and_repeats_to_the_byte(tmp_path: Path) -> None:
    folder = labelled_folder(tmp_path)
    for name in ("a", "b"):
        assert run("learn", folder, "--out", tmp_path / name / "own.toml") == 0
    first, second = ((tmp_path / name / "own.toml").read_bytes() for name in ("a", "b"))
    assert first == second
    learned, base = load_knowledge(tmp_path / "a" / "own.toml"), load_knowledge("mars")
    assert learned.cues != base.cues
    assert learned.terrain_rules == base.terrain_rules
    report = json.loads((tmp_path / "a" / "own.json").read_text())
    assert (report["scenes"], report["cross_validated"]) == (3, True)
    assert report["methods"]["colour"]["iou"] > 0.8
    assert (tmp_path / "a" / "own.png").is_file()
    assert run("score", folder, "--knowledge", tmp_path / "a" / "own.toml", "--out", tmp_path / "out") == 0


def test_wrong_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = labelled_folder(tmp_path)
    assert run("learn", folder, "--out", tmp_path / "own.txt") == 2
    assert "FILE.toml" in capsys.readouterr().err
    assert run("score", tmp_path / "no") == 2
    assert "no such folder" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main(["score", "--images", str(folder), "--labels", str(tmp_path / "empty")]) == 2
    assert "md_10_0.png would have" in capsys.readouterr().err
    written(folder / "md_10_0_mask.png", np.zeros((5, 5), dtype=np.uint8))
    assert run("score", folder, "--out", tmp_path / "out") == 2
    assert "as large as its picture" in capsys.readouterr().err


def test_pictures_of_one_scene_teach_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = labelled_folder(tmp_path)
    for path in [*folder.glob("md_50*"), *folder.glob("md_90*")]:
        path.unlink()
    assert run("learn", folder, "--out", tmp_path / "own.toml") == 2
    assert "one scene" in capsys.readouterr().err


def test_tables_are_replaced_and_the_rest_stays() -> None:
    text = "# top\na = 1\n\n[one]\nb = 2\n\n# about two\n[two]\nc = 3\n[two.deep]\nd = 4\n[three]\ne = 5\n"
    assert replace_tables(text, {"two": "[two]\nf = 6\n"}) == (
        "# top\na = 1\n\n[one]\nb = 2\n\n[two]\nf = 6\n\n[three]\ne = 5\n"
    )
    assert replace_tables(text, {"four": "[four]\ng = 7"}).endswith("e = 5\n\n[four]\ng = 7\n")
    assert replace_tables(knowledge_text("mars"), {}) == knowledge_text("mars")
