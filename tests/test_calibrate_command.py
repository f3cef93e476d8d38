from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.calibration import board_points
from rover_sim.camera_file import camera_model, load_camera
from rover_sim.cli import main
from tests.board_pictures import board_views, picture
from tests.test_perception_calibration import BOARD, BROWN, angle_error_rad

PLACES = board_points("checkerboard", BOARD, 0.025)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("boards")
    views = board_views(10, 0.2, 0.125, 0.35)
    paths = [folder / f"{i}.png" for i in range(len(views))]
    for path, view in zip(paths, views, strict=True):
        cv2.imwrite(str(path), picture(BROWN, view, BOARD, 0.025, "checkerboard"))
    return paths


def run(*words: str | Path) -> int:
    return main(["calibrate", *map(str, words), "--board", "9x6", "--square-mm", "25"])


def test_a_camera_file_that_perceive_reads(
    pictures: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blank = tmp_path / "blank.png"
    cv2.imwrite(str(blank), np.full((240, 320), 90, np.uint8))
    out = tmp_path / "new" / "mine.toml"
    assert run(*pictures, blank, "--out", out, "--height-m", "1.1", "--pitch-deg", "20") == 0
    camera = load_camera(out)
    assert (camera.width, camera.height, camera.height_m, camera.pitch_deg) == (320, 240, 1.1, 20.0)
    assert angle_error_rad(BROWN, camera_model(camera, (320, 240), "a")) < np.deg2rad(0.3)
    told = capsys.readouterr().out
    assert "blank.png: no board of 9x6 found" in told
    table = json.loads(out.with_suffix(".json").read_text(encoding="utf-8"))
    assert table["reprojection_px"] == pytest.approx(camera.lens.reprojection_px if camera.lens else None)
    by_name = {row["name"]: row for row in table["pictures"]}
    assert set(by_name) == {path.name for path in [*pictures, blank]}
    assert by_name["blank.png"] == {"name": "blank.png", "board": False, "used": False, "error_px": None}
    used = [row for row in by_name.values() if row["used"]]
    assert len(used) >= 6
    assert all(row["error_px"] < 0.3 for row in used)
    plot = cv2.imread(str(out.with_suffix(".png")))
    assert plot is not None
    assert plot.std() > 10


def test_without_its_place_the_file_says_what_to_fill_in(
    pictures: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "c.toml"
    assert run(*pictures, "--out", out) == 0
    assert "# height_m" in out.read_text(encoding="utf-8")
    assert main(["perceive", str(pictures[0]), "--camera", str(out), "--out", str(tmp_path / "o")]) == 2
    told = capsys.readouterr().err
    assert str(out) in told
    assert "required" in told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--board", "9"], "--board 9: give columns and rows"),
        (["--board", "1x6"], "2 to 100"),
        (["--square-mm", "-3"], "--square-mm -3"),
        (["--pitch-deg", "nan"], "--pitch-deg nan"),
        (["--out", "camera.json"], "FILE.toml"),
    ],
)
def test_wrong_arguments_are_told_before_any_work(
    pictures: list[Path], words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["calibrate", str(pictures[0]), "--board", "9x6", "--square-mm", "25", *words]) == 2
    assert told in capsys.readouterr().err


def test_too_few_boards_and_two_sizes(pictures: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other.png"
    cv2.imwrite(str(other), np.full((120, 160), 90, np.uint8))
    assert run(pictures[0], other, "--out", tmp_path / "c.toml") == 2
    assert f"{other}: is 160 x 120 px" in capsys.readouterr().err
    assert run(other, "--out", tmp_path / "c.toml") == 2
    told = capsys.readouterr().err
    assert "3 or more" in told
    assert "no such board in other.png" in told
    assert run(tmp_path / "missing.png", "--out", tmp_path / "c.toml") == 2
    assert "missing.png" in capsys.readouterr().err
    assert not (tmp_path / "c.toml").exists()
