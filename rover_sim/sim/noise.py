"""Noise that remembers: steps of random processes that are exact for any time step."""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from worlds.types import FloatArray

ComplexArray = NDArray[np.complex128]
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


def ring(
    value: ComplexArray, frequency_Hz: float, damping: float, span_s: float, rng: np.random.Generator
) -> ComplexArray:
    """Complex noise (n,) around a frequency, ``span_s`` later; its real part is of variance one.

    ``damping``: half of the band's width over its frequency.
    """
    omega = 2.0 * pi * frequency_Hz
    kept = np.exp(complex(-damping * omega, omega) * span_s)
    draws = rng.standard_normal((2, len(value)))
    return np.asarray(kept * value + sqrt(max(1.0 - abs(kept) ** 2, 0.0)) * (draws[0] + 1j * draws[1]))
