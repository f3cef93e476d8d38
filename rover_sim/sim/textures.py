"""Procedural textures, periodic, with slopes for lighting and a chain of mip levels: broad ground, rock, and tools.

All come from noise shaped in the frequency domain (Saupe, "Algorithms for random fractals", in *The Science of
Fractal Images*, 1988); slopes are the gradient of a height made the same way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from worlds.types import FloatArray, IntArray

DRIFT_SIZE_PX, DRIFT_TILE_M = 256, 23.0
ROCK_SIZE_PX, ROCK_TILE_M = 64, 0.32
PADDING = 4  # texels behind each row of a square: rows a power of two apart would share a few lines of the cache


class Pyramid(NamedTuple):
    """A periodic texture and its halvings down to one texel, one after another in one array."""

    data: NDArray[np.float32]  # (texels of all levels, 4); rows of squares are `PADDING` longer than they say
    size_px: int  # texels a side of the first, a power of two
    per_m: float  # periods a metre
    starts: IntArray  # (levels + 2,) where each level begins in ``data``, and twice more the last one

    def finest(self) -> NDArray[np.float32]:
        """The first level (N, N, 4) of a square texture."""
        rows = self.data[: self.starts[1]].reshape(self.size_px, self.size_px + PADDING, 4)
        return np.ascontiguousarray(rows[:, : self.size_px])


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
    if texture.ndim == 3:
        levels = [np.pad(level, ((0, 0), (0, PADDING), (0, 0))) for level in levels]
    flat = [level.reshape(-1, 4).astype(np.float32) for level in levels]
    starts = np.cumsum([0] + [len(level) for level in flat[:-1]])
    return Pyramid(np.concatenate(flat), len(texture), 1 / tile_m, np.append(starts, [starts[-1]] * 2).astype(np.int32))


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
