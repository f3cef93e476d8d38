"""Relief too fine for an elevation map, from the map's own spectrum: a power law, carried on below its cells.

Natural ground is about self-affine: the power of a wave of frequency f goes as f^-(2 H + 2), H the Hurst exponent
(Turcotte, Fractals and Chaos in Geology and Geophysics, 1997, chapter 7). Lengths here are in cells of the map,
frequencies in waves to a cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, pi, sqrt

import numpy as np
from scipy import fft, ndimage
from scipy.optimize import minimize

from planner.denoise import BROAD_CELLS, error_left, nearest_known
from planner.risk_prior import MapError
from planner.route_ground import ElevationMap
from worlds.types import FloatArray, Footprint

BUMPS_M = 0.01  # rms of what a wheel meets on any ground
SHORTEST_M = 0.3  # wave, shorter ones are bumps
APART_M = 0.5  # about a wheelbase: how unlike errors there are is kept
FITTED = 1.0 / 8.0, 0.5  # waves, shorter than the map's broad shape
HURST = 0.4, 2.0  # steeper than sands, and as smooth as dunes
LEAST_WAVES = 200
LIFT_SHARE = 0.6  # of the relief over a cell, that a wheelbase has; found .5 to .7 on dunes, swells and hills
LEVEL_LIFT_M = 0.0033  # on the nearly flat fields by which the belly's clearance was tuned
_PIVOT = 0.25  # frequency at which the law's power is stated
_FLATTEST = 1.0 / 32.0  # frequency below which the law does not rise
_RINGS, _DIRECTIONS, _GRID = 24, 8, 240


@dataclass(frozen=True)
class PowerLaw:
    """Spectrum of a ground."""

    power_m2: float  # times square cells, of a wave of 4 cells
    hurst: float

    def at(self, across: FloatArray, down: FloatArray) -> FloatArray:
        """Power of waves of frequencies along both axes."""
        frequency = np.maximum(np.hypot(across, down), _FLATTEST)
        return np.asarray(self.power_m2 * (frequency / _PIVOT) ** -(2.0 * self.hurst + 2.0))


def map_error(ground: ElevationMap) -> MapError:
    """How far the ground is from `planner.denoise.denoised` of a measured map, between its heights too.

    Where the law has less than `BUMPS_M` below the cells, or too little is known of the map for one, it is what
    `planner.denoise.error_left` says with these bumps.
    """
    law = power_law(ground)
    relief = 0.0 if law is None else below(law, ground.field.resolution_m)
    if law is None or relief <= BUMPS_M:
        return error_left(ground, BUMPS_M)
    sd, correlation = _error(law, _noise(ground), ground.field.resolution_m)
    return MapError(sd, correlation, BUMPS_M, relief)


def power_law(ground: ElevationMap) -> PowerLaw | None:
    """The law of the map's shorter waves; None for a map with too few of them.

    The map's heights are means over cells with white noise of the stated variance. Most likely law after Whittle,
    Arkiv foer Matematik 2, 1953: powers of single waves are exponentially distributed about the spectrum.
    """
    power, counts, frequency = _ring_powers(ground)
    if counts.sum() < LEAST_WAVES:
        return None
    turns = pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    across, down = frequency[:, None] * np.cos(turns), frequency[:, None] * np.sin(turns)
    noise = max(_noise(ground), 1e-12)

    def unlikely(law: FloatArray) -> float:
        told = _cell_means(PowerLaw(exp(law[0]), law[1]), across, down).mean(axis=1) + noise
        return float((counts * (np.log(told) + power / told)).sum() / counts.sum())

    limits = [(log(1e-10), log(1e4)), HURST]
    first = log(max(float(np.interp(_PIVOT, frequency, power)) - noise, 1e-9))
    found = minimize(unlikely, [first, 1.0], method="L-BFGS-B", bounds=limits).x
    return PowerLaw(exp(found[0]), float(found[1]))


def below(law: PowerLaw, cell_m: float) -> float:
    """Rms (m) by which the ground is off the bilinear surface through its means over cells.

    The share of a wave's variance that is lost, averaged over its phases: B its part in means, T that of means in the
    surface, 1 - 2 B T + B^2 (2 + cos 2 pi u) (2 + cos 2 pi v) / 9.
    """
    across, down, area = _waves(cell_m)
    mean, surface = _mean(across, down), _mean(across, down) ** 2
    squared = (2.0 + np.cos(2.0 * pi * across)) * (2.0 + np.cos(2.0 * pi * down)) / 9.0
    lost = 1.0 - 2.0 * mean * surface + mean**2 * squared
    return sqrt(area * float((law.at(across, down) * lost).sum()))


def under_belly(ground: ElevationMap, footprint: Footprint) -> float:
    """By how much (m) ground under the belly rises above that of the wheels, beyond `LEVEL_LIFT_M`, by a measured map.

    It is the mean, and one sigma, of the most that a spot rises while the belly passes over it.
    """
    law, cell_m = power_law(ground), ground.field.resolution_m
    relief_m = 0.0 if law is None else below(law, cell_m)
    return max(LIFT_SHARE * relief_m * footprint.wheelbase_m / cell_m - LEVEL_LIFT_M, 0.0)


def _error(law: PowerLaw, noise: float, cell_m: float) -> tuple[float, float]:
    """Spread (m) of the ground about the filtered map, and the distance (m) over which that is alike.

    Waves are filtered by W = S / (S + noise), periodic in the map's frequencies, and come back as 1 - B W T of
    themselves with the noise, and what means fold into them of shorter waves, times (W T)^2.
    """
    across, down, area = _waves(cell_m)
    near = across - np.round(across), down - np.round(down)
    means = _cell_means(law, *near)
    kept = means / (means + noise) * _mean(across, down) ** 2
    mean, own = _mean(across, down), law.at(across, down)
    folded = np.maximum(means - own * mean**2, 0.0)
    left = own * (1.0 - mean * kept) ** 2 + (noise + folded) * kept**2
    variance = area * float(left.sum())
    alike = area * float((left * np.cos(2.0 * pi * across * APART_M / cell_m)).sum()) / variance
    return sqrt(variance), APART_M / sqrt(-log(min(max(alike, 1e-6), 1.0 - 1e-6)))


def _waves(cell_m: float) -> tuple[FloatArray, FloatArray, float]:
    """Frequencies along both axes of all waves down to the shortest, a quadrant that stands for all, and their area."""
    top = max(1.0, cell_m / SHORTEST_M)
    axis = (np.arange(_GRID) + 0.5) * top / _GRID
    return axis[None, :], axis[:, None], 4.0 * (top / _GRID) ** 2


def _mean(across: FloatArray, down: FloatArray) -> FloatArray:
    """Part of a wave's amplitude that is left in means over cells."""
    return np.asarray(np.sinc(across) * np.sinc(down))


def _cell_means(law: PowerLaw, across: FloatArray, down: FloatArray) -> FloatArray:
    """Spectrum of the means over cells, shorter waves folded into the map's own."""
    shifts = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return np.asarray(
        sum(law.at(across + i, down + j) * _mean(across + i, down + j) ** 2 for i, j in shifts), dtype=np.float64
    )


def _noise(ground: ElevationMap) -> float:
    """Variance of a height."""
    known = np.isfinite(ground.field.heights_m)
    return float(ground.variance_m2[known].mean()) if known.any() else 0.0


def _ring_powers(ground: ElevationMap) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean power, count and frequency of the waves in rings; a Hann window keeps the map's edges out."""
    heights = ground.field.heights_m
    known = np.isfinite(heights)
    if not known.any():
        return np.zeros(0), np.zeros(0), np.zeros(0)
    filled = heights if known.all() else nearest_known(heights, known)
    rest = filled - ndimage.gaussian_filter(filled, BROAD_CELLS, mode="reflect")
    window = np.hanning(heights.shape[0])[:, None] * np.hanning(heights.shape[1]) * known
    power = np.abs(fft.rfft2(rest * window)) ** 2 / max(float((window**2).sum()), 1e-12)
    frequency = np.hypot(fft.fftfreq(heights.shape[0])[:, None], fft.rfftfreq(heights.shape[1]))
    fitted = (frequency >= FITTED[0]) & (frequency < FITTED[1])
    ring = ((frequency[fitted] - FITTED[0]) / (FITTED[1] - FITTED[0]) * _RINGS).astype(np.int64)
    counts = np.bincount(ring, minlength=_RINGS).astype(np.float64)
    held = counts > 0.0
    means = [np.bincount(ring, part[fitted], minlength=_RINGS)[held] / counts[held] for part in (power, frequency)]
    return means[0], counts[held], means[1]
