"""Compiled step of the Kalman filter of `localization`: 48 of them a second, on matrices too small for NumPy."""

from __future__ import annotations

import numpy as np
from numba import njit

from worlds.types import FloatArray

X, Y, Z, YAW, BIAS, FACTOR, SLIDE_X, SLIDE_Y, COMPASS, LEAN_X, LEAN_Y, LEVEL_X, LEVEL_Y = range(13)
STATES = 13


@njit(cache=True)
def _spread(covariance: FloatArray, transition: FloatArray, half: FloatArray) -> None:
    """What a covariance becomes when its quantities go through a linear map; ``half`` (13, 13) is scratch."""
    for i in range(STATES):
        for j in range(STATES):
            half[i, j] = 0.0
            for k in range(STATES):
                half[i, j] += transition[i, k] * covariance[k, j]
    for i in range(STATES):
        for j in range(STATES):
            covariance[i, j] = 0.0
            for k in range(STATES):
                covariance[i, j] += half[i, k] * transition[j, k]


@njit(cache=True)
def _read_heading(
    mean: FloatArray,
    covariance: FloatArray,
    carried: tuple[FloatArray, FloatArray, FloatArray],
    heading: float,
    variance: float,
    half: FloatArray,
) -> None:
    """Correct the belief by one heading, in Joseph's form, which keeps the covariance positive."""
    passed, learned, pulled = carried
    read = covariance[:, YAW] + covariance[:, COMPASS]
    spread = read[YAW] + read[COMPASS] + variance
    gain = read / spread
    off = (heading - mean[YAW] - mean[COMPASS] + np.pi) % (2.0 * np.pi) - np.pi
    for i in range(STATES):
        for j in range(STATES):
            half[i, j] = covariance[i, j] - gain[i] * (covariance[YAW, j] + covariance[COMPASS, j])
    for i in range(STATES):
        mean[i] += gain[i] * off
        told = half[i, YAW] + half[i, COMPASS]
        for j in range(STATES):
            covariance[i, j] = half[i, j] - told * gain[j] + gain[i] * variance * gain[j]
    seen = passed[YAW] + passed[COMPASS]
    for i in range(STATES):
        pulled[i] += seen[i] * off / spread
        for j in range(STATES):
            learned[i, j] += seen[i] * seen[j] / spread
            passed[i, j] -= gain[i] * seen[j]
    mean[YAW] = (mean[YAW] + np.pi) % (2.0 * np.pi) - np.pi
    mean[FACTOR] = min(max(mean[FACTOR], -0.5), 1.5)


@njit(cache=True)
def _pass(transition: FloatArray, passed: FloatArray, half: FloatArray) -> None:
    """Let ``passed`` go through one more linear map."""
    for i in range(STATES):
        for j in range(STATES):
            half[i, j] = 0.0
            for k in range(STATES):
                half[i, j] += transition[i, k] * passed[k, j]
    passed[:] = half


# Compiled at import: a rover must not stand and compile.
@njit(
    "void(f8[::1], f8[:, ::1], Tuple((f8[:, ::1], f8[:, ::1], f8[::1])), "
    "UniTuple(f8, 5), UniTuple(f8, 5), UniTuple(f8, 8))",
    cache=True,
)
def advance(
    mean: FloatArray,
    covariance: FloatArray,
    carried: tuple[FloatArray, FloatArray, FloatArray],
    motion: tuple[float, float, float, float, float],
    target: tuple[float, float, float, float, float],
    noise: tuple[float, ...],
) -> None:
    """Move the belief on by one step of the wheels and correct it by the heading read then, in place.

    ``mean`` (13,) and ``covariance`` (13, 13) as in `localization`, ``carried`` as in `localization.Carried`;
    ``motion``: seconds, way ahead by the wheels and travel of the rims (m), yaw rate (rad/s), pitch (rad); ``target``:
    the factor to which the speed factor returns, how much of the way there is left, what is kept of the slide and of
    the lean beyond what it returns to, and the heading read (rad); ``noise``: variances added to x and y, to heading,
    bias, factor, slide and lean, that of the heading read, and what is added to z.
    """
    step, way, travel, yaw_rate, pitch = motion
    usual, decay, kept, leaning, heading = target
    course = mean[YAW] + 0.5 * step * yaw_rate
    cos, sin, level, down = np.cos(course), np.sin(course), np.cos(pitch), np.sin(pitch)
    along, left = level - mean[LEAN_Y] * down, mean[LEAN_X] * down
    ahead = (cos * along - sin * left, sin * along + cos * left, -down - mean[LEAN_Y] * level)
    # What each quantity takes from another over the step, beside from itself.
    transition = np.eye(STATES)
    transition[X, YAW], transition[Y, YAW] = -mean[FACTOR] * way * ahead[1], mean[FACTOR] * way * ahead[0]
    transition[YAW, BIAS], transition[FACTOR, FACTOR] = -step, decay
    transition[X, SLIDE_X] = transition[Y, SLIDE_Y] = travel
    transition[SLIDE_X, SLIDE_X] = transition[SLIDE_Y, SLIDE_Y] = kept
    transition[LEAN_X, LEAN_X] = transition[LEAN_Y, LEAN_Y] = leaning
    transition[LEAN_X, LEVEL_X] = transition[LEAN_Y, LEVEL_Y] = 1.0 - leaning
    gone = mean[FACTOR] * way
    transition[X, LEAN_X], transition[Y, LEAN_X] = -gone * down * sin, gone * down * cos
    transition[X, LEAN_Y], transition[Y, LEAN_Y] = -gone * down * cos, -gone * down * sin
    transition[Z, LEAN_Y] = -gone * level
    mean[X] += travel * mean[SLIDE_X]
    mean[Y] += travel * mean[SLIDE_Y]
    mean[SLIDE_X] *= kept
    mean[SLIDE_Y] *= kept
    for axis in range(2):
        mean[LEAN_X + axis] = mean[LEVEL_X + axis] + leaning * (mean[LEAN_X + axis] - mean[LEVEL_X + axis])
    for axis in range(3):
        mean[axis] += gone * ahead[axis]
        transition[axis, FACTOR] = way * ahead[axis]
    mean[YAW] += step * yaw_rate
    mean[FACTOR] = usual + decay * (mean[FACTOR] - usual)
    half = np.empty((STATES, STATES))
    _spread(covariance, transition, half)
    _pass(transition, carried[0], half)
    covariance[X, X] += noise[0]
    covariance[Y, Y] += noise[0]
    covariance[Z, Z] += noise[7]
    covariance[YAW, YAW] += noise[1]
    covariance[BIAS, BIAS] += noise[2]
    covariance[FACTOR, FACTOR] += noise[3]
    for axis in range(2):
        covariance[SLIDE_X + axis, SLIDE_X + axis] += noise[4]
        covariance[LEAN_X + axis, LEAN_X + axis] += noise[5]
    _read_heading(mean, covariance, carried, heading, noise[6], half)
