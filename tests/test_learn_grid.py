"""``score`` and ``learn`` with class letters as labels."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from perception.knowledge_base import load_knowledge
from rover_sim.cli import main
from rover_sim.learning.grid import read_letters
from tests.data import data_path
from tests.test_perception_command import written
from tests.test_perception_pipeline import BASALT, sand, with_rock


def labelled_folder(folder: Path) -> Path:
    """Three pictures of three scenes: plain sand, B on a large rock."""
    for seed, sol in enumerate((10, 50, 90)):
        column = 60 + 80 * seed
        written(folder / f"md_{sol}_a.png", with_rock(sand(seed), (column, 120), (50, 45), BASALT))
        x, y = np.meshgrid((np.arange(16) + 0.5) * 20, (np.arange(12) + 0.5) * 20)
        big = np.hypot((x - column) / 50, (y - 120) / 45) < 0.9
        with (folder / f"md_{sol}_a.csv").open("w", newline="") as file:
            csv.writer(file).writerows(np.where(big, "B", "S").tolist())
    return folder


def run(command: str, folder: Path, *words: str | Path) -> int:
    fixed = ["--images", str(folder), "--labels", str(folder), "--kind", "grid", "--workers", "1"]
    return main([command, *fixed, *map(str, words)])


def test_learning_leaves_rules_and_report_and_repeats_to_the_byte(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = labelled_folder(tmp_path)
    for name in ("a", "b"):
        assert run("learn", folder, "--out", tmp_path / name / "own.toml") == 0
    first, second = ((tmp_path / name / "own.toml").read_bytes() for name in ("a", "b"))
    assert first == second
    learned, base = load_knowledge(tmp_path / "a" / "own.toml"), load_knowledge("mars")
    assert learned.terrain_rules != base.terrain_rules
    assert learned.paper_rules != base.paper_rules
    assert (learned.cues, learned.rock_rules) == (base.cues, base.rock_rules)
    report = json.loads((tmp_path / "a" / "own.json").read_text())
    assert (report["scenes"], report["cross_validated"], report["rock_evidence_of_other_scenes"]) == (3, True, False)
    assert set(report["methods"]) == {"best", "faithful"}
    assert report["methods"]["best"]["ttam_without_u"] > 90.0
    assert np.sum(report["methods"]["best"]["confusion"]) == 3 * 192
    assert (tmp_path / "a" / "own.png").is_file()
    assert "TTAM" in capsys.readouterr().out
    assert run("score", folder, "--knowledge", tmp_path / "a" / "own.toml", "--out", tmp_path / "out") == 0
    scored = json.loads((tmp_path / "out" / "score.json").read_text())
    assert scored["methods"]["best"]["ttam"] > 90.0


def test_wrong_labels_are_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = labelled_folder(tmp_path)
    text = (folder / "md_10_a.csv").read_text()
    (folder / "md_10_a.csv").write_text(text.replace("S", "Q", 1))
    assert run("score", folder, "--out", tmp_path / "out") == 2
    assert "'Q'; allowed are S, V, m, M, B, U" in capsys.readouterr().err
    (folder / "md_10_a.csv").write_text("S,S\n")
    assert run("score", folder, "--out", tmp_path / "out") == 2
    assert "1 rows; 12 rows of 16 letters" in capsys.readouterr().err
    words = ["--images", str(folder), "--labels", str(folder), "--out", str(tmp_path / "x.toml")]
    assert main(["learn", *words, "--outlines", str(folder)]) == 2
    assert "only --kind grid" in capsys.readouterr().err


def test_real_labels_are_read() -> None:
    letters = np.concatenate([read_letters(path).ravel() for path in sorted(data_path("mars", "grid6").glob("*.csv"))])
    found, counts = np.unique(letters, return_counts=True)
    assert dict(zip(found.tolist(), counts.tolist(), strict=True)) == {
        "S": 401,
        "V": 562,
        "m": 261,
        "M": 91,
        "B": 116,
        "U": 105,
    }


@pytest.mark.slow
def test_real_pictures_left_out(tmp_path: Path) -> None:
    folders = [str(data_path("mars", name)) for name in ("rocks", "terrain", "nav")]
    words = ["--labels", str(data_path("mars", "grid6")), "--out", str(tmp_path / "own.toml"), "--workers", "1"]
    assert main(["learn", "--kind", "grid", "--images", *folders, *words]) == 0
    report = json.loads((tmp_path / "own.json").read_text())
    assert report["scenes"] == 8
    assert report["methods"]["best"]["ttam_without_u"] >= 68.0
    assert report["methods"]["best"]["recall"]["M"] >= 0.3
    assert report["methods"]["faithful"]["ttam_without_u"] >= 40.0
