from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import tifffile

from tests.data import data_path
from worlds.build import build_world
from worlds.dem import load_dem
from worlds.errors import ScenarioError
from worlds.heightfield import height_at
from worlds.scenario import Terrain, load_scenario
from worlds.types import FloatArray, HeightField

RAMP = np.add.outer(np.arange(21) * 0.1, np.arange(31) * 0.02)  # row 0 is the southernmost


def dem(path: Path, **keys: object) -> Terrain:
    return Terrain(kind="dem", path=str(path), **keys)  # type: ignore[arg-type]


def write_tif(path: Path, heights: FloatArray, pixel_m: float | None = None, missing: str | None = None) -> Path:
    tags: list[Any] = []
    if pixel_m:
        tags.append((33550, "d", 3, (pixel_m, pixel_m, 0.0), True))
    if missing:
        tags.append((42113, "s", 0, missing, True))
    tifffile.imwrite(path, heights[::-1], extratags=tags)
    return path


def loaded(terrain: Terrain) -> HeightField:
    return load_dem(terrain, "test", np.random.default_rng(0)).field


def test_npy_is_centred_on_the_origin_with_its_first_row_in_the_south(tmp_path: Path) -> None:
    np.save(tmp_path / "ramp.npy", RAMP)
    field = loaded(dem(tmp_path / "ramp.npy", resolution_m=0.5))
    assert field.x_limits_m == (-7.5, 7.5)
    assert field.y_limits_m == (-5.0, 5.0)
    assert np.array_equal(field.heights_m, RAMP)
    assert height_at(field, 0.0, 5.0) - height_at(field, 0.0, -5.0) == pytest.approx(2.0)


@pytest.mark.parametrize("spline", ["bilinear", "bicubic"])
def test_geotiff_brings_its_pixel_size_and_is_resampled(tmp_path: Path, spline: str) -> None:
    path = write_tif(tmp_path / "ramp.tif", RAMP, pixel_m=0.5)
    field = loaded(dem(path, resolution_m=0.1, resample=spline))
    assert field.heights_m.shape == (101, 151)
    # A plane is kept by either spline: 0.2 per metre north, 0.04 per metre east, 1.3 in the middle.
    assert height_at(field, 3.21, -2.17) == pytest.approx(1.3 + 0.04 * 3.21 - 0.2 * 2.17)


def test_tiff_without_tags_takes_the_scenarios_resolution(tmp_path: Path) -> None:
    field = loaded(dem(write_tif(tmp_path / "r.tif", RAMP), resolution_m=0.25))
    assert field.resolution_m == 0.25
    assert field.heights_m == pytest.approx(RAMP)


def test_png_spreads_grey_over_the_height_range(tmp_path: Path) -> None:
    grey = np.linspace(0, 65535, 8 * 9).reshape(8, 9).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "g.png"), grey)
    field = loaded(dem(tmp_path / "g.png", resolution_m=1.0, height_range_m=(-1.0, 3.0)))
    # North, and so the brightest row of this picture's end, is at the top.
    assert field.heights_m[-1, 0] == pytest.approx(-1.0)
    assert field.heights_m[0, -1] == pytest.approx(3.0)


def test_a_crop_keeps_the_coordinates(tmp_path: Path) -> None:
    np.save(tmp_path / "ramp.npy", RAMP)
    whole = loaded(dem(tmp_path / "ramp.npy", resolution_m=0.5))
    part = loaded(dem(tmp_path / "ramp.npy", resolution_m=0.5, crop_m=(-2.0, -1.0, 5.0, 4.0)))
    assert part.x_limits_m == (-2.0, 5.0)
    assert part.y_limits_m == (-1.0, 4.0)
    assert height_at(part, 1.3, 2.2) == pytest.approx(height_at(whole, 1.3, 2.2))


def test_a_tilt_is_added(tmp_path: Path) -> None:
    np.save(tmp_path / "flat.npy", np.zeros((11, 11)))
    field = loaded(dem(tmp_path / "flat.npy", resolution_m=1.0, slope_deg=45.0))
    assert field.heights_m[:, -1] - field.heights_m[:, 0] == pytest.approx(10.0)


def fault(terrain: Terrain) -> str:
    with pytest.raises(ScenarioError) as caught:
        load_dem(terrain, "world.toml", np.random.default_rng(0))
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("world.toml: terrain.")
    return message


def test_files_that_are_no_elevation_are_refused(tmp_path: Path) -> None:
    assert "no such file" in fault(dem(tmp_path / "none.tif"))
    assert "allowed are .tif, .npy and .png" in fault(dem(tmp_path / "none.asc"))
    (tmp_path / "x.tif").write_bytes(b"not a picture")
    assert "not a readable TIFF" in fault(dem(tmp_path / "x.tif"))
    (tmp_path / "x.npy").write_bytes(b"not an array")
    assert "not a readable NumPy array" in fault(dem(tmp_path / "x.npy"))
    np.save(tmp_path / "cube.npy", np.zeros((5, 5, 5)))
    assert "has shape (5, 5, 5)" in fault(dem(tmp_path / "cube.npy"))
    np.save(tmp_path / "text.npy", np.full((5, 5), "a"))
    assert "values of type" in fault(dem(tmp_path / "text.npy"))
    np.save(tmp_path / "tiny.npy", np.zeros((3, 9)))
    assert "only 9 x 3 heights" in fault(dem(tmp_path / "tiny.npy"))


def test_truncated_files_are_refused(tmp_path: Path) -> None:
    whole = write_tif(tmp_path / "w.tif", RAMP, 0.5).read_bytes()
    for length in (0, 5, 40, len(whole) // 2):
        (tmp_path / "cut.tif").write_bytes(whole[:length])
        assert "cut.tif" in fault(dem(tmp_path / "cut.tif"))
    np.save(tmp_path / "w.npy", RAMP)
    whole = (tmp_path / "w.npy").read_bytes()
    for length in (0, 5, 40, len(whole) // 2):
        (tmp_path / "cut.npy").write_bytes(whole[:length])
        assert "not a readable NumPy array" in fault(dem(tmp_path / "cut.npy"))


def test_pictures_need_their_range_and_one_channel(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "c.png"), np.zeros((9, 9, 3), np.uint8))
    assert "terrain.height_range_m" in fault(dem(tmp_path / "c.png"))
    assert "has shape (9, 9, 3)" in fault(dem(tmp_path / "c.png", height_range_m=(0.0, 1.0)))
    (tmp_path / "x.png").write_bytes(b"not a picture")
    assert "not a readable PNG" in fault(dem(tmp_path / "x.png", height_range_m=(0.0, 1.0)))


def test_a_crop_off_the_file_says_what_is_allowed(tmp_path: Path) -> None:
    np.save(tmp_path / "ramp.npy", RAMP)
    terrain = dem(tmp_path / "ramp.npy", resolution_m=0.5, crop_m=(0.0, 0.0, 99.0, 2.0))
    assert "allowed are x -7.50 to 7.50 and y -5.00 to 5.00" in fault(terrain)


def test_too_fine_a_resolution_is_refused(tmp_path: Path) -> None:
    path = write_tif(tmp_path / "big.tif", np.zeros((100, 100)), pixel_m=1.0)
    assert "terrain.resolution_m = 0.01: a map of 99 x 99 m" in fault(dem(path, resolution_m=0.01))


def test_the_real_mars_yard_builds_with_rocks(tmp_path: Path) -> None:
    yard = data_path("worlds", "marsyard2022_hm.tif")
    (tmp_path / "marsyard.toml").write_text(
        f"""
        name = "marsyard"
        [terrain]
        kind = "dem"
        path = "{yard}"
        resolution_m = 0.1
        [rocks]
        cfa = 0.02
        [rover]
        start_m = [-2.0, -5.0]
        heading_deg = 90.0
        [goal]
        position_m = [-2.0, 10.0]
        """
    )
    world = build_world(load_scenario(str(tmp_path / "marsyard.toml")), 0)
    # 256 pixels of 0.19455 m, cut to whole cells.
    assert world.ground.heights_m.shape == (499, 499)
    assert 0.0 < world.ground.heights_m.min() < world.ground.heights_m.max() < 4.9
    assert len(world.rocks) > 500
