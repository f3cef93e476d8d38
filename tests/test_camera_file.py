from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from perception.camera import project
from perception.ground import ground_points
from rover_sim.camera_file import camera_model, camera_view, load_camera
from rover_sim.errors import InputError
from tests.test_perception_command import CAMERA_TOML, run, scene, written
from worlds.types import Lens

POSE_TOML = "width = 320\nheight = 240\npitch_deg = 25.0\nheight_m = 1.1\n"
LENS_TOML = POSE_TOML + (
    '[lens]\nmodel = "brown"\nfocal_px = [210.0, 208.0]\ncentre_px = [161.0, 119.0]\n'
    "coefficients = [-0.25, 0.08, 0.001, -0.001, -0.01]\n"
)


def file_with(folder: Path, text: str) -> Path:
    path = folder / "camera.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_lens_is_scaled_with_the_picture(tmp_path: Path) -> None:
    camera = load_camera(file_with(tmp_path, LENS_TOML))
    model = camera_model(camera, (640, 480), "a.png")
    assert model.focal_px == 420.0
    assert model.lens == Lens("brown", (-0.25, 0.08, 0.001, -0.001, -0.01), (322.0, 238.0), 416.0 / 420.0)
    small, large = (camera_view(camera, size, "a.png") for size in ((320, 240), (640, 480)))
    points = np.array([[2.0, 0.5, 0.0], [4.0, -1.0, 0.3], [8.0, 3.0, 0.0]])
    one, two = (project(view.camera, view.pose, points)[0] for view in (small, large))
    assert two == pytest.approx(2.0 * one)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[lens]", "fov_deg = 75.0\n[lens]", "one of the two"),
        ("-0.25, ", "", "4 numbers; the model brown has 5"),
        ('"brown"', '"barrel"', "allowed are brown, fisheye"),
        ("centre_px", "center_px", "did you mean 'centre_px'"),
        ("[210.0, 208.0]", "[210.0]", "list of 2 numbers"),
        ("[210.0, ", "[-1.0, ", "lens.focal_px[0] = -1"),
        ("-0.25", "nan", "finite"),
    ],
)
def test_a_wrong_lens_is_told(tmp_path: Path, old: str, new: str, told: str) -> None:
    path = file_with(tmp_path, LENS_TOML.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_camera(path)
    assert str(path) in str(caught.value)
    assert told in str(caught.value)


def test_without_a_lens_and_a_field_of_view_the_file_is_incomplete(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="give fov_deg or a table"):
        load_camera(file_with(tmp_path, POSE_TOML))


def test_perceive_puts_a_rock_where_the_lens_says(tmp_path: Path) -> None:
    picture = written(tmp_path / "a.png", scene())
    for text in (CAMERA_TOML, LENS_TOML):
        camera = file_with(tmp_path, text)
        assert run(picture, "--camera", camera, "--out", tmp_path / "out") == 0
        table = json.loads((tmp_path / "out" / "a.json").read_text(encoding="utf-8"))
        (rock,) = table["rocks"]
        view = camera_view(load_camera(camera), (320, 240), "a.png")
        x, y, width, height = rock["bbox_px"]
        pixels = np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])
        low, high = (f(ground_points(view.camera, view.pose, view.plane, pixels), axis=0) for f in (np.min, np.max))
        assert (low[:2] < rock["position_m"][:2]).all()
        assert (rock["position_m"][:2] < high[:2]).all()
    assert table["camera"]["fov_deg"] is None
    assert table["camera"]["lens"]["model"] == "brown"
