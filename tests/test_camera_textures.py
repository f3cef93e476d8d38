"""Procedural textures and their samplers."""

from __future__ import annotations

import numpy as np
import pytest

from rover_sim.sim import ground_shading as shading
from rover_sim.sim.ground_textures import GROUND_SIZE_PX, pebbles
from rover_sim.sim.renderer import make_renderer
from rover_sim.sim.texture_kernels import add_samples, level_of, sample_solid
from rover_sim.sim.textures import PADDING, Pyramid, make_pyramid, slopes_of, spectral_noise
from tests.camera_factory import field, lens, look, world
from worlds.types import BoolArray, FloatArray


def test_noise_has_unit_deviation_no_mean_and_its_band_only() -> None:
    noise = spectral_noise((128, 128), 1.0, (0.05, 0.25), 1.0, np.random.default_rng(1))
    assert noise.mean() == pytest.approx(0.0, abs=1e-12)
    assert noise.std() == pytest.approx(1.0)
    power = np.abs(np.fft.fft2(noise)) ** 2
    cycles = np.hypot(*np.meshgrid(np.fft.fftfreq(128, 1 / 128), np.fft.fftfreq(128, 1 / 128)))
    assert power[(cycles < 3.99) | (cycles > 20.01)].max() < 1e-12 * power.max()


def test_noise_repeats_with_its_generator() -> None:
    first, second = (spectral_noise((32, 32), 1.0, (0.1, 1.0), 1.0, np.random.default_rng(2)) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_slopes_of_a_wave() -> None:
    # h = a sin(2 pi x) over one metre: central differences give 2 pi a cos(2 pi x) sin(k) / k with k = 2 pi / n.
    n, a = 64, 0.01
    x = np.arange(n) / n
    height = np.broadcast_to(a * np.sin(2 * np.pi * x), (n, n))
    slope_x, slope_y = slopes_of(height, 1.0)
    k = 2 * np.pi / n
    np.testing.assert_allclose(slope_x[5], 2 * np.pi * a * np.cos(2 * np.pi * x) * np.sin(k) / k, atol=1e-12)
    np.testing.assert_allclose(slope_y, 0.0, atol=1e-12)


def test_pebbles_cover_what_they_should() -> None:
    height, share, _, _ = pebbles(0.05, np.random.default_rng(3))
    # Overlaps take a little away.
    assert 0.035 < share.mean() < 0.055
    assert 0.0 <= share.min() <= share.max() <= 1.0
    assert 0.005 < height.max() < 0.03
    bare, none, _, _ = pebbles(0.0, np.random.default_rng(3))
    assert bare.max() == none.max() == 0.0


def ramp(size: int, dimensions: int) -> FloatArray:
    """A texture whose first channel counts the texels, the others hold constants."""
    count = np.arange(float(size**dimensions)).reshape((size,) * dimensions)
    return np.stack([count, np.full_like(count, 2.0), np.full_like(count, 3.0), np.full_like(count, 4.0)], axis=-1)


def plane(pyramid: Pyramid, x_m: float, y_m: float, footprint_m: float) -> list[float]:
    """A square texture at a place, seen by a pixel as large as ``footprint_m``."""
    level, share = level_of(
        np.float32(footprint_m * pyramid.size_px * pyramid.per_m), np.float32(len(pyramid.starts) - 3)
    )
    u, v = (np.full(2, place * pyramid.per_m, dtype=np.float32) for place in (x_m, y_m))
    jobs = np.concatenate([u, v, [1 - share, share], np.zeros(2)]).astype(np.float32)
    which = np.array([level, level + 1] + [0] * 10, dtype=np.int32)
    out = np.zeros(4, dtype=np.float32)
    add_samples(2, jobs, which, 2, pyramid.data, pyramid.starts, out)
    return [float(value) for value in out]


def solid(pyramid: Pyramid, place_m: tuple[float, float, float], footprint_m: float) -> list[float]:
    """The same of a cube."""
    u, v, w = (np.float32(x * pyramid.per_m) for x in place_m)
    covered = np.float32(footprint_m * pyramid.size_px * pyramid.per_m)
    return [float(value) for value in sample_solid(pyramid.data.ctypes.data, pyramid.starts, u, v, w, covered)]


def strip(pyramid: Pyramid, ray: tuple[float, float], minor_m: float, major_m: float) -> float:
    """Mean of a square texture's first channel over the strip that a pixel covers at (0.515625, 0.5)."""
    b = np.zeros(shading.PLANES * shading.WIDEST, dtype=np.float32)
    b[[shading.RAY_X, shading.RAY_Y, shading.MINOR, shading.MAJOR]] = *ray, minor_m, major_m
    room, at, out = 2 * shading.MOST_TAPS + 2, np.zeros(1, dtype=np.int32), np.zeros(4, dtype=np.float32)
    jobs, which = np.zeros(4 * room, dtype=np.float32), np.zeros(6 * room, dtype=np.int32)
    eye = (np.float32(0.515625), np.float32(0.5), np.float32(0.0))
    per_m = np.float32(pyramid.per_m)
    shading.add_fine(1, pyramid.data, pyramid.starts, per_m, eye, b, at, jobs, which, out)
    return float(out[0])


def test_a_level_is_the_average_of_the_one_before() -> None:
    pyramid = make_pyramid(ramp(4, 2), 1.0)
    assert pyramid.starts.tolist() == [0, 4 * (4 + PADDING), 4 * (4 + PADDING) + 2 * (2 + PADDING), *[44] * 2]
    assert len(pyramid.data) == 44 + 1 + PADDING
    np.testing.assert_array_equal(pyramid.finest()[..., 0], np.arange(16.0).reshape(4, 4))
    # Top left block of 0, 1, 4, 5; then the mean of 0..15.
    assert pyramid.data[pyramid.starts[1], 0] == 2.5
    assert pyramid.data[pyramid.starts[2], 0] == 7.5


def test_texel_centres_and_halfway_between() -> None:
    pyramid = make_pyramid(ramp(4, 2), 1.0)
    # Texels are 0.25 m: centre of row 2, column 1 holds 9; its right-hand neighbour 10.
    assert plane(pyramid, 0.375, 0.625, 0.1) == pytest.approx([9, 2, 3, 4])
    assert plane(pyramid, 0.5, 0.625, 0.1)[0] == pytest.approx(9.5)
    # It repeats every metre, to both sides.
    assert plane(pyramid, 0.375 - 3.0, 0.625 + 2.0, 0.1)[0] == pytest.approx(9.0)
    # A footprint of a whole tile sees the mean.
    assert plane(pyramid, 0.1, 0.1, 50.0)[0] == pytest.approx(7.5)


def test_levels_blend_without_a_step() -> None:
    pyramid = make_pyramid(ramp(16, 2), 1.0)
    seen = [plane(pyramid, 0.03, 0.41, footprint)[0] for footprint in np.geomspace(0.05, 1.2, 600)]
    assert np.ptp(seen) > 30
    assert np.abs(np.diff(seen)).max() < 0.03 * np.ptp(seen)


def test_solid_texel_centres() -> None:
    pyramid = make_pyramid(ramp(4, 3), 1.0)
    # Layer 3, row 2, column 1 of 4 x 4 x 4: 3 * 16 + 2 * 4 + 1.
    assert solid(pyramid, (0.375, 0.625, 0.875), 0.1) == pytest.approx([57, 2, 3, 4])
    assert solid(pyramid, (0.375, 0.625, 0.75), 0.1)[0] == pytest.approx(49.0)
    assert solid(pyramid, (0.0, 0.0, 0.0), 50.0)[0] == pytest.approx(31.5)


def test_a_strip_averages_along_the_line_of_sight() -> None:
    stripes = ramp(32, 2)
    stripes[..., 0] = np.arange(32) % 2
    pyramid = make_pyramid(stripes, 1.0)
    assert strip(pyramid, (0.0, 0.0), 0.02, 0.02) == pytest.approx(0.0, abs=1e-6)
    assert strip(pyramid, (1.0, 0.0), 0.02, 0.2) == pytest.approx(0.5, abs=0.12)


def contrast(grey: FloatArray, mask: BoolArray) -> float:
    """Median co-occurrence contrast (16 levels, distance 1, two directions) of the 20 px windows inside a mask."""
    level = np.floor(grey / 16)
    found = []
    for row in range(0, grey.shape[0] - 19, 20):
        for column in range(0, grey.shape[1] - 19, 20):
            window = (slice(row, row + 20), slice(column, column + 20))
            if mask[window].all():
                w = level[window]
                found.append((np.square(np.diff(w, axis=0)).mean() + np.square(np.diff(w, axis=1)).mean()) / 2)
    return float(np.median(found))


def test_sand_is_smoother_than_pebbles_and_pebbles_than_rock() -> None:
    camera = lens(pitch_deg=35.0)
    boulders = [(x, y, 0.35, 0.3) for x in (1.3, 2.0) for y in (-1.2, -0.4, 0.4, 1.2)]
    grey, mask = {}, {}
    for name, cfa, rocks in [("sand", 0.0, []), ("pebbles", 0.1, []), ("rock", 0.0, boulders)]:
        picture = make_renderer(world(field(12.0, 0.5), rocks, cfa=cfa)).render(camera, look(camera, 0.0, 0.0, 1.1))
        grey[name] = picture.image.mean(axis=2)
        mask[name] = (picture.ids > 0) if name == "rock" else (picture.ids == 0) & (picture.depth_m < 4.0)
    sand, pebbly, rock = (contrast(grey[name], mask[name]) for name in ("sand", "pebbles", "rock"))
    assert sand > 0.1
    assert 1.2 * sand < pebbly
    assert 1.2 * pebbly < rock


def test_the_distance_does_not_glitter() -> None:
    # Against the same view at four times the resolution, averaged: as much fine detail, no more.
    renderer = make_renderer(world(field(40.0, 0.5), cfa=0.1))
    few, many = lens(), lens(1280, 960)
    pose = look(few, 0.0, 0.0, 1.1)
    coarse = renderer.render(few, pose).image.mean(axis=2)
    fine = renderer.render(many, pose).image.mean(axis=2).reshape(240, 4, 320, 4).mean(axis=(1, 3))
    for rows in (slice(22, 40), slice(40, 60), slice(60, 90)):
        detail, wanted = (float(np.diff(grey[rows], axis=1).std()) for grey in (coarse, fine))
        assert 0.4 * wanted < detail < 1.1 * wanted


def test_the_ground_does_not_repeat() -> None:
    # The fine texture has a period of 4 m; straight down, a strip 4 m further along looks different.
    camera = lens(pitch_deg=90.0)
    renderer = make_renderer(world(field(20.0, 0.5), cfa=0.05))
    here, there = (renderer.render(camera, look(camera, x, 0.0, 2.0)).image.mean(axis=2).ravel() for x in (0.0, 4.0))
    assert np.corrcoef(here, there)[0, 1] < 0.9
    assert GROUND_SIZE_PX == 1024
