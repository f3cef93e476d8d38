"""Interval arithmetic on (least, largest) for the compiled bounds of poses; angles are within a right angle."""

from __future__ import annotations

from math import asin, cos, sin

import numba as nb

Interval = tuple[float, float]


@nb.njit(cache=True)
def largest(a: Interval) -> float:
    """Largest size of a value."""
    return max(abs(a[0]), abs(a[1]))


@nb.njit(cache=True)
def plus(a: Interval, b: Interval) -> Interval:
    """Sum."""
    return a[0] + b[0], a[1] + b[1]


@nb.njit(cache=True)
def times(a: Interval, b: Interval) -> Interval:
    """Product."""
    w, x, y, z = a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]
    return min(w, x, y, z), max(w, x, y, z)


@nb.njit(cache=True)
def scaled(a: Interval, factor: float) -> Interval:
    """Product with a number."""
    return times(a, (factor, factor))


@nb.njit(cache=True)
def cut(a: Interval, b: Interval) -> Interval:
    """What lies in both; empty if the first end is above the second."""
    return max(a[0], b[0]), min(a[1], b[1])


@nb.njit(cache=True)
def sine(a: Interval) -> Interval:
    """Sine."""
    return sin(a[0]), sin(a[1])


@nb.njit(cache=True)
def cosine(a: Interval) -> Interval:
    """Cosine."""
    return cos(largest(a)), 1.0 if a[0] <= 0.0 <= a[1] else cos(min(abs(a[0]), abs(a[1])))


@nb.njit(cache=True)
def arcsine(value: float) -> float:
    """Arcsine of a number, of the nearest end beyond one."""
    return asin(max(-1.0, min(1.0, value)))
