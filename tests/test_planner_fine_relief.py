"""Relief below a map's cells, told by the map's own spectrum, against grounds of which all of it is known."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.denoise import denoised, error_left
from planner.fine_relief import BUMPS_M, LEVEL_LIFT_M, PowerLaw, below, map_error, power_law, under_belly
from planner.risk import finer
from planner.risk_prior import MapError
from planner.route_ground import ElevationMap
from tests.planner_factory import FOOTPRINT
from worlds.heightfield import height_at
from worlds.types import FloatArray, HeightField

CELL_M, PARTS, SIDE = 1.0, 8, 96  # of the maps: cells, true heights to one, cells along a side


@cache
def ground(hurst: float, seed: int = 0, rms_m: float = 0.2) -> HeightField:
    """Self-affine hills without a shortest wave, from 16 m down, 0.125 m between heights; they repeat."""
    n = SIDE * PARTS
    frequency = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)) * PARTS / CELL_M
    amplitude = np.where(frequency >= 1.0 / 16.0, np.maximum(frequency, 1e-9) ** -(hurst + 1.0), 0.0)
    waves = np.fft.rfft2(np.random.default_rng(seed).normal(size=(n, n))) * amplitude
    heights = np.fft.irfft2(waves, s=(n, n))
    return HeightField(heights * rms_m / heights.std(), CELL_M / PARTS, (0.0, 0.0))


def measured(true: HeightField, error_m: float, seed: int = 1) -> ElevationMap:
    """Means over cells with white noise."""
    means = true.heights_m.reshape(SIDE, PARTS, SIDE, PARTS).mean(axis=(1, 3))
    middle = 0.5 * (CELL_M - CELL_M / PARTS)
    heights = means + np.random.default_rng(seed).normal(0.0, error_m, means.shape)
    return ElevationMap.of(HeightField(heights, CELL_M, (middle, middle)), error_m)


def off(true: HeightField, believed: HeightField) -> FloatArray:
    """How far the ground is from the surface through a map's heights, at a distance from its edges."""
    x, y = (true.origin_m[i] + true.resolution_m * np.arange(4 * PARTS, (SIDE - 4) * PARTS) for i in (0, 1))
    return height_at(true, x[None, :], y[:, None]) - height_at(believed, x[None, :], y[:, None])


@pytest.mark.parametrize("hurst", [0.6, 0.8, 1.0, 1.3])
def test_the_law_and_what_it_has_below_the_cells_are_those_of_the_ground(hurst: float) -> None:
    true = ground(hurst)
    exact = measured(true, 0.0)
    law = power_law(exact)
    assert law is not None
    assert law.hurst == pytest.approx(hurst, abs=0.15)
    # The law ends at 0.3 m, the ground goes on.
    assert below(law, CELL_M) == pytest.approx(off(true, exact.field).std(), rel=0.1)


@pytest.mark.parametrize(("hurst", "error_m"), [(0.8, 0.05), (1.0, 0.05), (1.0, 0.1)])
def test_noise_of_the_map_is_no_relief(hurst: float, error_m: float) -> None:
    reliefs = []
    for seed in range(4):
        law = power_law(measured(ground(hurst), error_m, seed))
        assert law is not None
        reliefs.append(below(law, CELL_M))
    assert np.mean(reliefs) == pytest.approx(off(ground(hurst), measured(ground(hurst), 0.0).field).std(), rel=0.2)


@pytest.mark.parametrize(("hurst", "error_m"), [(0.8, 0.05), (1.0, 0.1), (1.3, 0.1)])
def test_the_error_is_how_far_the_ground_is_from_the_filtered_map(hurst: float, error_m: float) -> None:
    true = ground(hurst)
    map_ = measured(true, error_m)
    error, rest = map_error(map_), off(true, denoised(map_).field)
    assert error.sd_m == pytest.approx(rest.std(), rel=0.15)
    half = round(0.5 / true.resolution_m)
    apart = np.sqrt(np.mean((rest[:, half:] - rest[:, :-half]) ** 2))
    told = error.sd_m * np.sqrt(2.0 - 2.0 * np.exp(-((0.5 / error.correlation_m) ** 2)))
    assert told == pytest.approx(apart, rel=0.15)
    assert error_left(map_).sd_m < error.sd_m


@pytest.mark.parametrize("hurst", [0.8, 1.0, 1.3])
def test_ground_rises_under_the_belly_as_the_map_tells(hurst: float) -> None:
    true, half_m, side_m = ground(hurst), 0.5 * FOOTPRINT.wheelbase_m, 0.5 * FOOTPRINT.track_m
    x, y = np.random.default_rng(0).uniform(4.0, SIDE - 4.0, (2, 5000))
    most = np.full(len(x), -np.inf)
    for ahead in np.linspace(-0.4, 0.4, 17):  # of the rover's middle, that a spot on its centre line lies
        rear, front = x - ahead - half_m, x - ahead + half_m
        z = [0.5 * sum(height_at(true, at, y + side) for side in (-side_m, side_m)) for at in (rear, front)]
        most = np.maximum(most, height_at(true, x, y) - (z[0] + z[1]) / 2.0 - ahead * (z[1] - z[0]) / (2.0 * half_m))
    told = under_belly(measured(true, 0.05), FOOTPRINT) + LEVEL_LIFT_M
    assert told == pytest.approx(most.mean(), rel=0.35)


@pytest.mark.parametrize("error_m", [0.0, 0.02, 0.1])
def test_a_smooth_map_has_bumps_and_no_relief(error_m: float) -> None:
    x = np.arange(SIDE) * CELL_M
    swell = HeightField(np.add.outer(0.2 * x, 0.3 * np.sin(x / 6.0)), CELL_M, (0.0, 0.0))
    noise = np.random.default_rng(0).normal(0.0, error_m, swell.heights_m.shape)
    map_ = ElevationMap.of(HeightField(swell.heights_m + noise, CELL_M, (0.0, 0.0)), error_m)
    assert map_error(map_) == error_left(map_, BUMPS_M)


def test_too_small_a_map_and_one_without_heights_have_bumps_and_no_relief() -> None:
    small = ElevationMap.of(HeightField(ground(1.0).heights_m[:10, :10], CELL_M, (0.0, 0.0)), 0.01)
    nothing = ElevationMap.of(HeightField(np.full((40, 40), np.nan), CELL_M, (0.0, 0.0)), 0.1)
    for map_ in (small, nothing):
        assert power_law(map_) is None
        assert map_error(map_) == error_left(map_, BUMPS_M)


def test_gaps_change_little() -> None:
    whole = measured(ground(1.0), 0.05)
    heights = whole.field.heights_m.copy()
    heights[20:30, 40:60] = np.nan
    gappy = ElevationMap(HeightField(heights, CELL_M, whole.field.origin_m), whole.variance_m2)
    assert map_error(gappy).relief_m == pytest.approx(map_error(whole).relief_m, rel=0.15)


@settings(max_examples=15, deadline=None)
@given(scale=st.floats(0.5, 4.0), shift_m=st.floats(-1e3, 1e3), seed=st.integers(0, 3))
def test_errors_grow_with_the_heights(scale: float, shift_m: float, seed: int) -> None:
    map_ = measured(ground(0.9), 0.05, seed)
    field = HeightField(scale * map_.field.heights_m + shift_m, CELL_M, map_.field.origin_m)
    one, other = map_error(map_), map_error(ElevationMap.of(field, scale * 0.05))
    assert other.sd_m == pytest.approx(scale * one.sd_m, rel=1e-2)
    assert other.relief_m == pytest.approx(scale * one.relief_m, rel=1e-2)
    assert other.correlation_m == pytest.approx(one.correlation_m, rel=1e-2)


@settings(max_examples=30, deadline=None)
@given(power=st.floats(1e-6, 1.0), hurst=st.floats(0.4, 1.1), cell_m=st.floats(0.5, 5.0))
def test_rougher_laws_have_more_below_the_cells(power: float, hurst: float, cell_m: float) -> None:
    rms = below(PowerLaw(power, hurst), cell_m)
    assert below(PowerLaw(4.0 * power, hurst), cell_m) == pytest.approx(2.0 * rms)
    assert below(PowerLaw(power, hurst + 0.1), cell_m) < rms


def test_a_finer_grid_has_the_same_surface() -> None:
    field = HeightField(np.random.default_rng(0).normal(size=(6, 5)), 0.9, (3.0, -2.0))
    fine = finer(field, 0.25)
    assert fine.resolution_m == pytest.approx(0.225)
    x, y = np.random.default_rng(1).uniform([[3.0], [-2.0]], [[6.6], [2.5]], (2, 50))
    on_lines = field.origin_m[1] + 0.225 * np.round((y + 2.0) / 0.225)
    np.testing.assert_allclose(fine.heights_m[::4, ::4], field.heights_m, atol=1e-12)
    np.testing.assert_allclose(height_at(fine, x, on_lines), height_at(field, x, on_lines), atol=1e-12)
    assert finer(field, 0.9).heights_m.shape == field.heights_m.shape


def test_relief_is_part_of_the_error_of_a_map() -> None:
    error = map_error(measured(ground(1.0), 0.1))
    assert isinstance(error, MapError)
    assert BUMPS_M < error.relief_m < error.sd_m
    assert error.roughness_m == BUMPS_M
