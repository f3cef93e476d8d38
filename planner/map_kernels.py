"""Compiled inner loops of the obstacle map: distances to rocks and the hilly field."""

from __future__ import annotations

from math import sqrt

import numba as nb
import numpy as np
from numpy.typing import NDArray

from worlds.types import FloatArray, IntArray

Layer = NDArray[np.float32]
HILL_REACH_M = 1.0  # the kernel falls from one at a hard rock's edge to zero here
SOFT_REACH_M = 0.5  # and here for a rock that may be driven over


@nb.njit(cache=True)
def gap(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Distance from a point to a segment."""
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    share = 0.0
    if squared > 1e-12:
        share = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / squared))
    ex, ey = ax + share * dx - x, ay + share * dy - y
    return sqrt(ex * ex + ey * ey)


@nb.njit(cache=True)
def rasterise(
    table: FloatArray, x0: float, y0: float, step_x: float, step_y: float, most: float, clearance: Layer, hill: Layer
) -> None:
    """Lowers ``clearance`` (nx, ny) to the nearest hard obstacle and adds each weight's kernel to ``hill``."""
    nx, ny = clearance.shape
    for n in range(table.shape[0]):
        ax, ay, bx, by, radius, weight, hard = table[n]
        solid = hard > 0.5
        fall = HILL_REACH_M if solid else SOFT_REACH_M
        reach = (max(most, HILL_REACH_M) if solid else SOFT_REACH_M) + max(radius, 0.0)
        first_x = max(0, int(np.ceil((min(ax, bx) - reach - x0) / step_x)))
        last_x = min(nx - 1, int(np.floor((max(ax, bx) + reach - x0) / step_x)))
        dx, dy = bx - ax, by - ay
        squared = dx * dx + dy * dy
        scale = 1.0 / squared if squared > 1e-12 else 0.0
        for ix in range(first_x, last_x + 1):
            x = x0 + ix * step_x
            out = max(min(ax, bx) - x, x - max(ax, bx), 0.0)
            side = sqrt(max(reach * reach - out * out, 0.0))
            first_y = max(0, int(np.ceil((min(ay, by) - side - y0) / step_y)))
            last_y = min(ny - 1, int(np.floor((max(ay, by) + side - y0) / step_y)))
            if last_y < first_y:
                continue
            near, high = clearance[ix, first_y : last_y + 1], hill[ix, first_y : last_y + 1]
            y_first = y0 + first_y * step_y
            for iy in range(last_y + 1 - first_y):
                y = y_first + iy * step_y
                share = ((x - ax) * dx + (y - ay) * dy) * scale
                share = min(1.0, max(0.0, share))
                ex, ey = ax + share * dx - x, ay + share * dy - y
                edge = sqrt(ex * ex + ey * ey) - radius
                slope = 1.0 - max(edge, 0.0) / fall
                slope = max(slope, 0.0)
                high[iy] += np.float32(weight * slope * slope)
                if solid:
                    near[iy] = min(near[iy], np.float32(edge))


@nb.njit(cache=True)
def at_places(table: FloatArray, places: FloatArray, most: float) -> tuple[Layer, Layer]:
    """Clearance (N,), at most ``most``, and hilly field (N,) at places (N, 2): what `rasterise` has for its cells."""
    clearance, hill = np.full(len(places), np.float32(most)), np.zeros(len(places), dtype=np.float32)
    for n in range(table.shape[0]):
        ax, ay, bx, by, radius, weight, hard = table[n]
        fall = HILL_REACH_M if hard > 0.5 else SOFT_REACH_M
        reach = max(radius, 0.0) + (max(most, fall) if hard > 0.5 else fall)
        for k in range(len(places)):
            x, y = places[k, 0], places[k, 1]
            if max(min(ax, bx) - x, x - max(ax, bx), min(ay, by) - y, y - max(ay, by)) > reach:
                continue
            edge = gap(ax, ay, bx, by, x, y) - radius
            slope = max(1.0 - max(edge, 0.0) / fall, 0.0)
            hill[k] += np.float32(weight * slope * slope)
            if hard > 0.5:
                clearance[k] = min(clearance[k], np.float32(edge))
    return clearance, hill


@nb.njit(cache=True)
def densely(path: FloatArray, spacing: float) -> FloatArray:
    """The path (N, 2), N >= 1, with points at most ``spacing`` apart."""
    steps = path[1:] - path[:-1]
    counts = np.maximum(1.0, np.ceil(np.sqrt(steps[:, 0] ** 2 + steps[:, 1] ** 2) / spacing))
    points = np.empty((int(counts.sum()) + 1, 2))
    at = 0
    for n in range(len(steps)):
        for k in range(int(counts[n])):
            points[at] = path[n] + steps[n] * (k / counts[n])
            at += 1
    points[at] = path[-1]
    return points


@nb.njit(cache=True)
def least_clearance(table: FloatArray, path: FloatArray, most: float) -> FloatArray:
    """Smallest distance of each path segment (N - 1,) to any obstacle's edge, at most ``most``."""
    count = path.shape[0] - 1
    clear = np.full(max(count, 0), most)
    for k in range(count):
        px, py, qx, qy = path[k, 0], path[k, 1], path[k + 1, 0], path[k + 1, 1]
        low_x, high_x, low_y, high_y = min(px, qx), max(px, qx), min(py, qy), max(py, qy)
        for n in range(table.shape[0]):
            ax, ay, bx, by, radius = table[n, 0], table[n, 1], table[n, 2], table[n, 3], table[n, 4]
            # Boxes that lie farther apart than what is known already need no closer look.
            far = clear[k] + radius
            if min(ax, bx) - high_x > far or low_x - max(ax, bx) > far:
                continue
            if min(ay, by) - high_y > far or low_y - max(ay, by) > far:
                continue
            if crosses(ax, ay, bx, by, px, py, qx, qy):
                apart = 0.0
            else:
                ends = min(gap(ax, ay, bx, by, px, py), gap(ax, ay, bx, by, qx, qy))
                apart = min(ends, gap(px, py, qx, qy, ax, ay), gap(px, py, qx, qy, bx, by))
            clear[k] = min(clear[k], apart - radius)
    return clear


@nb.njit(cache=True)
def crosses(ax: float, ay: float, bx: float, by: float, px: float, py: float, qx: float, qy: float) -> bool:
    """Whether two segments cross."""
    one = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    two = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    three = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    four = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return one * two < 0.0 and three * four < 0.0


@nb.njit(cache=True)
def simplify(table: FloatArray, path: FloatArray, need: float, comfort: float, most_leg: float) -> IntArray:
    """Indices of the points of a path (N, 2) to keep: each leg is as long as it may be.

    A leg is at most ``most_leg`` long and keeps ``need + comfort`` from the hard obstacles of ``table``, or what the
    stretch that it replaces kept.
    """
    count = path.shape[0]
    own = least_clearance(table, path, need + comfort)
    kept = np.zeros(count, dtype=np.int32)
    size, at = 1, 0
    leg = np.empty((2, 2))
    while at < count - 1:
        following = at + 1
        for to in range(count - 1, at + 1, -1):
            if np.hypot(path[to, 0] - path[at, 0], path[to, 1] - path[at, 1]) > most_leg:
                continue
            leg[0], leg[1] = path[at], path[to]
            if least_clearance(table, leg, need + comfort)[0] >= own[at:to].min() - 0.02:
                following = to
                break
        at = following
        kept[size] = at
        size += 1
    return kept[:size]


@nb.njit(cache=True)
def bring_in(table: FloatArray, x: float, y: float, heading: float, reach: float, need: float) -> FloatArray:
    """The obstacles within ``reach`` of a place, in its frame; berths that hold the place let it leave."""
    sin, cos = np.sin(heading), np.cos(heading)
    near = np.empty_like(table)
    count = 0
    for n in range(table.shape[0]):
        mx, my = 0.5 * (table[n, 0] + table[n, 2]) - x, 0.5 * (table[n, 1] + table[n, 3]) - y
        if mx * mx + my * my >= reach * reach:
            continue
        row = near[count]
        for end in (0, 2):
            dx, dy = table[n, end] - x, table[n, end + 1] - y
            row[end], row[end + 1] = dx * cos + dy * sin, dy * cos - dx * sin
        row[4:] = table[n, 4:]
        if row[6] > 0.5:
            row[4] -= max(need + 0.03 - (gap(row[0], row[1], row[2], row[3], 0.0, 0.0) - row[4]), 0.0)
        count += 1
    return near[:count]


@nb.njit(cache=True)
def within(table: FloatArray, x: float, y: float, reach: float) -> FloatArray:
    """The obstacles whose middle lies within ``reach`` of a place."""
    near = np.empty_like(table)
    count = 0
    for n in range(table.shape[0]):
        mx, my = 0.5 * (table[n, 0] + table[n, 2]) - x, 0.5 * (table[n, 1] + table[n, 3]) - y
        if mx * mx + my * my < reach * reach:
            near[count] = table[n]
            count += 1
    return near[:count]


@nb.njit(cache=True)
def narrowed(table: FloatArray, x: float, y: float, need: float) -> FloatArray:
    """The obstacles, the radius of hard ones less what is short of ``need`` at a place."""
    freed = table.copy()
    for n in range(table.shape[0]):
        if table[n, 6] > 0.5:
            away = gap(table[n, 0], table[n, 1], table[n, 2], table[n, 3], x, y) - table[n, 4]
            freed[n, 4] -= max(need - away, 0.0)
    return freed
