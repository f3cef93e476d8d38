"""Synthetic ground: flat, tilted, fractal, dunes and a crater, on a grid centred between start and goal."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from worlds.heightfield import grid_points
from worlds.scenario import Terrain
from worlds.types import FloatArray, HeightField

# Longest and shortest wave: hills a rover drives over within a traverse, down to what is the rocks' part; waves near a
# wheelbase would shake the rover without end.
HILLS_M = (12.0, 0.8)
HURST = 1.0  # height spectrum ~ f^-(2 H + 2) of a self-affine surface

BAND_ROWS = 512  # of a map are worked out at a time

DUNE_STOSS_SHARE = 0.7  # of the crest distance: transverse dunes rise slowly and fall on the lee side
CRATER_RIM_SHARE = 0.2  # rim height over depth, about that of simple craters
CRATER_RIM_SHARPNESS = 30.0


def synthesise(terrain: Terrain, centre_m: tuple[float, float], rng: np.random.Generator) -> HeightField:
    """The height field of a synthetic kind, ``terrain.size_m`` large and centred on ``centre_m``.

    Sides are rounded to whole cells. The mean of the fractal part is zero; a tilt turns about the centre.
    """
    resolution = terrain.resolution_m
    nx, ny = (round(size / resolution) + 1 for size in terrain.size_m)
    origin = (centre_m[0] - (nx - 1) * resolution / 2, centre_m[1] - (ny - 1) * resolution / 2)
    field = HeightField(np.zeros((ny, nx)), resolution, origin)
    if terrain.kind in {"fractal", "dunes", "crater"}:
        field = HeightField(fractal(field, terrain.roughness_m, rng), resolution, origin)
    add_tilt(field, terrain)
    if terrain.kind == "dunes":
        field.heights_m[:] += dunes(field, terrain, rng)
    if terrain.kind == "crater":
        field.heights_m[:] += crater(field, terrain)
    return field


def add_tilt(field: HeightField, terrain: Terrain) -> None:
    """Add the plane that ``slope_deg`` and ``slope_azimuth_deg`` ask for, zero at the map's centre, to the heights."""
    if terrain.slope_deg == 0.0:
        return
    x, y = _centred(field)
    rise, azimuth = np.tan(np.radians(terrain.slope_deg)), np.radians(terrain.slope_azimuth_deg)
    for band in _bands(len(y)):
        field.heights_m[band] += rise * (x * np.cos(azimuth) + y[band] * np.sin(azimuth))


def fractal(
    field: HeightField, rms_m: float, rng: np.random.Generator, band_m: tuple[float, float] = HILLS_M
) -> FloatArray:
    """Self-affine hills (ny, nx) of zero mean and the given rms height, by spectral synthesis.

    ``band_m``: the longest and the shortest wave.

    The waves are drawn per wave number, shorter ones after longer, and not per cell, so the same generator gives the
    same hills on a finer grid. Source: Saupe, in The Science of Fractal Images (1988), chapter 2.
    """
    ny, nx = field.heights_m.shape
    periods = np.array([ny - 1, nx - 1]) * field.resolution_m
    spectrum = _waves((ny - 1, nx - 1), periods, (min(band_m[0], float(periods.max())), band_m[1]), rng)
    for first in range(0, spectrum.shape[1], BAND_ROWS):
        columns = spectrum[:, first : first + BAND_ROWS]
        columns[:] = np.fft.ifft(columns, axis=0)
    heights = np.empty((ny - 1, nx - 1))
    for band in _bands(ny - 1):
        heights[band] = np.fft.irfft(spectrum[band], n=nx - 1, axis=1)
    del spectrum  # as large as the map itself, where the waves go down to its cells
    rms = heights.std()
    heights *= rms_m / rms if rms > 0 else 0.0
    # The hills repeat with the map, so the last row and column are the first again.
    return np.asarray(np.pad(heights, ((0, 1), (0, 1)), mode="wrap"))


def _waves(
    size: tuple[int, int], periods_m: FloatArray, band_m: tuple[float, float], rng: np.random.Generator
) -> NDArray[np.complex128]:
    """Amplitudes (ny, columns) of the waves of a map of ``size`` cells in the order of a real transform.

    Only the columns that hold waves: most of the spectrum of a large map is empty. Waves that the grid cannot hold are
    drawn and left out.
    """
    top = np.ceil(periods_m / band_m[1]).astype(int)
    spectrum = np.zeros((size[0], min(top[1], size[1] // 2) + 1), dtype=np.complex128)
    wave_x = np.arange(top[1] + 1)
    held = wave_x[2 * wave_x < size[1]]
    all_y = np.arange(-top[0], top[0] + 1)
    fits = 2 * np.abs(all_y) < size[0]
    for part in (spectrum.real, spectrum.imag):
        for band in _bands(len(all_y)):
            noise = rng.standard_normal((len(all_y[band]), len(wave_x)))
            part[all_y[band][fits[band]], : len(held)] = noise[fits[band], : len(held)]
    for band in _bands(len(all_y)):
        wave_y = all_y[band][fits[band]]
        frequency = np.hypot(wave_y[:, None] / periods_m[0], held / periods_m[1])
        spectrum[wave_y, : len(held)] *= _spectrum(frequency, *band_m)
    return spectrum


def _bands(rows: int) -> Iterator[slice]:
    """Runs of rows, so that what is worked out in between needs little memory."""
    for first in range(0, rows, BAND_ROWS):
        yield slice(first, min(first + BAND_ROWS, rows))


def _spectrum(frequency: FloatArray, longest_m: float, shortest_m: float) -> FloatArray:
    """Amplitude of each wave: a power law from the longest wave down to the shortest."""
    lowest = 1.0 / longest_m
    safe = np.maximum(frequency, 1e-12)
    amplitude = safe ** -(HURST + 1.0) * (frequency >= lowest * (1 - 1e-9))
    return np.asarray(amplitude * np.exp(-((frequency * shortest_m) ** 4)))


def dunes(field: HeightField, terrain: Terrain, rng: np.random.Generator) -> FloatArray:
    """Transverse dunes (ny, nx) across x: crests ``feature_size_m`` apart and ``relief_m`` high, wavy along y."""
    x, y = _centred(field)
    phase = rng.uniform(0.0, 2 * np.pi, size=3)
    wander = np.zeros_like(y)
    for factor, turn in zip((2.0, 3.3, 5.1), phase, strict=True):
        wander = wander + np.sin(2 * np.pi * y / (factor * terrain.feature_size_m) + turn) / factor
    heights = np.empty(field.heights_m.shape)
    for band in _bands(len(y)):
        place = np.mod(x / terrain.feature_size_m + 0.35 * wander[band] + phase[0] / (2 * np.pi), 1.0)
        rise = place / DUNE_STOSS_SHARE
        fall = (1.0 - place) / (1.0 - DUNE_STOSS_SHARE)
        # Half a cosine up, half a cosine down: no kink at crest or trough.
        wave = terrain.relief_m * (1.0 - np.cos(np.pi * np.minimum(rise, fall))) / 2.0
        heights[band] = wave - terrain.relief_m / 2.0
    return heights


def crater(field: HeightField, terrain: Terrain) -> FloatArray:
    """A bowl (ny, nx) at the map's centre, ``feature_size_m`` across, ``relief_m`` deep from rim to floor."""
    x, y = _centred(field)
    if terrain.relief_m == 0.0:
        return np.zeros(field.heights_m.shape)
    heights = np.empty(field.heights_m.shape)
    for band in _bands(len(y)):
        radius = np.hypot(x, y[band]) / (terrain.feature_size_m / 2.0)
        rim = CRATER_RIM_SHARE * terrain.relief_m
        bowl = rim - terrain.relief_m * (1.0 - np.minimum(radius, 2.0) ** 2)
        # Outside, the ejecta blanket falls with the third power (McGetchin et al. 1973).
        blanket = rim * np.maximum(radius, 0.25) ** -3.0
        # A smooth minimum rounds the rim, which it lowers by 2 % of the depth.
        sharpness = CRATER_RIM_SHARPNESS / terrain.relief_m
        heights[band] = -np.logaddexp(-sharpness * bowl, -sharpness * blanket) / sharpness
    return heights


def _centred(field: HeightField) -> tuple[FloatArray, FloatArray]:
    """Coordinates (1, nx) and (ny, 1) of the grid points from the map's centre."""
    x, y = grid_points(field)
    return (x - x.mean())[None, :], (y - y.mean())[:, None]
