"""Procedural textures of the ground and of rock, periodic, with slopes for lighting and a chain of mip levels.

All come from noise shaped in the frequency domain (Saupe, "Algorithms for random fractals", in *The Science of
Fractal Images*, 1988); slopes are the gradient of a height made the same way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from worlds.types import FloatArray

GROUND_SIZE_PX, GROUND_TILE_M = 1024, 4.0
DRIFT_SIZE_PX, DRIFT_TILE_M = 256, 23.0
ROCK_SIZE_PX, ROCK_TILE_M = 64, 0.32


class Pyramid(NamedTuple):
    """A periodic texture and its halvings down to one texel, one after another in one array."""

    data: NDArray[np.float32]  # (texels of all levels, 4)
    size_px: int  # texels a side of the first, a power of two
    per_m: float  # periods a metre


def make_pyramid(texture: FloatArray, tile_m: float) -> Pyramid:
    """Halve a square or cubic texture (N, N[, N], 4) by box averages until one texel is left."""
    levels = [texture]
    while levels[-1].shape[0] > 1:
        level = levels[-1]
        for axis in range(level.ndim - 1):
            level = (
                np.take(level, np.arange(0, level.shape[axis], 2), axis)
                + np.take(level, np.arange(1, level.shape[axis], 2), axis)
            ) / 2
        levels.append(level)
    flat = [level.reshape(-1, 4).astype(np.float32) for level in levels]
    return Pyramid(np.concatenate(flat), len(texture), 1 / tile_m)


def spectral_noise(
    shape: tuple[int, ...], tile_m: float, band_m: tuple[float, float], exponent: float, rng: np.random.Generator
) -> FloatArray:
    """Periodic noise of zero mean and unit deviation.

    ``band_m`` are the shortest and the longest wavelength in it; amplitude falls with frequency to ``-exponent``.
    """
    axes = [np.fft.fftfreq(n, 1 / n) for n in shape[:-1]] + [np.fft.rfftfreq(shape[-1], 1 / shape[-1])]
    frequency = np.sqrt(sum(np.square(c) for c in np.meshgrid(*axes, indexing="ij", sparse=True))) / tile_m
    passed = (frequency > 0) & (frequency >= 1 / band_m[1]) & (frequency <= 1 / band_m[0])
    spectrum = rng.standard_normal(frequency.shape) + 1j * rng.standard_normal(frequency.shape)
    gain = np.power(frequency, -exponent, out=np.zeros(frequency.shape), where=passed)
    noise = np.fft.irfftn(spectrum * gain, shape, axes=range(len(shape)))
    return np.asarray(noise / noise.std())


def slopes_of(height_m: FloatArray, tile_m: float) -> tuple[FloatArray, ...]:
    """Periodic central differences of a height along its axes, last axis (x) first, dimensionless."""
    step = tile_m / height_m.shape[0]
    axes = range(height_m.ndim - 1, -1, -1)
    return tuple((np.roll(height_m, -1, axis) - np.roll(height_m, 1, axis)) / (2 * step) for axis in axes)


def ground_texture(pebble_cover: float, rng: np.random.Generator) -> Pyramid:
    """Sand with pebbles on a share ``pebble_cover`` (0..0.3) of it: brightness, slope x, slope y, pebble share."""
    shape = (GROUND_SIZE_PX, GROUND_SIZE_PX)
    grain = spectral_noise(shape, GROUND_TILE_M, (0.008, 0.12), 0.6, rng)
    swell = spectral_noise(shape, GROUND_TILE_M, (0.05, 1.5), 1.8, rng)
    stain = spectral_noise(shape, GROUND_TILE_M, (0.02, 2.0), 1.2, rng)
    pebble_m, share = pebbles(pebble_cover, rng)
    height = 0.00045 * grain + 0.004 * swell + pebble_m
    slope_x, slope_y = slopes_of(height, GROUND_TILE_M)
    brightness = (
        1 + 0.026 * grain + 0.030 * stain + 0.10 * share * spectral_noise(shape, GROUND_TILE_M, (0.02, 0.2), 0.5, rng)
    )
    # Steeper than this a slope would only show the coarseness of the texels.
    return make_pyramid(
        np.stack([brightness, np.clip(slope_x, -1.2, 1.2), np.clip(slope_y, -1.2, 1.2), share], -1), GROUND_TILE_M
    )


def pebbles(cover: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Half-buried ellipsoids of 1-6 cm strewn over a ground tile: height above the sand, m, and share, both (N, N).

    Diameters follow a power law of cumulative number, exponent -2.2, the small end of the size-frequency law of
    Golombek and Rapp (J. Geophys. Res. 102, 1997, 4117) continued below what is drawn as a mesh.
    """
    n, step = GROUND_SIZE_PX, GROUND_TILE_M / GROUND_SIZE_PX
    height, share = np.zeros((n, n)), np.zeros((n, n))
    covered = 0.0
    while covered < cover * GROUND_TILE_M**2:
        # Inverse of the cumulative law between the two ends.
        diameter = (rng.uniform(0.06**-2.2, 0.010**-2.2)) ** (-1 / 2.2)
        aspect, angle = rng.uniform(0.55, 1.0), rng.uniform(0.0, np.pi)
        centre = rng.uniform(0.0, n, 2)
        reach = int(np.ceil(diameter / 2 / step)) + 1
        rows, columns = (np.arange(int(c) - reach, int(c) + reach + 1) for c in centre)
        dy, dx = (rows[:, None] + 0.5 - centre[0]) * step, (columns[None, :] + 0.5 - centre[1]) * step
        along, across = dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
        radius = np.hypot(along, across / aspect) / (diameter / 2)
        dome = diameter * rng.uniform(0.25, 0.45) * np.sqrt(np.clip(1 - radius**2, 0.0, 1.0))
        place = np.ix_(rows % n, columns % n)
        height[place] = np.maximum(height[place], dome)
        # A soft rim of one texel instead of steps.
        share[place] = np.maximum(share[place], np.clip((1 - radius) * diameter / 2 / step + 0.5, 0.0, 1.0))
        covered += np.pi / 4 * diameter**2 * aspect
    return height, share


def drift_texture(rng: np.random.Generator) -> Pyramid:
    """What breaks the ground's period: brightness, slope x, slope y, and how much of the fine texture shows."""
    shape = (DRIFT_SIZE_PX, DRIFT_SIZE_PX)
    swell = spectral_noise(shape, DRIFT_TILE_M, (0.3, 12.0), 1.8, rng)
    stain = spectral_noise(shape, DRIFT_TILE_M, (0.2, 12.0), 1.3, rng)
    patch = spectral_noise(shape, DRIFT_TILE_M, (0.6, 8.0), 1.4, rng)
    slope_x, slope_y = slopes_of(0.02 * swell, DRIFT_TILE_M)
    strength = np.clip(0.85 + 0.3 * patch, 0.3, 1.4)
    return make_pyramid(np.stack([1 + 0.035 * stain, slope_x, slope_y, strength], -1), DRIFT_TILE_M)


def rock_texture(rng: np.random.Generator) -> Pyramid:
    """Solid rock: brightness and the three slopes of a field that dents the surface; a cube, so it has no seams."""
    shape = (ROCK_SIZE_PX,) * 3
    stain = spectral_noise(shape, ROCK_TILE_M, (0.009, ROCK_TILE_M), 1.3, rng)
    dent = spectral_noise(shape, ROCK_TILE_M, (0.009, ROCK_TILE_M), 2.4, rng)
    slopes = slopes_of(dent, ROCK_TILE_M)
    strength = 0.35 / np.sqrt(np.mean([np.var(s) for s in slopes]))
    return make_pyramid(np.stack([1 + 0.10 * stain, *(strength * s for s in slopes)], -1), ROCK_TILE_M)
