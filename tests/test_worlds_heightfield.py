from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from worlds.heightfield import contains, gradient_at, height_at, normal_at, slope_deg, window
from worlds.scenario import Terrain
from worlds.synthesis import synthesise
from worlds.types import HeightField

# Rows are y, columns x: 0 1 2 / 3 4 5 on a half-metre grid from (10, 20).
SMALL = HeightField(np.arange(6.0).reshape(2, 3), 0.5, (10.0, 20.0))


def ground(seed: int = 0, **keys: object) -> HeightField:
    return synthesise(Terrain(**keys), (0.0, 0.0), np.random.default_rng([seed, 1]))  # type: ignore[arg-type]


def test_heights_at_grid_points_between_them_and_outside() -> None:
    assert height_at(SMALL, 10.5, 20.5) == 4.0
    assert height_at(SMALL, 10.25, 20.25) == pytest.approx(2.0)  # mean of 0, 1, 3, 4
    assert height_at(SMALL, 99.0, 20.0) == 2.0
    assert height_at(SMALL, [10.0, 11.0], [[20.0], [20.5]]).tolist() == [[0.0, 2.0], [3.0, 5.0]]


def test_a_window_holds_its_limits_and_keeps_the_coordinates() -> None:
    field = ground(size_m=(12.0, 8.0), resolution_m=0.1)
    part = window(field, (-1.0, 2.0), (-9.0, 0.05))
    assert part.heights_m.shape == (41, 31)
    assert part.x_limits_m == pytest.approx((-1.0, 2.0))
    assert part.y_limits_m == pytest.approx((-4.0, 0.0))
    assert height_at(part, 0.33, -2.22) == pytest.approx(height_at(field, 0.33, -2.22))
    assert np.shares_memory(part.heights_m, field.heights_m)


def test_steepness_does_not_depend_on_how_it_is_worked_out(monkeypatch: pytest.MonkeyPatch) -> None:
    field = ground(size_m=(12.0, 8.0), resolution_m=0.1)
    whole = slope_deg(field)
    monkeypatch.setattr("worlds.heightfield._BAND_ROWS", 20)  # four bands and one row
    np.testing.assert_array_equal(slope_deg(field), whole)


def test_gradient_and_normal_of_a_plane() -> None:
    # One up per half metre along x is slope 2; three along y is slope 6.
    assert gradient_at(SMALL, 10.3, 20.1).tolist() == [2.0, 6.0]
    assert normal_at(SMALL, 10.3, 20.1) == pytest.approx(np.array([-2.0, -6.0, 1.0]) / np.sqrt(41.0))


def test_contains_counts_the_margin() -> None:
    assert contains(SMALL, [10.0, 11.0, 11.01], 20.2).tolist() == [True, True, False]
    assert contains(SMALL, [10.1, 10.25], 20.25, 0.2).tolist() == [False, True]


@given(x=st.floats(-9.0, 9.0), y=st.floats(-9.0, 9.0))
def test_gradient_is_the_slope_of_the_heights_and_the_normal_is_upright(x: float, y: float) -> None:
    field = ground(size_m=(20.0, 20.0), resolution_m=0.5)
    # Stay inside one cell: the gradient jumps between cells.
    x, y = (np.floor(value / 0.5) * 0.5 + 0.1 + 0.3 * (value / 0.5 - np.floor(value / 0.5)) for value in (x, y))
    step = 1e-4
    by_x = (height_at(field, x + step, y) - height_at(field, x - step, y)) / (2 * step)
    by_y = (height_at(field, x, y + step) - height_at(field, x, y - step)) / (2 * step)
    assert gradient_at(field, x, y) == pytest.approx([by_x, by_y], abs=1e-7)
    normal = normal_at(field, x, y)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert normal[2] > 0
    assert normal[:2] / normal[2] == pytest.approx([-by_x, -by_y], abs=1e-7)


def test_the_map_is_centred_and_as_large_as_asked() -> None:
    field = synthesise(Terrain(kind="flat", size_m=(40.0, 20.0)), (15.0, 2.0), np.random.default_rng(0))
    assert field.x_limits_m == pytest.approx((-5.0, 35.0))
    assert field.y_limits_m == pytest.approx((-8.0, 12.0))
    assert not field.heights_m.any()


@pytest.mark.parametrize("kind", ["flat", "slope", "fractal", "dunes", "crater"])
def test_a_tilt_lies_under_any_kind(kind: str) -> None:
    level = ground(kind=kind)
    tilted = ground(kind=kind, slope_deg=10.0, slope_azimuth_deg=90.0)
    rise = tilted.heights_m - level.heights_m
    assert rise[-1] - rise[0] == pytest.approx(np.tan(np.radians(10.0)) * 40.0)
    assert rise[:, -1] == pytest.approx(rise[:, 0])


def test_a_slope_is_an_even_plane_of_its_angle() -> None:
    assert slope_deg(ground(kind="slope", slope_deg=12.0, slope_azimuth_deg=33.0)) == pytest.approx(12.0)


def test_fractal_has_the_asked_rms_and_a_rover_can_drive_it() -> None:
    for seed in range(5):
        field = ground(seed, roughness_m=0.10)
        assert field.heights_m.std() == pytest.approx(0.10, rel=0.01)
        # Tilt of a 0.5 m wheelbase: it must stay far from what sand can hold.
        along = (field.heights_m[:, 6:] - field.heights_m[:, :-6]) / (6 * field.resolution_m)
        assert np.degrees(np.arctan(np.abs(along).max())) < 25.0
        assert 3.0 < slope_deg(field).mean() < 8.0


def test_fractal_waves_lie_between_the_shortest_and_the_longest() -> None:
    field = ground(roughness_m=0.10)
    power = np.abs(np.fft.fft2(field.heights_m[:-1, :-1])) ** 2
    cycles = np.fft.fftfreq(field.heights_m.shape[0] - 1, field.resolution_m)
    frequency = np.hypot(cycles[:, None], cycles[None, :])
    assert power[frequency < 1 / 15.0].sum() < 1e-6 * power.sum()
    assert power[frequency > 1 / 0.5].sum() < 1e-3 * power.sum()


def test_a_finer_grid_shows_the_same_hills() -> None:
    coarse, fine = ground(resolution_m=0.16), ground(resolution_m=0.08)
    assert np.abs(fine.heights_m[::2, ::2] - coarse.heights_m).max() < 1e-3


def test_dunes_and_crater_have_the_asked_relief() -> None:
    dunes = ground(kind="dunes", roughness_m=0.0, relief_m=0.6)
    assert np.ptp(dunes.heights_m) == pytest.approx(0.6, rel=0.01)
    assert slope_deg(dunes).max() < 30.0
    crater = ground(kind="crater", roughness_m=0.0, relief_m=0.6)
    assert np.ptp(crater.heights_m) == pytest.approx(0.6, rel=0.05)
    assert crater.heights_m.argmin() == 250 * 501 + 250
    rim = 8.0 / 2
    assert height_at(crater, rim, 0.0) > height_at(crater, rim - 0.5, 0.0)
    assert height_at(crater, rim, 0.0) > height_at(crater, rim + 0.8, 0.0)


def test_same_seed_same_ground_other_seed_other_ground() -> None:
    assert np.array_equal(ground(3).heights_m, ground(3).heights_m)
    assert not np.allclose(ground(3).heights_m, ground(4).heights_m)
