from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.cli import main
from tests.data import data_path
from worlds.build import build_world
from worlds.dem import Elevation, load_dem
from worlds.errors import ScenarioError
from worlds.holes import fill_holes
from worlds.scenario import Goal, Scenario, Terrain
from worlds.types import FloatArray, HeightField


def load(terrain: Terrain, seed: int = 0) -> Elevation:
    return load_dem(terrain, "world.toml", np.random.default_rng(seed))


def saved(path: Path, heights: FloatArray) -> Terrain:
    np.save(path, heights)
    return Terrain(kind="dem", path=str(path), resolution_m=0.5)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-1, 1), st.floats(-1, 1))
def test_a_plane_is_filled_in_exactly_wherever_its_holes_are(seed: int, along: float, across: float) -> None:
    rng = np.random.default_rng(seed)
    plane = 3.0 + np.add.outer(along * np.arange(12.0), across * np.arange(15.0))
    holes = rng.random(plane.shape) < 0.3
    holes[:3, :3] = True  # a corner, where nothing is known on two sides
    filled = fill_holes(np.where(holes, np.nan, plane), holes)
    assert filled == pytest.approx(plane, abs=1e-6)


def test_a_hole_in_a_hill_goes_on_with_its_slope() -> None:
    y, x = np.mgrid[-3:3:61j, -3:3:61j]
    hill = np.exp(-(x**2) - y**2)
    holes = (x - 0.7) ** 2 + y**2 < 0.3**2
    filled = fill_holes(np.where(holes, np.nan, hill), holes)
    assert np.array_equal(filled[~holes], hill[~holes])
    assert np.abs(filled - hill)[holes].max() < 0.01  # a patch 0.6 across on a hill that falls by 0.8 m a metre
    assert np.abs(np.diff(filled, n=2, axis=1)).max() < 1.2 * np.abs(np.diff(hill, n=2, axis=1)).max()


def test_few_missing_heights_are_filled_and_told(tmp_path: Path) -> None:
    ramp = np.add.outer(np.arange(21) * 0.1, np.arange(31) * 0.02)
    holes = ramp.copy()
    holes[3, 4], holes[5, 6] = np.nan, np.inf
    elevation = load(saved(tmp_path / "h.npy", holes))
    assert elevation.field.heights_m == pytest.approx(ramp)
    assert elevation.notes == ("h.npy: 2 of 651 heights (0.31 %) are missing and were filled in",)


def test_no_data_values_are_holes_in_any_type(tmp_path: Path) -> None:
    lowest = "-3.4028234663852886e+38"  # as programs write it for single precision
    for kind, mark in ((np.float32, lowest), (np.float64, "-9999"), (np.int16, "-32768"), (np.uint16, "0")):
        heights = np.full((20, 20), 7, dtype=kind)
        heights[4, 5] = kind(float(mark))
        path = tmp_path / f"{np.dtype(kind)}.tif"
        tifffile.imwrite(path, heights, extratags=[(42113, "s", 0, mark, True)])
        elevation = load(Terrain(kind="dem", path=str(path), resolution_m=0.5))
        assert elevation.field.heights_m == pytest.approx(np.full((20, 20), 7.0))
        assert "1 of 400" in elevation.notes[0]


def test_more_than_five_percent_is_refused_unless_cropped_away(tmp_path: Path) -> None:
    heights = np.zeros((20, 20))
    heights[:, 0] = heights[0, 1] = np.nan  # 21 of 400
    terrain = saved(tmp_path / "gap.npy", heights)
    with pytest.raises(ScenarioError) as caught:
        load(terrain)
    assert str(caught.value) == (
        f'world.toml: terrain.path = "{tmp_path / "gap.npy"}": 21 of 400 heights (5.2 %) are missing; '
        "up to 5 % would be filled in, so choose a part without gaps by terrain.crop_m"
    )
    part = Terrain(kind="dem", path=terrain.path, resolution_m=0.5, crop_m=(-4.0, -4.0, 4.0, 4.0))
    assert load(part).notes == ()


def scenario_file(folder: Path, heights: FloatArray, extra: str = "") -> str:
    np.save(folder / "yard.npy", heights)
    text = f"""
        name = "yard"
        terrain = {{ kind = "dem", path = "yard.npy", resolution_m = 0.2 }}
        rocks.cfa = 0.0
        goal = {{ position_m = [3.0, 0.0], time_limit_s = 1.0 }}
        {extra}
    """
    (folder / "yard.toml").write_text(text)
    return str(folder / "yard.toml")


def test_build_and_run_say_so_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heights = np.zeros((81, 81))
    heights[3, 3] = np.nan
    path = scenario_file(tmp_path, heights)
    line = "yard.npy: 1 of 6561 heights (0.015 %) are missing and were filled in"
    assert main(["world", "build", path, "--out", str(tmp_path / "world")]) == 0
    assert line.partition(" are ")[0] in " ".join(capsys.readouterr().out.split())
    assert main(["run", path, "--out", str(tmp_path / "run")]) == 1  # the time is over at once
    assert f"rover-sim run: {line}\n" in capsys.readouterr().err


def test_too_many_holes_end_the_command_with_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heights = np.zeros((81, 81))
    heights[:5] = np.nan
    assert main(["world", "build", scenario_file(tmp_path, heights)]) == 2
    error = capsys.readouterr().err
    assert "405 of 6561 heights (6.2 %) are missing" in error
    assert error.count("\n") == 1


def detailed(path: Path, seed: int, detail_m: float = 0.03) -> HeightField:
    return load(Terrain(kind="dem", path=str(path), resolution_m=0.1, detail_m=detail_m), seed).field


@pytest.fixture
def coarse(tmp_path: Path) -> Path:
    """A level square of 20 m with a pixel of 0.5 m."""
    path = tmp_path / "level.tif"
    tifffile.imwrite(path, np.ones((41, 41)), extratags=[(33550, "d", 3, (0.5, 0.5, 0.0), True)])
    return path


def test_detail_is_seeded_has_its_rms_and_only_what_the_file_cannot_hold(coarse: Path) -> None:
    field = detailed(coarse, 1)
    detail = field.heights_m - 1.0
    assert detail.std() == pytest.approx(0.03, rel=0.02)
    assert np.array_equal(field.heights_m, detailed(coarse, 1).heights_m)
    assert not np.allclose(field.heights_m, detailed(coarse, 2).heights_m)
    power = np.abs(np.fft.fft2(detail[:-1, :-1])) ** 2
    f = np.fft.fftfreq(detail.shape[0] - 1, 0.1)
    frequency = np.hypot(f[:, None], f[None, :])
    # Longer waves than two pixels of the file are the file's own matter.
    assert power[(frequency > 0) & (frequency < 1.0 / 1.05)].sum() < 1e-9 * power.sum()
    assert detailed(coarse, 1, 0.0).heights_m == pytest.approx(np.ones((201, 201)), abs=1e-12)


def test_detail_needs_a_finer_grid_than_the_files(coarse: Path) -> None:
    with pytest.raises(ScenarioError, match=r"terrain.detail_m = 0.03: adds relief finer than .* grid of 0.5 m"):
        load(Terrain(kind="dem", path=str(coarse), resolution_m=0.5, detail_m=0.03))


def test_the_real_yard_takes_detail_and_rocks() -> None:
    yard = str(data_path("worlds", "marsyard2022_hm.tif"))
    plain, rough = (
        build_world(
            Scenario(
                name="yard",
                terrain=Terrain(
                    kind="dem", path=yard, resolution_m=0.1, detail_m=detail, crop_m=(-15.0, -15.0, 15, 15)
                ),
                goal=Goal(position_m=(8.0, 0.0)),
            ),
            3,
        )
        for detail in (0.0, 0.01)
    )
    assert len(rough.rocks) > 100
    assert [r.position_w[:2] for r in rough.rocks] == [r.position_w[:2] for r in plain.rocks]
    assert (rough.ground.heights_m - plain.ground.heights_m).std() == pytest.approx(0.01, rel=0.02)
    assert rough.notes == ()
