"""Compiled inner loops of the obstacle map: distances to rocks, the hilly field, and the cost to a goal."""

from __future__ import annotations

from math import sqrt

import numba as nb
import numpy as np
from numpy.typing import NDArray

from worlds.types import FloatArray, IntArray

Layer = NDArray[np.float32]
HILL_REACH_M = 1.0  # the kernel falls from one at a hard rock's edge to zero here
SOFT_REACH_M = 0.5  # and here for a rock that may be driven over
BUCKET_M = 0.05  # width of a bucket of the queue of `cost_to_go`
BUCKETS = 2400
Bounds = tuple[float, float, float]  # of `cost_to_go`: slack, share and most
NOWHERE, UNBOUNDED = (-1, -1), (np.inf, 0.0, np.inf)


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
def metre_costs(
    clearance: Layer,
    hill: Layer,
    unseen: Layer,
    rough: Layer,
    away: Layer,
    need: float,
    comfort: float,
    gaps: tuple[float, float, float],
    prices: tuple[float, float, tuple[float, float], float, float],
) -> tuple[FloatArray, float]:
    """Cost of a metre at each cell, inf nearer than ``need`` to a hard rock; and what one of ground unseen costs.

    ``away``: how far off each cell was seen. ``gaps``: how far off a gap must be to count as doubtful at all and
    wholly, and by how much it may then seem too narrow, all in metres. ``prices``: of the hilly field, nearness,
    unseen ground (least and most), rough ground, and a gap that seems too narrow by so much. Unseen ground is no better
    than what was seen: it costs the harmonic mean of that, blocked cells included.
    """
    hilly, near, (least, most), roughness, doubtful = prices
    near_m, far_m, most_m = gaps
    nx, ny = clearance.shape
    cost = np.empty((nx, ny))
    eased, seen = 0.0, 0
    for i in range(nx):
        for j in range(ny):
            close = min(max((need + comfort - clearance[i, j]) / comfort, 0.0), 1.0)
            value = 1.0 + hilly * hill[i, j] + near * close * close
            if clearance[i, j] < need:
                allowed = most_m * min(max((away[i, j] - near_m) / (far_m - near_m), 0.0), 1.0)
                short = need - clearance[i, j]
                value = value + doubtful * short / most_m if short < allowed else np.inf
            if unseen[i, j] <= 0.5:
                value += roughness * rough[i, j]
                eased += 1.0 / value
                seen += 1
            cost[i, j] = value
    # Where all that was seen is blocked nothing can be told, but a price without bound would end every search.
    fresh = 1.0 + least if seen == 0 else 1.0 + min(max(seen / max(eased, 1e-9) - 1.0, least), most)
    for i in range(nx):
        for j in range(ny):
            if unseen[i, j] > 0.5:
                cost[i, j] += fresh - 1.0
    return cost, fresh


@nb.njit(cache=True)
def cost_to_go(
    cost: FloatArray, seeds: FloatArray, step: float, place: tuple[int, int] = NOWHERE, bounds: Bounds = UNBOUNDED
) -> tuple[FloatArray, IntArray]:
    """Cheapest cost (nx, ny) from each cell to any seed, and the flat index of the next cell (-1 at a seed).

    ``cost`` is that of a metre, one at least, inf where blocked; ``seeds`` is the cost at the seeds, inf elsewhere.
    Label correcting over eight neighbours with a queue of buckets (Dial, CACM 12(11), 1969): a cell is taken up again
    when it is reached at less, so the answer is that of Dijkstra's search whatever the width of a bucket.

    With a ``place`` cells are taken up by the least that a way from there through them would cost (A*), and the
    search ends where that is more than from the place itself by a slack and a share of it, or more than a most, see
    ``bounds``: beyond, the answer is the cost of some way or inf.
    """
    slack, share, most = bounds
    wide = cost.shape[1] + 2
    price, best = _rimmed(cost), _rimmed(seeds)
    onward = np.full(price.size, -1, dtype=np.int32)
    first, before, after = _queue_of_seeds(best, place, wide, step)
    across, along = (-1, -1, -1, 0, 0, 1, 1, 1), (-1, 0, 1, -1, 1, -1, 0, 1)
    # A diagonal step must not squeeze between two blocked corners; a straight one starts on free ground.
    beside = (-wide, 0, -wide, 0, 0, wide, 0, wide), (-1, 0, 1, 0, 0, -1, 0, 1)
    straight, oblique = 0.5 * step, 0.5 * step * 1.4142135623730951
    length = (oblique, straight, oblique, straight, straight, oblique, straight, oblique)
    goal = (place[0] + 1) * wide + place[1] + 1
    bucket, last = price.size, price.size + _bucket(most, first)
    while bucket <= last:
        flat = after[bucket]
        if flat == bucket:  # nothing is left in it
            bucket += 1
            continue
        # Written out, as below: a helper that is handed these arrays would count references to them at each step.
        after[bucket], before[after[flat]], before[flat] = after[flat], bucket, -1
        value, own = best[flat], min(price[flat], 9.0)
        if flat == goal:
            last = price.size + _bucket(min(value * (1.0 + share) + slack, most), first)
        ix, iy = flat // wide - 1, flat % wide - 1
        for k in range(8):
            to = flat + across[k] * wide + along[k]
            total = value + length[k] * (price[to] + own)
            if total >= best[to] or price[flat + beside[0][k]] == np.inf or price[flat + beside[1][k]] == np.inf:
                continue
            best[to], onward[to] = total, flat
            if before[to] >= 0:  # it waits already, farther back
                after[before[to]], before[after[to]] = after[to], before[to]
            target = price.size + _bucket(total + _from_place(ix + across[k], iy + along[k], place, step), first)
            following = after[target]
            after[target], before[following], before[to], after[to] = to, to, target, following
    return _without_rim(best, onward, cost.shape)


@nb.njit(cache=True)
def _queue_of_seeds(best: FloatArray, place: tuple[int, int], wide: int, step: float) -> tuple[int, IntArray, IntArray]:
    """Number of the first bucket, and what is before and after each cell in its bucket, a ring that begins with it.

    The buckets follow the cells in both arrays. What waits in no bucket has nothing, -1, before it.
    """
    before = np.full(best.size + BUCKETS, -1, dtype=np.int32)
    after = np.arange(best.size + BUCKETS).astype(np.int32)
    before[best.size :] = after[best.size :]
    seeds = np.flatnonzero(best < np.inf)
    if len(seeds) == 0:
        return 0, before, after
    values = np.empty(len(seeds))
    for n in range(len(seeds)):
        flat = int(seeds[n])
        values[n] = best[flat] + _from_place(flat // wide - 1, flat % wide - 1, place, step)
    # Far goals make the least cost large: buckets begin there, as all that the last one holds is taken up in any order.
    first = int(values.min() / BUCKET_M)
    for n in range(len(seeds)):
        flat, bucket = int(seeds[n]), best.size + _bucket(values[n], first)
        following = after[bucket]
        after[bucket], before[following], before[flat], after[flat] = flat, flat, bucket, following
    return first, before, after


@nb.njit(cache=True)
def _from_place(ix: int, iy: int, place: tuple[int, int], step: float) -> float:
    """Length of the shortest way over eight neighbours from a place to a cell; 0 from nowhere."""
    if place[0] < 0:
        return 0.0
    dx, dy = abs(ix - place[0]), abs(iy - place[1])
    return step * (max(dx, dy) + 0.41421356 * min(dx, dy))


@nb.njit(cache=True)
def _rimmed(values: FloatArray) -> FloatArray:
    """``values`` (nx, ny) in a row, with a rim of inf that spares the tests for the border."""
    rimmed = np.full((values.shape[0] + 2, values.shape[1] + 2), np.inf)
    rimmed[1:-1, 1:-1] = values
    return rimmed.ravel()


@nb.njit(cache=True)
def _without_rim(best: FloatArray, onward: IntArray, shape: tuple[int, int]) -> tuple[FloatArray, IntArray]:
    """Cost (nx, ny) and flat index of the next cell, counted without the rim."""
    field, following = np.empty(shape), np.empty(shape, dtype=np.int32)
    wide = shape[1] + 2
    for ix in range(shape[0]):
        for iy in range(shape[1]):
            flat = (ix + 1) * wide + iy + 1
            to = onward[flat]
            field[ix, iy] = best[flat]
            following[ix, iy] = -1 if to < 0 else (to // wide - 1) * shape[1] + to % wide - 1
    return field, following


@nb.njit(cache=True)
def _bucket(value: float, first: int) -> int:
    return int(min(value / BUCKET_M - first, BUCKETS - 1.0))
