"""An elevation map with its noise filtered out, as far as the ground's own spectrum tells the two apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from planner.risk_prior import MapError
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
    spectrum = _spectrum(ground)
    if spectrum is None:
        return ground
    heights, shape = ground.field.heights_m, spectrum.shape
    kept = fft.irfft2(spectrum.waves * spectrum.share, s=shape)[: heights.shape[0], : heights.shape[1]]
    shows = _slope_power(shape, ground.field.resolution_m)
    left = spectrum.noise * float((spectrum.share * shows).mean() / shows.mean())
    clean = np.where(np.isfinite(heights), spectrum.broad + kept, np.nan)
    field = HeightField(clean, ground.field.resolution_m, ground.field.origin_m)
    return ElevationMap(field, np.full(heights.shape, left), likeliest=True)


def error_left(ground: ElevationMap, roughness_m: float = 0.0) -> MapError:
    """How far `denoised` of a measured map still is from the ground: spread, and the distance of equal slope errors.

    A wave of power S under noise N is known to S N / (S + N) (Wiener). ``roughness_m`` is passed on.
    """
    spectrum = _spectrum(ground)
    if spectrum is None:
        return MapError(0.0, ground.field.resolution_m, roughness_m)
    down, across = _wave_numbers(spectrum.shape)
    twice = np.ones(spectrum.share.shape)  # a real transform holds half of the waves
    twice[:, 1:-1] = 2.0
    left = twice * spectrum.noise * spectrum.share
    waves = 2.0 * np.pi / ground.field.resolution_m * np.hypot(down, across)
    variance, count = float(left.sum()) / (twice.sum()), twice.sum()
    slopes = float((left * waves**2).sum()) / count  # along both axes together
    return MapError(float(np.sqrt(variance)), float(np.sqrt(4.0 * variance / max(slopes, 1e-12))), roughness_m)


def nearest_known(heights: FloatArray, known: BoolArray) -> FloatArray:
    """The heights (ny, nx) with unknown ones taken from the nearest known cell."""
    places = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(heights[tuple(places)])


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """A map taken apart: broad shape, waves of the rest, and which share of each wave is ground."""

    broad: FloatArray
    waves: NDArray[np.complex128]
    share: FloatArray
    shape: tuple[int, ...]
    noise: float  # variance of a height


def _spectrum(ground: ElevationMap) -> _Spectrum | None:
    """None for a map without noise."""
    heights = ground.field.heights_m
    known = np.isfinite(heights)
    noise = float(ground.variance_m2[known].mean()) if known.any() else 0.0
    if noise <= 0.0:
        return None
    filled = heights if known.all() else nearest_known(heights, known)
    broad = ndimage.gaussian_filter(filled, BROAD_CELLS, mode="reflect")
    shape = tuple(2 * size for size in heights.shape)  # mirrored, so that edges do not leap
    wide = np.pad(filled - broad, [(0, size) for size in heights.shape], mode="symmetric")
    waves = fft.rfft2(wide)
    ground_power = np.maximum(_rings(np.abs(waves) ** 2 / wide.size) - noise, 0.0)
    return _Spectrum(broad, waves, ground_power / (ground_power + noise), shape, noise)


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
