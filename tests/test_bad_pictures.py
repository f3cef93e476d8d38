from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from perception.knowledge_base import load_knowledge
from perception.pipeline import examine, on_ground
from rover_sim.camera_file import camera_view, load_camera
from rover_sim.errors import InputError
from rover_sim.pictures import read_picture
from tests.test_camera_file import LENS_TOML
from tests.test_perception_command import run, scene, written

ENDINGS = (".png", ".jpg", ".tiff", ".bmp", ".webp", ".ppm", ".pgm")
MARS = load_knowledge("mars")


def encoded(ending: str) -> bytes:
    small = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)
    return cv2.imencode(ending, small[..., 0] if ending == ".pgm" else small)[1].tobytes()


FILES = {ending: encoded(ending) for ending in ENDINGS}


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A picture file with some bytes changed, many of them in its head, and perhaps cut off."""
    data = bytearray(FILES[draw(st.sampled_from(ENDINGS))])
    for _ in range(draw(st.integers(1, 8))):
        reach = min(len(data), draw(st.sampled_from((40, 200, len(data)))))
        data[draw(st.integers(0, reach - 1))] = draw(st.integers(0, 255))
    return bytes(data[: draw(st.integers(0, len(data)))] if draw(st.booleans()) else data)


def read_or_told(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.bin"
        path.write_bytes(data)
        picture = told = None
        try:
            picture = read_picture(path)
        except InputError as error:
            told = str(error)
    if picture is None:
        assert told is not None
        assert told.startswith(f"{path}: ")
        assert "8 or 16 bits" in told
        assert "\n" not in told
    else:
        assert picture.dtype == np.uint8
        assert picture.ndim == 2 or picture.shape[2] == 3
        assert picture.size > 0


@settings(max_examples=150, deadline=None)
@given(damaged() | st.binary(max_size=400))
def test_any_bytes_are_a_picture_or_one_line(data: bytes) -> None:
    read_or_told(data)


@pytest.mark.slow
@pytest.mark.timeout(600)
@settings(max_examples=5_000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(damaged() | st.binary(max_size=4000))
def test_any_bytes_for_longer(data: bytes) -> None:
    read_or_told(data)


@st.composite
def arrays(draw: st.DrawFn) -> NDArray[Any]:
    """Pictures of any small shape and kind, of noise or of few values, also of the extreme ones."""
    shape = (draw(st.integers(1, 90)), draw(st.integers(1, 90)))
    channels = draw(st.sampled_from((1, 3, 4)))
    kind, top = draw(st.sampled_from(((np.uint8, 255), (np.uint16, 65535))))
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    full = (*shape, channels) if channels > 1 else shape
    if draw(st.booleans()):
        return rng.integers(0, top + 1, full, dtype=kind)
    values = np.array(draw(st.lists(st.sampled_from((0, 1, top // 2, top - 1, top)), min_size=1, max_size=3)))
    return np.asarray(rng.choice(values, full), dtype=kind)


@settings(max_examples=40, deadline=None)
@given(arrays(), st.sampled_from((".png", ".tiff")))
def test_any_picture_is_answered_in_letters(picture: NDArray[Any], ending: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{ending}"
        path.write_bytes(cv2.imencode(ending, picture)[1].tobytes())
        read = read_picture(path)
    assert read.shape[:2] == picture.shape[:2]
    found = examine(read, MARS)
    assert found.classes.shape == (12, 16)
    assert set(found.classes.ravel().tolist()) <= set("SVmMBU")
    assert np.isfinite(found.score).all()


@pytest.mark.parametrize("fill", [0, 255])
def test_black_and_saturated_pictures_are_uncertain_through_a_lens_too(fill: int, tmp_path: Path) -> None:
    camera = tmp_path / "camera.toml"
    camera.write_text(LENS_TOML, encoding="utf-8")
    view = camera_view(load_camera(camera), (320, 240), "a")
    found = on_ground(examine(np.full((240, 320, 3), fill, np.uint8), MARS, view), view, 0.0, MARS)
    assert (found.classes == "U").all()
    assert found.rocks == ()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, len(LENS_TOML) - 1), st.text(max_size=6), st.integers(0, 12))
def test_any_camera_file_is_read_or_told(place: int, put: str, cut: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "camera.toml"
        path.write_text(LENS_TOML[:place] + put + LENS_TOML[place + cut :], encoding="utf-8", errors="replace")
        told, view = "", None
        try:
            view = camera_view(load_camera(path), (320, 240), "a.png")
        except InputError as error:
            told = str(error)
    if view is None:
        assert "\n" not in told
        assert told.startswith((str(path), "a.png"))
    else:
        assert on_ground(examine(scene(), MARS, view), view, 0.0, MARS).classes.shape == (12, 16)


def test_cmyk_and_palette_pictures_keep_their_colours(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image", reason="pillow writes the kinds that OpenCV cannot")
    rgb = np.zeros((40, 60, 3), np.uint8)
    rgb[:, :30], rgb[:, 30:] = (204, 51, 51), (51, 102, 204)
    for mode, name in (("CMYK", "a.jpg"), ("CMYK", "a.tif"), ("P", "a.png")):
        image.fromarray(rgb).convert(mode).save(tmp_path / name)
        read = read_picture(tmp_path / name).astype(int)
        assert np.abs(read[20, [10, 50]] - rgb[20, [10, 50]]).max() <= 4


def test_a_broken_file_is_one_line_on_the_terminal_too(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data = bytearray(written(tmp_path / "a.png", scene()).read_bytes())
    data[20:40] = bytes(20)
    (tmp_path / "a.png").write_bytes(bytes(data))
    (tmp_path / "b.tiff").write_bytes(b"II*\0" + bytes(60))
    for name in ("a.png", "b.tiff"):
        assert run(tmp_path / name, "--out", tmp_path / "out") == 2
        told = capfd.readouterr().err.strip()
        assert told.count("\n") == 0
        assert name in told
