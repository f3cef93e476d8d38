"""Compiled inner loops of the room around the body."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import numba as nb
import numpy as np

from worlds.types import BoolArray, FloatArray


@nb.njit(cache=True)
def free_turns(
    local: FloatArray, half_length: float, half_width: float, step: float, slide: FloatArray
) -> tuple[float, float]:
    """How far a body can turn to the right (<= 0) and left (>= 0) without meeting obstacles (N, 7) in its frame.

    What it holds before it turns is left out. Long obstacles are sampled as three discs. ``slide`` (2,): how far the
    body moves in its first frame for each radian that it turns to either side.
    """
    held = meets(local, 0.0, half_length, half_width, 0.0, 0.0)
    right, left = -pi, pi
    for side in (-1.0, 1.0):
        for k in range(1, int(pi / step + 1e-9) + 1):
            turned = k * step
            hit = meets(local, side * turned, half_length, half_width, turned * slide[0], turned * slide[1])
            met = False
            for n in range(local.shape[0]):
                met = met or (hit[n] and not held[n])
            if met:
                if side < 0.0:
                    right = -(k - 1) * step
                else:
                    left = (k - 1) * step
                break
    return right, left


@nb.njit(cache=True)
def meets(
    local: FloatArray, angle: float, half_length: float, half_width: float, middle_x: float, middle_y: float
) -> BoolArray:
    """Which obstacles (N, 7) a rectangle around a middle meets that is turned by ``angle``."""
    c, s = cos(angle), sin(angle)
    hits = np.zeros(local.shape[0], dtype=np.bool_)
    for n in range(local.shape[0]):
        for share in (0.0, 0.5, 1.0):
            x = local[n, 0] + share * (local[n, 2] - local[n, 0]) - middle_x
            y = local[n, 1] + share * (local[n, 3] - local[n, 1]) - middle_y
            out_x = max(abs(c * x + s * y) - half_length, 0.0)
            out_y = max(abs(c * y - s * x) - half_width, 0.0)
            hits[n] = hits[n] or hypot(out_x, out_y) < local[n, 4]
    return hits


@nb.njit(cache=True)
def swept_heights(
    rocks: FloatArray, heading: float, wheels: tuple[float, float, float, float], step: float, ramp: float
) -> FloatArray:
    """Heights of rocks (N, 6) that four wheels meet in turns by 0, 1, .. steps to the right and left, (2, K).

    Rocks: middle, half axis, radius and height, around the rover; ``wheels``: half wheelbase and half track, radius
    and half width. A rock counts more and more until it has been pushed by ``ramp`` radians.
    """
    count = int(pi / step + 1e-9) + 1
    heights = np.zeros((2, count))
    for n in range(rocks.shape[0]):
        sunk = max(wheels[2] - rocks[n, 5], 0.0)
        chord = (wheels[2] ** 2 - sunk**2) ** 0.5  # of the wheel at the rock's top
        for side in range(2):
            first = count
            for k in range(count):
                angle = heading + (2 * side - 1) * k * step
                if touched(rocks[n], angle, wheels, chord):
                    first = k
                    break
            for k in range(first, count):
                heights[side, k] += rocks[n, 5] * min((k - first) * step / ramp, 1.0)
    return heights


@nb.njit(cache=True)
def touched(rock: FloatArray, heading: float, wheels: tuple[float, float, float, float], chord: float) -> bool:
    """Whether one of four wheels of a rover with that heading touches a rock (6,)."""
    c, s = cos(heading), sin(heading)
    for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
        x, y = rock[0] + share * rock[2], rock[1] + share * rock[3]
        out_x = max(abs(abs(c * x + s * y) - wheels[0]) - chord, 0.0)
        out_y = max(abs(abs(c * y - s * x) - wheels[1]) - wheels[3], 0.0)
        if hypot(out_x, out_y) < rock[4]:
            return True
    return False


@nb.njit(cache=True)
def heights_met(met: FloatArray, step: float, turns: FloatArray) -> FloatArray:
    """What turns (N,), left positive, meet, between the values (2, K) at 0, 1, .. steps to the right and left."""
    heights = np.empty(len(turns))
    last = met.shape[1] - 1
    for n in range(len(turns)):
        side, angle = met[0 if turns[n] < 0.0 else 1], abs(turns[n])
        k = min(int(angle / step), last)
        if step * k > angle:  # rounded up
            k -= 1
        elif k < last and step * (k + 1) <= angle:
            k += 1
        heights[n] = side[k]
        if k < last:
            heights[n] += (side[k + 1] - side[k]) / (step * (k + 1) - step * k) * (angle - step * k)
    return heights


@nb.njit(cache=True)
def holding(
    centre: FloatArray,
    sizes: tuple[FloatArray, FloatArray, FloatArray],
    yaw: FloatArray,
    log_odds: FloatArray,
    place: tuple[float, float],
    limits: tuple[float, float, float],
) -> FloatArray:
    """Rocks about a place as `swept_heights` takes them, (M, 6).

    ``sizes``: lengths, widths and heights of N rocks; ``limits``: how near, high and likely they must be.
    """
    length, width, height = sizes
    shape = np.empty((len(yaw), 6))
    count = 0
    for n in range(len(yaw)):
        x, y = centre[n, 0] - place[0], centre[n, 1] - place[1]
        if hypot(x, y) < limits[0] and height[n] > limits[1] and log_odds[n] > limits[2]:
            row, half = shape[count], 0.5 * max(length[n] - width[n], 0.0)
            row[0], row[1], row[2], row[3] = x, y, half * cos(yaw[n]), half * sin(yaw[n])
            row[4], row[5] = 0.5 * width[n], height[n]
            count += 1
    return shape[:count]
