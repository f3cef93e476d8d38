from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from perception.camera import project, rays_c
from perception.depth_rocks import filled_out
from perception.ground import ground_points, window_centres
from perception.ground_planes import ground_planes
from perception.knowledge_base import GroundKnowledge, load_knowledge
from perception.pipeline import Perception, View, perceive
from perception.stereo import (
    MeasuredGround,
    StereoView,
    depth_picture,
    measured_ground,
    on_measured,
    pixels_by_label,
)
from perception.stereo_rocks import refined
from rover_sim.cli import main
from rover_sim.learning.rendered_views import make_world, rendered_views
from rover_sim.sim.renderer import make_renderer
from tests.test_perception_command import CAMERA_TOML, run
from worlds.geometry import camera_pose, quaternion_from_euler, to_the_right
from worlds.types import CameraModel, FloatArray, Frame, GroundPlane, Lens, PerceivedRock, Pose

Pair = tuple[float, float]
CAMERA = CameraModel(320, 240, 200.0, (0.0, 0.0, 1.0), float(np.deg2rad(45.0)))
POSE = camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0)), CAMERA)
VIEW = View(CAMERA, POSE, GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0])))
EYES = StereoView(VIEW, (1.0, 1.0), 200.0 * 0.12)
KNOW = GroundKnowledge()
ROCK = PerceivedRock((1.0, 0.0, 0.0), 0.4, 0.3, 0.2, 0.0, 0.9, 0, 1.0, 0.1)


def test_a_shifted_picture_has_the_depth_of_its_shift() -> None:
    wall = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (240, 340), dtype=np.uint8), (0, 0), 1.2)
    left, right = np.asarray(wall[:, :320], np.uint8), np.asarray(wall[:, 8:328], np.uint8)
    depth = depth_picture(left, right, CAMERA, (1.0, 1.0), 0.12)
    assert depth.shape == (240, 320)
    assert np.isfinite(depth[:, 16:]).mean() > 0.95
    assert np.nanmedian(depth) == pytest.approx(200.0 * 0.12 / 8.0, rel=0.01)


def test_what_the_second_eye_does_not_see_has_no_depth() -> None:
    wall = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 256, (240, 360), dtype=np.uint8), (0, 0), 1.2)
    left, right = np.asarray(wall[:, :320], np.uint8), np.asarray(wall[:, 20:340], np.uint8)
    depth = depth_picture(left, right, CAMERA, (1.0, 1.0), 0.12)
    assert not (depth[:, :22] < 1.3).any()  # no nearer than the wall, 1.2 m away, that is cut off there
    assert np.isfinite(depth[:, 26:]).mean() > 0.95
    assert np.nanmedian(depth) == pytest.approx(200.0 * 0.12 / 20.0, rel=0.01)


def test_pixels_are_told_apart_by_their_labels() -> None:
    labels = np.array([[0, 2, 2], [1, 0, 2]], np.int32)
    (first, second, none) = pixels_by_label(labels, 3)
    assert [part.tolist() for part in first] == [[1], [0]]
    assert [part.tolist() for part in second] == [[0, 0, 1], [1, 2, 2]]
    assert len(none[0]) == 0


def test_without_texture_nothing_is_matched_and_the_rock_stays() -> None:
    flat = np.full((240, 320), 90, np.uint8)
    labels = np.zeros((240, 320), np.int32)
    labels[100:120, 150:170] = 1
    (shown,) = pixels_by_label(labels, 1)
    nothing = np.full((240, 320), np.nan)
    ground = measured_ground(nothing, np.zeros((240, 320), np.int32), np.zeros((240, 320), bool), EYES)
    assert np.isnan(ground.height_m).all()
    stays = refined(ROCK, nothing, shown, ground, EYES, KNOW)
    assert stays.position_w == pytest.approx(ROCK.position_w)
    assert (stays.length_m, stays.height_m) == pytest.approx((ROCK.length_m, ROCK.height_m))
    assert depth_picture(flat, flat, CAMERA, (1.0, 1.0), 0.12).shape == (240, 320)


def test_a_rock_seen_nearer_is_smaller_and_higher_as_worked_by_hand() -> None:
    # The middle of the picture looks 45 degrees down: its ground is sqrt(2) deep. Seen at half of that.
    labels = np.zeros((240, 320), np.int32)
    labels[100:120, 150:170] = 1
    (shown,) = pixels_by_label(labels, 1)
    depth = np.full((240, 320), np.sqrt(2.0) / 2.0)
    nothing = np.full((240, 320), np.nan)
    nowhere = ground_planes(np.zeros((0, 2)), np.zeros(0), np.zeros(2))
    unknown = MeasuredGround(nothing, nothing, nothing, nowhere, np.inf)
    unsure = structs.replace(ROCK, position_sd_m=1e3)
    moved = refined(unsure, depth, shown, unknown, EYES, KNOW)
    assert moved.position_w == pytest.approx((0.5, 0.0, 0.5), abs=1e-3)
    assert (moved.length_m, moved.width_m, moved.height_m) == pytest.approx((0.2, 0.15, 0.1), abs=1e-3)
    assert moved.position_sd_m == pytest.approx(
        np.hypot(np.hypot(0.05, np.hypot(0.15, 0.08) * 0.5 / 24.0), 0.05), rel=1e-3
    )
    sure = refined(structs.replace(ROCK, position_sd_m=1e-6), depth, shown, unknown, EYES, KNOW)
    assert sure.position_w == pytest.approx(ROCK.position_w, abs=1e-6)


def plane_depth(height_m: float) -> FloatArray:
    """Depth of the pixels of level ground that lies ``height_m`` over the believed one."""
    lifted = GroundPlane(np.array([0.0, 0.0, height_m]), np.array([0.0, 0.0, 1.0]))
    pixels = np.stack(np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5), axis=-1)
    return project(CAMERA, POSE, ground_points(CAMERA, POSE, lifted, pixels))[1]


def test_ground_that_lies_higher_is_measured_and_brings_the_rock_nearer() -> None:
    labels = np.zeros((240, 320), np.int32)
    labels[100:120, 150:170] = 1
    depth = plane_depth(0.1)
    ground = measured_ground(depth, labels, np.zeros((240, 320), bool), EYES)
    assert np.nanmax(np.abs(ground.height_m - 0.1)) < 1e-6
    assert ground.sd_m[200, 160] < ground.sd_m[60, 160]
    depth[labels == 1] = np.nan
    moved = refined(structs.replace(ROCK, position_sd_m=1.0), depth, pixels_by_label(labels, 1)[0], ground, EYES, KNOW)
    # The camera is 1 m over the believed ground, 0.9 m over the true one; nearly all weight is on what was measured.
    assert moved.range_m == pytest.approx(0.9, abs=0.01)
    assert moved.position_w[2] == pytest.approx(0.1, abs=0.01)
    flat = measured_ground(plane_depth(0.0), labels, np.zeros((240, 320), bool), EYES)
    assert flat.slope_sd == 0.0
    assert ground.slope_sd > 0.03


def test_windows_lie_on_the_measured_ground() -> None:
    labels, hidden = np.zeros((240, 320), np.int32), np.zeros((240, 320), bool)
    believed = window_centres(CAMERA, POSE, VIEW.plane, (12, 16), 10.0)
    moved = on_measured(believed, measured_ground(plane_depth(0.2), labels, hidden, EYES), EYES)
    assert moved[3:] == pytest.approx(0.8 * believed[3:], abs=0.02)
    flat = on_measured(believed, measured_ground(plane_depth(0.0), labels, hidden, EYES), EYES)
    assert flat == pytest.approx(believed, nan_ok=True)
    blind = measured_ground(np.full((240, 320), np.nan), labels, hidden, EYES)
    assert on_measured(believed, blind, EYES) == pytest.approx(believed, nan_ok=True)


def test_the_points_of_a_rock_tell_its_height() -> None:
    labels = np.zeros((240, 320), np.int32)
    labels[80:120, 150:170] = 1
    depth = plane_depth(0.0)
    depth[labels == 1] = plane_depth(0.3)[labels == 1]
    ground = measured_ground(depth, labels, np.zeros((240, 320), bool), EYES)
    unsure = structs.replace(ROCK, height_sd_m=1.0)
    assert refined(unsure, depth, pixels_by_label(labels, 1)[0], ground, EYES, KNOW).height_m == pytest.approx(
        0.3, abs=0.01
    )
    told = [structs.replace(unsure, height_m=height, height_sd_m=0.015) for height in (0.1, 0.5)]
    low, high = (refined(rock, depth, pixels_by_label(labels, 1)[0], ground, EYES, KNOW).height_m for rock in told)
    assert (low - 0.1) / 0.2 > 1.3 * (0.5 - high) / 0.2, "an outline that is too low may be that of a piece"
    assert (
        refined(structs.replace(unsure, cut=True), depth, pixels_by_label(labels, 1)[0], ground, EYES, KNOW).height_m
        < 0.25
    )


def test_a_rock_is_as_high_as_it_rises_over_where_wheels_stand() -> None:
    # Level ground, but for a knoll of 5 cm around the foot of a rock whose points lie 30 cm over the level.
    labels = np.zeros((240, 320), np.int32)
    labels[100:120, 150:170] = 1
    depth = plane_depth(0.0)
    depth[118:128, 145:175] = plane_depth(0.05)[118:128, 145:175]
    depth[labels == 1] = plane_depth(0.3)[labels == 1]
    ground = measured_ground(depth, labels, np.zeros((240, 320), bool), EYES)
    shown = pixels_by_label(labels, 1)[0]
    assert ground.height_m[119, 160] > 0.02, "the ground beside it is the knoll"
    assert ground.planes.height_m(np.array([1.0, 0.0])) == pytest.approx(0.0, abs=0.01)
    unsure = structs.replace(ROCK, height_sd_m=1.0)
    assert refined(unsure, depth, shown, ground, EYES, KNOW).height_m == pytest.approx(0.3, abs=0.01)


@given(
    tilt=st.tuples(*[st.floats(-0.3, 0.3)] * 2),
    eye=st.tuples(*[st.floats(-50.0, 50.0)] * 2),
    place=st.tuples(*[st.floats(-1.5, 1.5)] * 2),
)
def test_planes_of_flat_ground_are_that_ground(tilt: Pair, eye: Pair, place: Pair) -> None:
    steps = np.arange(-3.0, 3.0, 0.03)
    ground = np.array(eye) + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    heights = (ground - eye) @ tilt + 0.2
    planes = ground_planes(ground, heights, np.array(eye))
    # Cells and the liking for level ground leave a share of a slope's rise within half a cell.
    found = planes.height_m(np.array(eye) + place)
    assert found == pytest.approx(0.2 + np.array(place) @ tilt, abs=0.01 * np.abs(tilt).sum() + 1e-9)


def test_planes_are_not_known_where_too_little_ground_is_seen() -> None:
    near = np.random.default_rng(0).uniform(-0.2, 0.2, size=(500, 2))
    planes = ground_planes(near, np.zeros(500), np.zeros(2))
    assert np.isnan(planes.height_m(np.array([0.0, 0.0]))), "16 cells of 10 cm, where 30 are asked for"
    assert np.isnan(planes.height_m(np.array([40.0, 0.0]))), "beyond what is looked at"


def test_the_face_of_a_rock_that_looks_like_soil_is_filled_out_by_depth() -> None:
    depth, labels = plane_depth(0.0), np.zeros((240, 320), np.int32)
    depth[80:120, 150:170] = plane_depth(0.15)[80:120, 150:170]
    depth[80:120, 220:240] = plane_depth(0.15)[80:120, 220:240]
    labels[80:90, 150:170] = 1
    found = filled_out(labels, depth, np.zeros((240, 320), bool), EYES)
    np.testing.assert_array_equal(found == 1, labels == 1)
    face = np.zeros((240, 320), bool)
    face[90:120, 150:170] = True  # not the thing that no rock touches
    np.testing.assert_array_equal(found == 2, face)
    assert found.max() == 2


@pytest.mark.parametrize("lens", [
    Lens("brown", (-0.22, 0.05, 0.001, -0.001, 0.0), (158.0, 122.0)),
    Lens("fisheye", (-0.02, 0.003, 0.0, 0.0), (161.0, 118.0), 1.01),
])  # fmt: skip
def test_pairs_through_a_lens_are_matched_where_their_points_belong(lens: Lens) -> None:
    wall = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (440, 560), dtype=np.uint8), (0, 0), 1.2)
    camera = replace(CAMERA, lens=lens)
    pixels = np.stack(np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5), axis=-1)
    ideal = np.moveaxis(rays_c(camera, pixels)[..., :2] * 200.0 + [279.5, 219.5], -1, 0).astype(np.float32)
    pair = [
        np.asarray(cv2.remap(wall, ideal[0] + np.float32(shift), ideal[1], cv2.INTER_LINEAR), np.uint8)
        for shift in (0.0, 8.0)
    ]
    depth = depth_picture(pair[0], pair[1], camera, (1.0, 1.0), 0.12)
    seen = np.isfinite(depth)
    assert seen[20:-20, 40:-40].mean() > 0.9
    assert np.abs(depth[seen] / 3.0 - 1.0).mean() < 0.02
    assert np.abs(depth_picture(pair[0], pair[1], CAMERA, (1.0, 1.0), 0.12)[seen] / 3.0 - 1.0).mean() > 0.03
    labels = np.zeros((240, 320), np.int32)
    labels[40:90, 60:120] = 1
    told = depth_picture(pair[0], pair[1], camera, (1.0, 1.0), 0.12, labels)
    np.testing.assert_array_equal(np.isfinite(told), seen)
    rock = seen & (labels == 1)
    assert (told[rock] != depth[rock]).mean() > 0.5
    assert np.median(told[rock]) == pytest.approx(3.0, rel=0.003)  # resampled twice, single pixels err by 0.08
    assert np.abs(told[rock] / 3.0 - 1.0).mean() < 0.02


def test_two_eyes_place_rendered_rocks_on_rolling_ground_better_than_one() -> None:
    world, knowledge = make_world(311, 0.06), load_knowledge("rendered")
    renderer = make_renderer(world)
    off: dict[str, list[float]] = {"one": [], "two": []}
    for view in rendered_views(world, 3):
        assert view.frame.camera_pose is not None
        right = renderer.render(view.frame.camera, to_the_right(view.frame.camera_pose, 0.12)).image
        frames = {"one": view.frame, "two": replace(view.frame, right=right, baseline_m=0.12)}
        for name, frame in frames.items():
            found = perceive(frame, knowledge)
            assert found.observation is not None
            assert found.observation.rocks == tuple(rock.placed for rock in found.rocks if rock.placed)
            for rock in found.rocks:
                owners = np.bincount(np.maximum(view.truth.ids[found.labels == rock.id], 0))
                row = np.flatnonzero(view.rocks.ids == owners.argmax())
                if rock.placed is not None and len(row) and view.rocks.range_m[row[0]] > 2.5:
                    place = np.array(rock.placed.position_w)[:2] - view.rocks.position_w[row[0], :2]
                    off[name].append(float(np.hypot(*place)))
    assert len(off["two"]) > 8
    assert np.median(off["two"]) < 0.35 * np.median(off["one"])


def test_the_command_takes_a_pair(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world = make_world(311, 0.06)
    view = next(iter(rendered_views(world, 1)))
    assert view.frame.camera_pose is not None
    right = make_renderer(world).render(view.frame.camera, to_the_right(view.frame.camera_pose, 0.12)).image
    for name, picture in (("l.png", view.frame.image), ("r.png", right), ("s.png", right[::2, ::2])):
        cv2.imwrite(str(tmp_path / name), picture[..., ::-1])
    camera, left, second = tmp_path / "camera.toml", tmp_path / "l.png", tmp_path / "r.png"
    camera.write_text(CAMERA_TOML + "[stereo]\nbaseline_m = 0.12\n", encoding="utf-8")
    words = (left, "--camera", camera, "--knowledge", "rendered", "--out")
    assert run(*words, tmp_path / "one") == 0
    assert run(*words, tmp_path / "two", "--right", second) == 0
    one, two = (
        json.loads((tmp_path / name / "l.json").read_text(encoding="utf-8"))["rocks"] for name in ("one", "two")
    )
    assert len(one) == len(two)
    assert any(a["position_m"] != b["position_m"] for a, b in zip(one, two, strict=True) if "position_m" in a)
    capsys.readouterr()
    for extra, told in (
        (("--right", tmp_path / "s.png"), "is 160 x 120 px"),
        (("--right", tmp_path / "gone.png"), "gone.png"),
    ):
        assert run(*words, tmp_path / "three", *extra) == 2
        assert told in capsys.readouterr().err
    assert run(second, *words, tmp_path / "three", "--right", second) == 2
    assert "belongs to one picture" in capsys.readouterr().err
    camera.write_text(CAMERA_TOML, encoding="utf-8")
    assert run(*words, tmp_path / "four", "--right", second) == 2
    assert "baseline_m" in capsys.readouterr().err


SHORT = """name = "pair"
[terrain]
kind = "flat"
size_m = [24.0, 24.0]
[goal]
position_m = [8.0, 0.0]
time_limit_s = 2.0
"""


@pytest.mark.parametrize("stereo", [False, True])
def test_a_run_with_two_cameras_sees_by_both(tmp_path: Path, stereo: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[Frame] = []

    def noted(frame: Frame, *rest: Any) -> Perception:
        looks.append(frame)
        return perceive(frame, *rest)

    monkeypatch.setattr("rover_sim.onboard.perceive", noted)
    scenario = tmp_path / "pair.toml"
    scenario.write_text(SHORT + f"[sensors]\nstereo = {str(stereo).lower()}\n", encoding="utf-8")
    assert main(["run", str(scenario), "--seed", "3", "--out", str(tmp_path / "out")]) == 1
    assert len(looks) >= 2
    assert all((look.right is not None) == stereo for look in looks)
    if stereo:
        right = looks[0].right
        assert right is not None
        depth = depth_picture(looks[0].image, right, looks[0].camera, (1.0, 1.0), 0.12)
        # The lower edge of the picture shows flat ground.
        assert np.nanmedian(depth[-20:]) == pytest.approx(np.nanmedian(_flat_depth(looks[0])[-20:]), rel=0.05)


def _flat_depth(frame: Frame) -> FloatArray:
    assert frame.camera_pose is not None
    assert frame.ground is not None
    pixels = np.stack(np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5), axis=-1)
    points = ground_points(frame.camera, frame.camera_pose, frame.ground, pixels)
    return project(frame.camera, frame.camera_pose, points)[1]
