from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from rover_sim.cli import main
from rover_sim.commands.perceive import pictures_of
from tests.test_perception_pipeline import BASALT, sand, with_rock
from worlds.types import ByteArray

CAMERA_TOML = "width = 320\nheight = 240\nfov_deg = 75.2\npitch_deg = 25.0\nheight_m = 1.1\n"
ENDINGS = (".json", "_rocks.png", "_overlay.png", "_terrain.glb", "_scenario.toml")


def scene() -> ByteArray:
    return with_rock(sand(), (200, 150), (24, 14), BASALT)


def written(path: Path, picture: ByteArray) -> Path:
    bgr = picture if picture.ndim == 2 else picture[..., ::-1]
    path.write_bytes(cv2.imencode(path.suffix, bgr)[1].tobytes())
    return path


def run(*words: str | Path) -> int:
    return main(["perceive", *map(str, words)])


def test_all_files_of_the_contract(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = written(tmp_path / "a.png", scene())
    camera = tmp_path / "camera.toml"
    camera.write_text(CAMERA_TOML, encoding="utf-8")
    assert run(picture, "--camera", camera, "--out", tmp_path / "out") == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(f"a{ending}" for ending in ENDINGS)
    table = json.loads((tmp_path / "out" / "a.json").read_text(encoding="utf-8"))
    assert [len(row) for row in table["classes"]] == [16] * 12
    assert set("".join(table["classes"])) <= set("SVmMBU")
    (rock,) = table["rocks"]
    wanted = {"id", "centroid_px", "bbox_px", "area_px", "certainty", "formation", "axis_deg", "sections_px"}
    assert wanted | {"position_m", "height_m"} == set(rock)
    assert rock["position_m"][0] == pytest.approx(1.6, abs=0.15)
    paths = table["waypoints"]
    assert paths
    assert set(paths[0]) == {"traversability", "points_px", "points_m"}
    assert [p["traversability"] for p in paths] == sorted((p["traversability"] for p in paths), reverse=True)
    # The best path starts at the lower edge of the picture and does not cross the rock.
    assert paths[0]["points_px"][0][1] > 225
    mask = cv2.imread(str(tmp_path / "out" / "a_rocks.png"), cv2.IMREAD_UNCHANGED)
    assert mask is not None
    assert mask.shape == (240, 320)
    assert set(np.unique(mask)) == {0, 255}
    model = trimesh.load_scene(tmp_path / "out" / "a_terrain.glb")
    assert set(model.geometry) == {"ground", "classes", "rocks", "paths"}
    assert capsys.readouterr().out.startswith("a.png: 1 rocks")


def test_without_a_camera_nothing_is_in_metres(tmp_path: Path) -> None:
    assert run(written(tmp_path / "a.png", scene()), "--out", tmp_path / "out") == 0
    text = (tmp_path / "out" / "a.json").read_text(encoding="utf-8")
    assert '"camera_assumed": true' in text
    for key in ("position_m", 'height_m": 0', "points_m"):
        assert key not in json.dumps(json.loads(text)["rocks"]) + json.dumps(json.loads(text)["waypoints"])


def test_results_are_in_the_pixels_of_the_input(tmp_path: Path) -> None:
    small = scene()
    large = np.asarray(cv2.resize(small, (640, 960), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    assert run(written(tmp_path / "s.png", small), written(tmp_path / "l.png", large), "--out", tmp_path / "o") == 0
    one, two = (json.loads((tmp_path / "o" / f"{n}.json").read_text(encoding="utf-8"))["rocks"][0] for n in "sl")
    assert two["centroid_px"] == pytest.approx([2 * one["centroid_px"][0], 4 * one["centroid_px"][1]], abs=6)
    assert two["area_px"] == pytest.approx(8 * one["area_px"], rel=0.1)
    mask = cv2.imread(str(tmp_path / "o" / "l_rocks.png"), cv2.IMREAD_UNCHANGED)
    assert mask is not None
    assert mask.shape == (960, 640)


@pytest.mark.parametrize(
    "make",
    [
        lambda p: cv2.cvtColor(p, cv2.COLOR_RGB2GRAY),
        lambda p: p[..., ::-1].astype(np.uint16) << 8,
        lambda p: cv2.cvtColor(p, cv2.COLOR_RGB2GRAY).astype(np.uint16) << 4,  # 12 bits in a 16-bit file
        lambda p: np.dstack([p[..., ::-1], np.full(p.shape[:2], 255, np.uint8)]),
        lambda p: np.dstack([p[..., ::-1].astype(np.uint16) << 8, np.full(p.shape[:2], 65535, np.uint16)]),
    ],
)
def test_every_kind_of_pixel_finds_the_rock(tmp_path: Path, make: Callable[[ByteArray], ByteArray]) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(cv2.imencode(".png", make(scene()))[1].tobytes())
    assert run(path, "--out", tmp_path / "out") == 0
    table = json.loads((tmp_path / "out" / "a.json").read_text(encoding="utf-8"))
    assert table["rocks"][0]["centroid_px"] == pytest.approx([200.5, 150.5], abs=3)


def test_a_transparent_picture_is_uncertain(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(cv2.imencode(".png", np.dstack([scene(), np.zeros((240, 320), np.uint8)]))[1].tobytes())
    assert run(path, "--out", tmp_path / "out") == 0
    assert set("".join(json.loads((tmp_path / "out" / "a.json").read_text())["classes"])) == {"U"}


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (240, 320)])
def test_an_all_black_picture_is_answered_with_u(tmp_path: Path, shape: tuple[int, int]) -> None:
    path = written(tmp_path / "a.png", np.zeros(shape, dtype=np.uint8))
    assert run(path, "--out", tmp_path / "out") == 0
    table = json.loads((tmp_path / "out" / "a.json").read_text(encoding="utf-8"))
    assert set("".join(table["classes"])) == {"U"}
    assert table["rocks"] == []


BAD = ("cut.png", "cut.jpg", "text.png", "empty.png", "float.tiff", "missing.png", "folder")


def bad_files(tmp_path: Path) -> dict[str, Path]:
    good = written(tmp_path / "good.png", scene()).read_bytes()
    jpeg = written(tmp_path / "good.jpg", scene()).read_bytes()
    for name, data in (
        ("cut.png", good[: len(good) // 2]),
        ("cut.jpg", jpeg[: len(jpeg) // 2]),
        ("text.png", b"no picture at all"),
        ("empty.png", b""),
    ):
        (tmp_path / name).write_bytes(data)
    floats = np.zeros((20, 20), dtype=np.float32)
    (tmp_path / "float.tiff").write_bytes(cv2.imencode(".tiff", floats)[1].tobytes())
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "notes.txt").write_text("no picture", encoding="utf-8")
    return {name: tmp_path / name for name in BAD}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_picture_is_told_in_one_line(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = bad_files(tmp_path)[name]
    assert run(path, "--out", tmp_path / "out") == 2
    told = capsys.readouterr().err.strip()
    assert "\n" not in told
    assert str(path) in told
    assert "8 or 16 bits" in told
    assert not list((tmp_path / "out").glob("*"))


@pytest.mark.parametrize("share", [12, 1])
def test_the_good_pictures_of_a_folder_are_done_beside_bad_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, share: int
) -> None:
    """In this process and in others; every bad picture is one line."""
    monkeypatch.setattr("rover_sim.commands.perceive.SHARE", share)
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "notes.txt").write_text("no picture", encoding="utf-8")
    (folder / "bad.jpg").write_bytes(b"nor this")
    for name in ("a.png", "b.JPG"):
        written(folder / name, scene())
    assert run(folder, tmp_path / "missing.png", "--out", tmp_path / "out", "--workers", "2") == 2
    told = capsys.readouterr()
    assert [line.split()[0] for line in told.out.splitlines()] == ["a.png:", "b.JPG:", "2"]
    assert "2 of 4 pictures perceived" in told.out
    faults = sorted(told.err.splitlines())
    assert len(faults) == 2
    assert "bad.jpg: not a picture" in faults[0]
    assert "missing.png: cannot be read" in faults[1]
    assert (tmp_path / "out" / "b.json").is_file()


def test_outlines_beside_a_picture_are_labels(tmp_path: Path) -> None:
    """A mask of no picture in the folder is a picture, and so is one that is named by itself."""
    folder = tmp_path / "in"
    folder.mkdir()
    a, mask, other = (folder / name for name in ("a.jpg", "a_mask.png", "b_mask.png"))
    for path in (a, mask, other):
        path.touch()
    assert pictures_of([folder]) == [a, other]
    assert pictures_of([mask]) == [mask]


def test_equal_names_and_overwriting_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "b").mkdir()
    first, second = written(tmp_path / "a.png", scene()), written(tmp_path / "b" / "a.jpg", scene())
    assert run(first, second, "--out", tmp_path / "out") == 2
    assert "same name" in capsys.readouterr().err
    clash = written(tmp_path / "a_rocks.png", scene())
    before = clash.read_bytes()
    assert run(first, clash, "--out", tmp_path) == 2
    assert clash.read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("fov_deg", "fov", "fov"),
        ("75.2", "190.0", "fov_deg = 190"),
        ("height_m = 1.1\n", "", "height_m"),
        ("width = 320", "width = 240", "240 x 240"),
    ],
)
def test_a_wrong_camera_is_told(
    tmp_path: Path, old: str, new: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    camera = tmp_path / "camera.toml"
    camera.write_text(CAMERA_TOML.replace(old, new), encoding="utf-8")
    assert run(written(tmp_path / "a.png", scene()), "--camera", camera, "--out", tmp_path / "out") == 2
    assert told in capsys.readouterr().err
