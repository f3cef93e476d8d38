from __future__ import annotations

import platform
import subprocess
import sys

import cv2
import numpy as np
import pytest

from perception.knowledge_base import load_knowledge
from perception.pipeline import Perception, perceive
from tests.data import data_path
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.types import ByteArray, CameraModel, Frame, GroundPlane, Pose

CAMERA = CameraModel(320, 240, 207.8, (0.0, 0.0, 1.1), float(np.deg2rad(25.0)))
POSE = camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0)), CAMERA)
LEVEL = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
MARS = load_knowledge("mars")
SAND, BASALT, LIMESTONE = (165, 140, 98), (92, 92, 88), (225, 215, 200)


def sand(seed: int = 0, shape: tuple[int, int] = (240, 320)) -> ByteArray:
    grain = np.random.default_rng(seed).normal(0.0, 3.0, (*shape, 1))
    return np.clip(np.array(SAND) + grain, 0, 255).astype(np.uint8)


def with_rock(picture: ByteArray, centre: tuple[int, int], axes: tuple[int, int], colour: tuple[int, ...]) -> ByteArray:
    stained = picture.copy()
    cv2.ellipse(stained, centre, axes, 0, 0, 360, colour, -1)
    grain = np.random.default_rng(5).normal(0.0, 8.0, (*picture.shape[:2], 1))
    inside = (stained != picture).any(axis=2)
    stained[inside] = np.clip(stained.astype(float) + grain, 0, 255).astype(np.uint8)[inside]
    return stained


def look(picture: ByteArray, name: str = "mars") -> Perception:
    return perceive(Frame(0.0, picture, CAMERA, POSE, LEVEL), load_knowledge(name))


@pytest.mark.parametrize("name", ["mars", "rendered"])
@pytest.mark.parametrize("colour", [BASALT, LIMESTONE])
def test_a_dark_and_a_bright_rock_are_found_in_place(name: str, colour: tuple[int, ...]) -> None:
    found = look(with_rock(sand(), (200, 150), (24, 14), colour), name)
    assert len(found.rocks) == 1
    rock = found.rocks[0]
    assert rock.centroid_px == pytest.approx((200.5, 150.5), abs=2.0)
    assert rock.certainty > 0.6
    assert rock.formation in {1, 9}  # level: between the first sector and the last
    assert found.observation is not None
    (placed,) = found.observation.rocks
    # The base line is row 165: 1.1 / tan(25 deg + atan(45 / 207.8)) = 1.40 m to the near edge.
    near = 1.1 / np.tan(np.deg2rad(25) + np.arctan(45 / 207.8))
    assert placed.position_w[0] == pytest.approx(near + placed.width_m / 2, abs=0.12)
    assert placed.position_w[1] < -0.15  # right of the middle
    assert placed.length_m == pytest.approx(0.4, abs=0.1)


def test_bare_sand_has_no_rocks_and_a_sky_above_the_horizon() -> None:
    found = look(sand())
    assert found.rocks == ()
    assert set(found.classes[0]) == {"U"}
    assert set(found.classes[3:].ravel()) <= {"S", "V"}
    assert found.observation is not None
    assert found.observation.footprint_w.shape[1] == 2
    assert found.observation.class_centre_w.shape == (12, 16, 2)


def test_soil_in_shade_is_no_rock_to_the_rendered_knowledge() -> None:
    picture = sand()
    picture[120:160, 100:180] = (picture[120:160, 100:180] * 0.45).astype(np.uint8)
    assert not look(picture, "rendered").mask[125:155, 105:175].any()


def test_rows_above_the_horizon_follow_the_roll() -> None:
    pose = camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.2, 0.0, 0.0)), CAMERA)
    found = perceive(Frame(0.0, sand(), CAMERA, pose, LEVEL), MARS)
    assert found.hidden[:, 0].sum() > found.hidden[:, -1].sum() + 30


@pytest.mark.parametrize("shape", [(1, 1), (3, 1000), (240, 320), (480, 640), (101, 77)])
@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_picture_of_any_size_is_uncertain(shape: tuple[int, int], level: int) -> None:
    found = perceive(Frame(0.0, np.full(shape, level, dtype=np.uint8), CAMERA), MARS)
    assert found.classes.shape == (12, 16)
    assert set(found.classes.ravel()) == {"U"}
    assert found.rocks == ()
    assert found.observation is None


@pytest.mark.parametrize("seed", range(3))
def test_pure_noise_is_answered(seed: int) -> None:
    rng = np.random.default_rng(seed)
    picture = rng.integers(0, 256, (240, 320, 3), dtype=np.uint8)
    assert look(picture).classes.shape == (12, 16)


def test_a_larger_picture_tells_the_same_in_its_own_scale() -> None:
    small = with_rock(sand(), (200, 150), (24, 14), BASALT)
    large = cv2.resize(small, (960, 720), interpolation=cv2.INTER_CUBIC)
    camera = CameraModel(960, 720, 3 * 207.8, CAMERA.position_b, CAMERA.pitch_rad)
    found = perceive(Frame(0.0, np.asarray(large, dtype=np.uint8), camera, POSE, LEVEL), MARS)
    assert found.scale == (3.0, 3.0)
    near, far = look(small).observation, found.observation
    assert near is not None
    assert far is not None
    assert far.rocks[0].position_w == pytest.approx(near.rocks[0].position_w, abs=0.05)


def test_the_same_picture_gives_the_same_answer() -> None:
    picture = with_rock(sand(1), (100, 180), (30, 20), BASALT)
    first, second = look(picture), look(picture)
    assert first.rocks == second.rocks
    assert (first.score == second.score).all()
    assert (first.classes == second.classes).all()


def test_rocks_of_real_pictures() -> None:
    folder = data_path("mars", "rocks")
    both = either = 0
    for mask_path in sorted(folder.glob("*_mask.png"))[:6]:
        picture = cv2.imread(str(mask_path).replace("_mask", ""))
        truth = cv2.imread(str(mask_path), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        assert truth is not None
        found = perceive(Frame(0.0, np.asarray(picture[..., ::-1], dtype=np.uint8), CAMERA), MARS).mask
        both += int((found & (truth > 127)).sum())
        either += int((found | (truth > 127)).sum())
    assert both / either > 0.6


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="how memory is kept is up to the C library")
def test_a_frame_reuses_the_memory_of_the_one_before() -> None:
    script = """
import resource
import numpy as np
from perception.pipeline import examine, load_knowledge
picture, know = np.random.default_rng(0).integers(90, 160, (240, 320, 3), dtype=np.uint8), load_knowledge("rendered")
for _ in range(4):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    examine(picture, know)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=120)
    assert int(told.stdout) < 300  # a thousand where nothing is kept
