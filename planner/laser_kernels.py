"""Compiled loops of the laser's map and of the way through it."""

from __future__ import annotations

import heapq
from math import hypot

import numba as nb
import numpy as np
from numpy.typing import NDArray

from worlds.types import BoolArray, FloatArray, IntArray

Layer = NDArray[np.float32]


@nb.njit(cache=True)
def take_scan(
    log_odds: Layer,
    sd: Layer,
    start: FloatArray,
    ends: FloatArray,
    least: FloatArray,
    hit: BoolArray,
    spread: FloatArray,
    gain: FloatArray,
    loss: float,
    most: float,
) -> None:
    """Mark the cells in which beams met an obstacle and free those that they passed; places are in cells.

    What is nearer than ``least`` cells stays as it is. A cell that one beam marks is not freed by another of the same
    turn, and each is changed once a turn.
    """
    nx, ny = log_odds.shape
    touched = np.zeros((nx, ny), dtype=np.bool_)
    for b in range(ends.shape[0]):
        i, j = int(np.floor(ends[b, 0])), int(np.floor(ends[b, 1]))
        if hit[b] and 0 <= i < nx and 0 <= j < ny and not touched[i, j]:
            touched[i, j] = True
            log_odds[i, j] = min(max(log_odds[i, j], 0.0) + gain[b], most)
            sd[i, j] = spread[b]
    for b in range(ends.shape[0]):
        dx, dy = ends[b, 0] - start[0], ends[b, 1] - start[1]
        length = hypot(dx, dy)
        steps = int(length - (0.7 if hit[b] else 0.0))
        for k in range(int(least[b]), steps):
            i = int(np.floor(start[0] + dx * k / length))
            j = int(np.floor(start[1] + dy * k / length))
            if i < 0 or i >= nx or j < 0 or j >= ny:
                break
            if not touched[i, j]:
                touched[i, j] = True
                log_odds[i, j] = max(log_odds[i, j] - loss, -most)


@nb.njit(cache=True)
def cheapest_way(
    cost: Layer, start: tuple[int, int], goal: tuple[float, float], radius: float, step: float
) -> tuple[IntArray, float]:
    """Cells (N, 2) of the cheapest way from ``start`` into the circle around ``goal`` or to the grid's edge; its cost.

    Empty where there is none. ``cost`` is that of a metre, at least 1 and inf where blocked; places and radius are in
    cells. A* over eight neighbours (Hart, Nilsson, Raphael 1968) with the straight distance as the least cost to go.
    """
    nx, ny = cost.shape
    best = np.full((nx, ny), np.inf)
    before = np.full((nx, ny), -1, dtype=np.int32)
    best[start] = 0.0
    heap = [(0.0, start[0] * ny + start[1])]
    while len(heap) > 0:
        estimate, flat = heapq.heappop(heap)
        ix, iy = flat // ny, flat % ny
        to_go = step * max(hypot(ix - goal[0], iy - goal[1]) - radius, 0.0)
        if estimate > best[ix, iy] + to_go + 1e-9:
            continue
        if to_go == 0.0 or ix == 0 or iy == 0 or ix == nx - 1 or iy == ny - 1:
            return _traced(before, flat, ny), best[ix, iy] + to_go
        for jx in range(ix - 1, ix + 2):
            for jy in range(iy - 1, iy + 2):
                if not np.isfinite(cost[jx, jy]) or (jx == ix and jy == iy):
                    continue
                if jx != ix and jy != iy and not (np.isfinite(cost[ix, jy]) and np.isfinite(cost[jx, iy])):
                    continue  # no squeezing between two blocked corners
                total = best[ix, iy] + step * hypot(jx - ix, jy - iy) * 0.5 * (cost[jx, jy] + cost[ix, iy])
                if total < best[jx, jy] - 1e-12:
                    best[jx, jy] = total
                    before[jx, jy] = flat
                    ahead = step * max(hypot(jx - goal[0], jy - goal[1]) - radius, 0.0)
                    heapq.heappush(heap, (total + ahead, jx * ny + jy))
    return np.zeros((0, 2), dtype=np.int32), np.inf


@nb.njit(cache=True)
def _traced(before: IntArray, flat: int, ny: int) -> IntArray:
    """Cells (N, 2) from the start to ``flat``."""
    count, at = 1, flat
    while before[at // ny, at % ny] >= 0:
        at = before[at // ny, at % ny]
        count += 1
    way = np.zeros((count, 2), dtype=np.int32)
    at = flat
    for k in range(count - 1, -1, -1):
        way[k, 0], way[k, 1] = at // ny, at % ny
        at = before[at // ny, at % ny]
    return way


@nb.njit(cache=True)
def line_cost(cost: Layer, ax: float, ay: float, bx: float, by: float, step: float) -> float:
    """Cost of a straight line between two places in cells, sampled at half cells; inf outside the grid."""
    nx, ny = cost.shape
    length = hypot(bx - ax, by - ay)
    samples = max(int(np.ceil(2.0 * length)), 1)
    total = 0.0
    for k in range(samples + 1):
        share = k / samples
        i, j = int(np.floor(ax + share * (bx - ax) + 0.5)), int(np.floor(ay + share * (by - ay) + 0.5))
        if i < 0 or j < 0 or i >= nx or j >= ny:
            return np.inf
        total += cost[i, j] * (0.5 if k in (0, samples) else 1.0)
    return total * step * length / samples


@nb.njit(cache=True)
def pull_taut(cost: Layer, way: IntArray, most_leg: float, slack: float, step: float) -> IntArray:
    """Places in ``way`` of the corners that are left when straight lines that cost hardly more replace cells."""
    count = way.shape[0]
    sums = np.zeros(count)
    for k in range(1, count):
        sums[k] = sums[k - 1] + line_cost(cost, way[k - 1, 0], way[k - 1, 1], way[k, 0], way[k, 1], step)
    kept = np.zeros(count, dtype=np.int32)
    number, at = 1, 0
    while at < count - 1:
        reach = at + 1
        for k in range(at + 2, count):
            length = step * hypot(way[k, 0] - way[at, 0], way[k, 1] - way[at, 1])
            if length > most_leg:
                break
            straight = line_cost(cost, way[at, 0], way[at, 1], way[k, 0], way[k, 1], step)
            if straight <= (1.0 + slack) * (sums[k] - sums[at]):
                reach = k
        kept[number] = reach
        number += 1
        at = reach
    return kept[:number]
