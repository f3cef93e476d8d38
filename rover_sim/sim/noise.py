"""Noise that remembers: steps of random processes that are exact for any time step."""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import TypeVar

import numpy as np

from worlds.types import FloatArray

Value = TypeVar("Value", float, FloatArray)

# Largest Allan deviation of a first-order Gauss-Markov process over its standard deviation, at 1.89 of its times
# (IEEE Std 952-1997, annex C.1.1), and that of flicker over its bias instability, sqrt(2 ln 2 / pi).
_GAUSS_MARKOV_PEAK = 0.618
_FLICKER_PLATEAU = 0.664


def white_sd(density: FloatArray, span_s: float) -> FloatArray:
    """Standard deviation of samples ``span_s`` apart of white noise of a one-sided ``density`` (per sqrt(Hz)).

    Data sheets give one-sided densities: that of the ADIS16470, 0.008 deg/s/sqrt(Hz), is sqrt(2) of its angular random
    walk of 0.34 deg/sqrt(h), which is what its Allan deviation shows at one second.
    """
    return density / sqrt(2.0 * span_s)


def instability_sd(instability: FloatArray) -> FloatArray:
    """Standard deviation of the Gauss-Markov process whose Allan deviation peaks where that of flicker lies flat."""
    return instability * (_FLICKER_PLATEAU / _GAUSS_MARKOV_PEAK)


def wander(value: Value, sd: Value, time_s: float, span_s: float, draw: Value) -> Value:
    """A first-order Gauss-Markov process of standard deviation ``sd``, ``span_s`` later; ``draw``: normal, unit."""
    kept = exp(-span_s / time_s)
    return kept * value + sqrt(1.0 - kept * kept) * sd * draw


def ring(value: FloatArray, frequency_Hz: float, damping: float, span_s: float, rng: np.random.Generator) -> FloatArray:
    """Noise of a damped oscillator (2, n), ``span_s`` later: place times angular frequency, and speed, of variance one.

    The speed has no part of frequency zero, so an acceleration made of it leads nowhere. Exact for any span.
    """
    omega, slow = 2.0 * pi * frequency_Hz, sqrt(1.0 - damping**2)
    s, c = sin(omega * slow * span_s) / slow, cos(omega * slow * span_s)
    moved = exp(-damping * omega * span_s) * np.array([[c + damping * s, s], [-s, c - damping * s]])
    # Its covariance is the unit matrix at all times, so the new part is what the old one lacks.
    (a, b), (_, d) = (np.eye(2) - moved @ moved.T).tolist()
    first = sqrt(max(a, 0.0))
    mixed = b / first if first > 0.0 else 0.0
    draws = rng.standard_normal(value.shape)
    new = np.array([[first, 0.0], [mixed, sqrt(max(d - mixed**2, 0.0))]]) @ draws
    return np.asarray(moved @ value + new)
