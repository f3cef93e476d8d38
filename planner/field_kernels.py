"""Compiled inner loops of the goal field: what a metre costs, and the cost to the goal from everywhere."""

from __future__ import annotations

from math import hypot

import numba as nb
import numpy as np

from planner.map_kernels import Layer
from worlds.types import FloatArray, IntArray

BUCKET_M = 0.05  # width of a bucket of the queue of `cost_to_go`
BUCKETS = 2400
Bounds = tuple[float, float, float]  # of `cost_to_go`: slack, share and most
NOWHERE, UNBOUNDED = (-1, -1), (np.inf, 0.0, np.inf)


@nb.njit(cache=True)
def seed_costs(
    cost: FloatArray, low: FloatArray, step: float, goal: FloatArray, within: float, beyond_price: float
) -> FloatArray:
    """Costs (nx, ny) from which the search to a goal starts, inf where it does not.

    Without a ``beyond_price`` (0) those are the distances of free cells ``within`` of the goal; with one the goal lies
    beyond the cells, and those at the border have the straight way there at that price a metre. The first cell is at
    ``low`` (2,), the goal at ``goal`` (2,).
    """
    nx, ny = cost.shape
    seeds = np.full((nx, ny), np.inf)
    beyond = beyond_price > 0.0
    for i in range(nx):
        x = low[0] + step * i - goal[0]
        if not beyond and abs(x) > within:
            continue
        inner = beyond and 0 < i < nx - 1
        for j in range(0, ny, ny - 1 if inner else 1):
            y = low[1] + step * j - goal[1]
            if cost[i, j] == np.inf or (not beyond and abs(y) > within):
                continue
            distance = hypot(x, y)
            if beyond:
                seeds[i, j] = beyond_price * distance
            elif distance <= within:
                seeds[i, j] = distance
    return seeds


@nb.njit(cache=True)
def values_at(field: FloatArray, low: FloatArray, step: float, places: FloatArray) -> FloatArray:
    """The field (nx, ny) at places (N, 2), whose first cell is at ``low`` (2,); inf outside."""
    values = np.full(len(places), np.inf)
    for n in range(len(places)):
        x, y = (places[n, 0] - low[0]) / step, (places[n, 1] - low[1]) / step
        if -0.5 <= x < field.shape[0] and -0.5 <= y < field.shape[1]:
            i, j = int(np.rint(x)), int(np.rint(y))
            if i < field.shape[0] and j < field.shape[1]:
                values[n] = field[i, j]
    return values


@nb.njit(cache=True)
def way_onward(onward: IntArray, first: tuple[int, int], step: float, most: float) -> IntArray:
    """Cells (N, 2) from the first on, each the next of the one before, until they are ``most`` metres long."""
    cells = np.empty((int(most / step) + 2, 2), dtype=np.int32)
    cells[0] = first
    count, length, (ix, iy) = 1, 0.0, first
    while length < most and onward[ix, iy] >= 0:
        to_x, to_y = onward[ix, iy] // onward.shape[1], onward[ix, iy] % onward.shape[1]
        length += step * hypot(to_x - ix, to_y - iy)
        ix, iy = to_x, to_y
        cells[count] = ix, iy
        count += 1
    return cells[:count]


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
