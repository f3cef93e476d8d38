"""Compiled inner loops of the obstacle map and of the row search; arrays only, no decisions."""

from __future__ import annotations

import heapq

import numba as nb
import numpy as np

from worlds.types import FloatArray, IntArray

HILL_REACH_M = 1.0  # the kernel falls from one at a hard rock's edge to zero here
SOFT_REACH_M = 0.5  # and here for a rock that may be driven over


@nb.njit(cache=True)
def _gap(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Distance from a point to a segment."""
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    share = 0.0
    if squared > 1e-12:
        share = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / squared))
    return float(np.hypot(ax + share * dx - x, ay + share * dy - y))


@nb.njit(cache=True)
def rasterise(
    table: FloatArray, x0: float, y0: float, step_x: float, step_y: float, clearance: FloatArray, hill: FloatArray
) -> None:
    """Lowers ``clearance`` (nx, ny) to the nearest hard obstacle and adds each weight's kernel to ``hill``."""
    nx, ny = clearance.shape
    most = clearance.max() if clearance.size else 0.0
    for n in range(table.shape[0]):
        ax, ay, bx, by, radius, weight, hard = table[n]
        reach = (max(most, HILL_REACH_M) if hard > 0.5 else SOFT_REACH_M) + max(radius, 0.0)
        fall = HILL_REACH_M if hard > 0.5 else SOFT_REACH_M
        first_x = max(0, int(np.ceil((min(ax, bx) - reach - x0) / step_x)))
        last_x = min(nx - 1, int(np.floor((max(ax, bx) + reach - x0) / step_x)))
        first_y = max(0, int(np.ceil((min(ay, by) - reach - y0) / step_y)))
        last_y = min(ny - 1, int(np.floor((max(ay, by) + reach - y0) / step_y)))
        for ix in range(first_x, last_x + 1):
            for iy in range(first_y, last_y + 1):
                edge = _gap(ax, ay, bx, by, x0 + ix * step_x, y0 + iy * step_y) - radius
                if hard > 0.5 and edge < clearance[ix, iy]:
                    clearance[ix, iy] = edge
                if edge < fall:
                    slope = 1.0 - max(edge, 0.0) / fall
                    hill[ix, iy] += weight * slope * slope


@nb.njit(cache=True)
def least_clearance(table: FloatArray, path: FloatArray, most: float) -> FloatArray:
    """Smallest distance of each path segment (N - 1,) to any obstacle's edge, at most ``most``."""
    count = path.shape[0] - 1
    clear = np.full(max(count, 0), most)
    for k in range(count):
        px, py, qx, qy = path[k, 0], path[k, 1], path[k + 1, 0], path[k + 1, 1]
        for n in range(table.shape[0]):
            ax, ay, bx, by, radius = table[n, 0], table[n, 1], table[n, 2], table[n, 3], table[n, 4]
            if crosses(ax, ay, bx, by, px, py, qx, qy):
                gap = 0.0
            else:
                ends = min(_gap(ax, ay, bx, by, px, py), _gap(ax, ay, bx, by, qx, qy))
                gap = min(ends, _gap(px, py, qx, qy, ax, ay), _gap(px, py, qx, qy, bx, by))
            clear[k] = min(clear[k], gap - radius)
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
def free_spaces(free: FloatArray, column: int) -> IntArray:
    """Free spaces of one row by divide and conquer: (G, 2) first and last column, from right to left.

    ``free`` (columns,) is 1 or 0. The row is split at the rover's column; a part that is all free or all blocked is
    settled by its sum, any other is halved (2004 paper, section 3).
    """
    count = free.shape[0]
    sums = np.zeros(count + 1)
    for c in range(count):
        sums[c + 1] = sums[c] + free[c]
    spaces = np.empty((count // 2 + 2, 2), dtype=np.int32)
    found = 0
    stack = np.empty((128, 2), dtype=np.int64)
    # The later part is pushed first, so that spaces come out in order and neighbours can be joined.
    stack[0] = column, count
    stack[1] = 0, column
    height = 2
    while height > 0:
        height -= 1
        low, high = stack[height]
        total = sums[high] - sums[low]
        if high <= low or total == 0.0:
            continue
        if total == high - low:
            if found > 0 and spaces[found - 1, 1] == low - 1:
                spaces[found - 1, 1] = high - 1
            else:
                spaces[found] = low, high - 1
                found += 1
            continue
        middle = (low + high) // 2
        stack[height] = middle, high
        stack[height + 1] = low, middle
        height += 2
    return spaces[:found]


@nb.njit(cache=True)
def edge_costs(
    clearance: FloatArray, cost: FloatArray, need: float, sub: int, reach: int, step_x: float, step_y: float
) -> FloatArray:
    """Cost (rows - 1, columns, 2 reach + 1) of going from a cell of a row to one of the next; inf where not free.

    Rows lie ``sub`` grid steps apart; every grid step between is checked at the interpolated column.
    """
    rows = (clearance.shape[0] - 1) // sub
    columns = clearance.shape[1]
    costs = np.full((rows, columns, 2 * reach + 1), np.inf)
    for k in range(rows):
        for c in range(columns):
            if clearance[k * sub, c] < need:
                continue
            for o in range(2 * reach + 1):
                shift = o - reach
                if c + shift < 0 or c + shift >= columns:
                    continue
                total, open_ = 0.0, True
                for s in range(1, sub + 1):
                    place = c + shift * s / sub
                    left = min(int(place), columns - 1)
                    right = min(left + 1, columns - 1)
                    share = place - left
                    ix = k * sub + s
                    if (1.0 - share) * clearance[ix, left] + share * clearance[ix, right] < need:
                        open_ = False
                        break
                    total += (1.0 - share) * cost[ix, left] + share * cost[ix, right]
                if open_:
                    costs[k, c, o] = total / sub * np.hypot(sub * step_x, shift * step_y)
    return costs


@nb.njit(cache=True)
def search_forward(
    edges: FloatArray, column: int, first: FloatArray, turn_cost: float, most_turn: int
) -> tuple[FloatArray, IntArray]:
    """Layered search from the rover's column: cheapest cost to each (row, column, shift) and the shift before it.

    ``first`` (shifts,) is the cost of setting out with a shift, inf where the rover cannot turn so far.
    """
    rows, columns, shifts = edges.shape
    reach = shifts // 2
    cost = np.full((rows + 1, columns, shifts), np.inf)
    before = np.full((rows + 1, columns, shifts), -1, dtype=np.int32)
    for o in range(shifts):
        target = column + o - reach
        if 0 <= target < columns:
            cost[1, target, o] = first[o] + edges[0, column, o]
    for k in range(1, rows):
        for c in range(columns):
            for o in range(shifts):
                edge = edges[k, c, o]
                if not np.isfinite(edge):
                    continue
                best, from_ = np.inf, -1
                for p in range(max(0, o - most_turn), min(shifts, o + most_turn + 1)):
                    total = cost[k, c, p] + turn_cost * abs(o - p)
                    if total < best:
                        best, from_ = total, p
                if from_ >= 0:
                    target = c + o - reach
                    cost[k + 1, target, o] = best + edge
                    before[k + 1, target, o] = from_
    return cost, before


@nb.njit(cache=True)
def search_backward(
    edges: FloatArray, final: FloatArray, last: int, turn_cost: float, most_turn: int
) -> tuple[FloatArray, IntArray]:
    """Cheapest cost from each (row, column, shift) to row ``last``, and the next shift.

    ``final`` (columns,) is the cost beyond that row.
    """
    _, columns, shifts = edges.shape
    reach = shifts // 2
    cost = np.full((last + 1, columns, shifts), np.inf)
    after = np.full((last + 1, columns, shifts), -1, dtype=np.int32)
    for c in range(columns):
        cost[last, c, :] = final[c]
    for k in range(last - 1, 0, -1):
        for c in range(columns):
            for p in range(shifts):
                for o in range(max(0, p - most_turn), min(shifts, p + most_turn + 1)):
                    target = c + o - reach
                    if target < 0 or target >= columns:
                        continue
                    total = edges[k, c, o] + turn_cost * abs(o - p) + cost[k + 1, target, o]
                    if total < cost[k, c, p]:
                        cost[k, c, p] = total
                        after[k, c, p] = o
    return cost, after


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
def cost_to_go(cost: FloatArray, seeds: FloatArray, step: float) -> tuple[FloatArray, IntArray]:
    """Cheapest cost (nx, ny) from each cell to any seed, and the flat index of the next cell (-1 at a seed).

    ``cost`` is that of a metre, inf where blocked; ``seeds`` is the cost at the seeds, inf elsewhere. Dijkstra's search
    over eight neighbours with a binary heap.
    """
    nx, ny = cost.shape
    best = seeds.copy()
    onward = np.full((nx, ny), -1, dtype=np.int32)
    heap = [(0.0, 0)]
    heap.pop()
    for flat in range(nx * ny):
        if np.isfinite(seeds[flat // ny, flat % ny]):
            heapq.heappush(heap, (seeds[flat // ny, flat % ny], flat))
    while len(heap) > 0:
        value, flat = heapq.heappop(heap)
        ix, iy = flat // ny, flat % ny
        if value > best[ix, iy]:
            continue
        for jx in range(max(ix - 1, 0), min(ix + 2, nx)):
            for jy in range(max(iy - 1, 0), min(iy + 2, ny)):
                if (jx == ix and jy == iy) or not np.isfinite(cost[jx, jy]):
                    continue
                # A diagonal step must not squeeze between two blocked corners.
                if jx != ix and jy != iy and not (np.isfinite(cost[ix, jy]) and np.isfinite(cost[jx, iy])):
                    continue
                total = value + step * np.hypot(jx - ix, jy - iy) * 0.5 * (cost[jx, jy] + min(cost[ix, iy], 9.0))
                if total < best[jx, jy]:
                    best[jx, jy] = total
                    onward[jx, jy] = flat
                    heapq.heappush(heap, (total, jx * ny + jy))
    return best, onward
