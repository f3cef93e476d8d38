"""An elevation map with its noise filtered out, as far as the ground's own spectrum tells the two apart."""

from __future__ import annotations

import numpy as np
from scipy import fft, ndimage

from planner.route_ground import ElevationMap, square_reach
from worlds.types import BoolArray, FloatArray, HeightField

RINGS = 400  # of wave numbers, over each of which the spectrum is averaged
BROAD_CELLS = 8.0  # ground smoother than this is left as it is


def denoised(ground: ElevationMap) -> ElevationMap:
    """The map after a Wiener filter, whose spectrum of the ground is that of the map less its stated noise.

    The noise must be white and about equal everywhere, as that of a map from orbit is to first order; the variance that
    comes back is that of white noise which would make slopes as wrong as they still are. Unknown heights stay so.
    Source: Wiener, Extrapolation, Interpolation and Smoothing of Stationary Time Series (1949), on two axes.
    """
    heights = ground.field.heights_m
    known = np.isfinite(heights)
    noise = float(ground.variance_m2[known].mean()) if known.any() else 0.0
    if noise <= 0.0:
        return ground
    filled = heights if known.all() else _nearest(heights, known)
    broad = ndimage.gaussian_filter(filled, BROAD_CELLS, mode="reflect")
    shape = tuple(2 * size for size in heights.shape)  # mirrored, so that edges do not leap
    wide = np.pad(filled - broad, [(0, size) for size in heights.shape], mode="symmetric")
    waves = fft.rfft2(wide)
    ground_power = np.maximum(_rings(np.abs(waves) ** 2 / wide.size) - noise, 0.0)
    share = ground_power / (ground_power + noise)
    clean = broad + fft.irfft2(waves * share, s=shape)[: heights.shape[0], : heights.shape[1]]
    shows = _slope_power(shape, ground.field.resolution_m)
    left = noise * float((share * shows).mean() / shows.mean())
    field = HeightField(np.where(known, clean, np.nan), ground.field.resolution_m, ground.field.origin_m)
    return ElevationMap(field, np.full(heights.shape, left))


def _nearest(heights: FloatArray, known: BoolArray) -> FloatArray:
    """The heights with unknown ones taken from the nearest known cell."""
    places = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(heights[tuple(places)])


def _wave_numbers(shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    return fft.fftfreq(shape[0])[:, None], fft.rfftfreq(shape[1])[None, :]


def _rings(power: FloatArray) -> FloatArray:
    """A spectrum (of a real transform) averaged over all directions."""
    down, across = _wave_numbers((power.shape[0], 2 * (power.shape[1] - 1)))
    ring = (RINGS * np.hypot(down, across)).astype(np.int64).ravel()
    counts = np.maximum(np.bincount(ring), 1)
    return np.asarray((np.bincount(ring, power.ravel()) / counts)[ring].reshape(power.shape))


def _slope_power(shape: tuple[int, ...], cell_m: float) -> FloatArray:
    """How strongly each wave of white noise shows in the slope of the planes of `planner.route_ground`, to a factor."""
    reach = square_reach(cell_m)
    down, across = _wave_numbers(shape)
    offsets = np.arange(1, reach + 1)
    ramp = (2.0 * offsets * np.sin(2.0 * np.pi * across[..., None] * offsets)).sum(axis=-1)
    level = 1.0 + (2.0 * np.cos(2.0 * np.pi * down[..., None] * offsets)).sum(axis=-1)
    return np.asarray((ramp * level) ** 2)
