"""Compiled inner loops of the rock memory."""

from __future__ import annotations

from math import hypot

import numba as nb
import numpy as np

from worlds.types import FloatArray, IntArray


@nb.njit(cache=True)
def associate(
    centre: FloatArray,
    covariance: FloatArray,
    length: FloatArray,
    view_centre: FloatArray,
    view_covariance: FloatArray,
    view_length: FloatArray,
    gate: float,
    slack_share: float,
    most_m: float,
) -> IntArray:
    """For each of N rocks the view that is it, or -1: nearest pairs first, by Mahalanobis distance up to ``gate``."""
    count = centre.shape[0]
    match = np.full(count, -1, dtype=np.int32)
    pairs = np.empty((count * view_centre.shape[0], 2), dtype=np.int32)
    distances = np.empty(pairs.shape[0])
    found = 0
    for n in range(count):
        for v in range(view_centre.shape[0]):
            x, y = centre[n, 0] - view_centre[v, 0], centre[n, 1] - view_centre[v, 1]
            if abs(x) > most_m or hypot(x, y) > most_m:
                continue
            # Two outlines of one rock may lie off by a share of its size.
            slack = (slack_share * max(length[n], view_length[v])) ** 2
            a = covariance[n, 0, 0] + view_covariance[v, 0, 0] + slack
            b = covariance[n, 0, 1] + view_covariance[v, 0, 1]
            d = covariance[n, 1, 1] + view_covariance[v, 1, 1] + slack
            distance = (d * x * x - 2.0 * b * x * y + a * y * y) / (a * d - b * b)
            if distance <= gate:
                pairs[found, 0], pairs[found, 1], distances[found] = n, v, distance
                found += 1
    taken = np.zeros(view_centre.shape[0], dtype=np.bool_)
    for index in np.argsort(distances[:found]):
        n, v = pairs[index]
        if match[n] < 0 and not taken[v]:
            match[n], taken[v] = v, True
    return match


@nb.njit(cache=True)
def swallowed(centre: FloatArray, length: FloatArray, width: FloatArray, height: FloatArray) -> IntArray:
    """1 for each of N rocks, widest first, that lies inside an earlier one and is hardly higher, else 0."""
    count = centre.shape[0]
    lost = np.zeros(count, dtype=np.int32)
    for n in range(count):
        for m in range(n):
            room = 0.5 * 1.15 * width[m] + 0.03 - 0.5 * length[n]
            x = abs(centre[n, 0] - centre[m, 0])
            if x < room and hypot(x, centre[n, 1] - centre[m, 1]) < room and height[n] <= 1.2 * height[m]:
                lost[n] = 1
                break
    return lost


@nb.njit(cache=True)
def touching(centre: FloatArray, radius: FloatArray, slack: float, least_m: float) -> IntArray:
    """Pairs (K, 2) of N discs nearer than ``slack`` times the sum of their radii, and together ``least_m`` wide."""
    count = centre.shape[0]
    pairs = np.empty((16, 2), dtype=np.int32)
    found = 0
    for n in range(count):
        for m in range(n):
            reach = radius[n] + radius[m]
            x = abs(centre[n, 0] - centre[m, 0])
            if x > slack * reach:
                continue
            apart = hypot(x, centre[n, 1] - centre[m, 1])
            if apart < slack * reach and apart + reach > least_m:
                if found == pairs.shape[0]:
                    pairs = np.concatenate((pairs, np.empty_like(pairs)))
                pairs[found, 0], pairs[found, 1] = n, m
                found += 1
    return pairs[:found]
