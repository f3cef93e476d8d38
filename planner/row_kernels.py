"""Compiled inner loops of the row search; arrays only, no decisions.

Layers lie one behind the other as (row, shift, column) in single precision, so that the innermost loop, over the
columns of one shift, is plain arithmetic on neighbouring memory that the compiler turns into vector instructions.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from worlds.types import FloatArray, IntArray

Layer = NDArray[np.float32]
INF = np.float32(np.inf)


@nb.njit(cache=True)
def free_spaces(free: FloatArray, column: int) -> IntArray:
    """Free spaces of one row by divide and conquer: (G, 2) first and last column, from right to left.

    ``free`` (columns,) is 1 or 0. The row is split at the rover's column; a part that is all free or all blocked is
    settled by its sum, any other is halved (2004 paper, section 3).
    """
    count = free.shape[0]
    sums = np.zeros(count + 1, dtype=np.int32)
    for c in range(count):
        sums[c + 1] = sums[c] + (free[c] > 0)
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
        if high <= low or total == 0:
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
def spaces_and_risk(
    clearance: Layer, hill: Layer, sub: int, need: float, column: int, beyond: int
) -> tuple[IntArray, IntArray, Layer]:
    """Free spaces of each row, padded (rows + 1, most, 2), how many there are, and the risk (rows + 1, columns).

    The risk of a space is the mean of the hilly field over it and ``beyond`` columns more on either side.
    """
    rows, columns = (clearance.shape[0] - 1) // sub + 1, clearance.shape[1]
    spaces = np.zeros((rows, columns // 2 + 2, 2), dtype=np.int32)
    counts = np.zeros(rows, dtype=np.int32)
    risk = np.zeros((rows, columns), dtype=np.float32)
    free = np.empty(columns)
    sums = np.zeros(columns + 1)
    for k in range(rows):
        for c in range(columns):
            free[c] = 1.0 if clearance[k * sub, c] >= need else 0.0
            sums[c + 1] = sums[c] + hill[k * sub, c]
        found = free_spaces(free, column)
        counts[k] = found.shape[0]
        for g in range(found.shape[0]):
            spaces[k, g] = found[g]
            low, high = max(found[g, 0] - beyond, 0), min(found[g, 1] + 1 + beyond, columns)
            risk[k, found[g, 0] : found[g, 1] + 1] = (sums[high] - sums[low]) / (high - low)
    return spaces, counts, risk


@nb.njit(cache=True)
def cell_costs(
    clearance: Layer,
    hill: Layer,
    unseen: Layer,
    rough: Layer,
    risk: Layer,
    sub: int,
    step_x: float,
    step_y: float,
    need: float,
    comfort: float,
    prices: tuple[float, ...],
) -> Layer:
    """Cost of a metre at each grid cell: one for the way and what the place adds.

    ``prices``: of the hilly field, nearness, unseen ground near and far (and how far near reaches), rough ground, the
    space's risk and a metre off the line.
    """
    hilly, near, unseen_near, unseen_far, near_m, roughness, spacious, off_line = prices
    nx, columns = clearance.shape
    cost = np.empty((nx, columns), dtype=np.float32)
    by_row = np.empty(columns, dtype=np.float32)
    for ix in range(nx):
        k = min((ix + sub // 2) // sub, unseen.shape[0] - 1)
        unseen_price = np.float32(unseen_near if k * sub * step_x < near_m else unseen_far)
        if ix == 0 or (ix + sub // 2) % sub == 0:
            for c in range(columns):
                off = np.float32(off_line * step_y * abs(c - columns // 2))
                by_row[c] = np.float32(1.0) + unseen_price * unseen[k, c] + np.float32(roughness) * rough[k, c]
                by_row[c] += np.float32(spacious) * risk[k, c] + off
        for c in range(columns):
            close = (np.float32(need + comfort) - clearance[ix, c]) * np.float32(1.0 / comfort)
            close = min(max(close, np.float32(0.0)), np.float32(1.0))
            cost[ix, c] = by_row[c] + np.float32(hilly) * hill[ix, c] + np.float32(near) * close * close
    return cost


@nb.njit(cache=True)
def edge_costs(clearance: Layer, cost: Layer, need: float, sub: int, reach: int, step_x: float, step_y: float) -> Layer:
    """Cost (rows - 1, 2 reach + 1, columns) of going from a cell of a row to one of the next; inf where not free.

    Rows lie ``sub`` grid steps apart; every grid step between is checked at the interpolated column.
    """
    rows = (clearance.shape[0] - 1) // sub
    columns = clearance.shape[1]
    costs = np.full((rows, 2 * reach + 1, columns), INF, dtype=np.float32)
    least = np.empty(columns, dtype=np.float32)
    total = np.empty(columns, dtype=np.float32)
    limit = np.float32(need)
    for k in range(rows):
        for o in range(2 * reach + 1):
            shift = o - reach
            low, high = max(0, -shift), min(columns, columns - shift)
            least[: high - low] = clearance[k * sub, low:high]
            total[:] = 0.0
            for s in range(1, sub + 1):
                left = shift * s // sub
                share = np.float32(shift * s / sub - left)
                right = left + (1 if share > 0 else 0)
                rest = np.float32(1.0) - share
                ix = k * sub + s
                near_left, near_right = (
                    clearance[ix, low + left : high + left],
                    clearance[ix, low + right : high + right],
                )
                cost_left, cost_right = cost[ix, low + left : high + left], cost[ix, low + right : high + right]
                for c in range(high - low):
                    between = rest * near_left[c] + share * near_right[c]
                    least[c] = min(least[c], between)
                    total[c] += rest * cost_left[c] + share * cost_right[c]
            scale = np.float32(np.sqrt((sub * step_x) ** 2 + (shift * step_y) ** 2) / sub)
            out = costs[k, o, low:high]
            for c in range(high - low):
                out[c] = total[c] * scale if least[c] >= limit else INF
    return costs


@nb.njit(cache=True)
def _cheapest_before(cost: Layer, o: int, turn_cost: float, most_turn: int, best: Layer) -> None:
    """``best`` (columns,): least over the shifts p near ``o`` of ``cost`` (shifts, columns) and the turn."""
    shifts = cost.shape[0]
    best[:] = cost[o]
    for p in range(max(0, o - most_turn), min(shifts, o + most_turn + 1)):
        charge = np.float32(turn_cost * abs(o - p))
        row = cost[p]
        for c in range(best.shape[0]):
            value = row[c] + charge
            best[c] = min(best[c], value)


@nb.njit(cache=True)
def search_forward(edges: Layer, column: int, first: FloatArray, turn_cost: float, most_turn: int) -> Layer:
    """Layered search from the rover's column: cheapest cost (rows + 1, shifts, columns) to each cell by last shift.

    ``first`` (shifts,) is the cost of setting out with a shift, inf where the rover cannot turn so far.
    """
    rows, shifts, columns = edges.shape
    reach = shifts // 2
    cost = np.full((rows + 1, shifts, columns), INF, dtype=np.float32)
    best = np.empty(columns, dtype=np.float32)
    for o in range(shifts):
        target = column + o - reach
        if 0 <= target < columns:
            cost[1, o, target] = np.float32(first[o]) + edges[0, o, column]
    for k in range(1, rows):
        for o in range(shifts):
            _cheapest_before(cost[k], o, turn_cost, most_turn, best)
            shift = o - reach
            low, high = max(0, -shift), min(columns, columns - shift)
            here, edge, out = best[low:high], edges[k, o, low:high], cost[k + 1, o, low + shift : high + shift]
            for c in range(high - low):
                out[c] = here[c] + edge[c]
    return cost


@nb.njit(cache=True)
def search_backward(edges: Layer, final: FloatArray, last: int, turn_cost: float, most_turn: int) -> Layer:
    """Cheapest cost (last + 1, shifts, columns) from each cell, reached by each shift, to row ``last``.

    ``final`` (columns,) is the cost beyond that row.
    """
    _, shifts, columns = edges.shape
    reach = shifts // 2
    cost = np.full((last + 1, shifts, columns), INF, dtype=np.float32)
    onward = np.empty((shifts, columns), dtype=np.float32)
    for c in range(columns):
        cost[last, :, c] = np.float32(final[c])
    for k in range(last - 1, 0, -1):
        onward[:] = INF
        for o in range(shifts):
            shift = o - reach
            low, high = max(0, -shift), min(columns, columns - shift)
            edge, beyond, out = edges[k, o, low:high], cost[k + 1, o, low + shift : high + shift], onward[o, low:high]
            for c in range(high - low):
                out[c] = edge[c] + beyond[c]
        for p in range(shifts):
            _cheapest_before(onward, p, turn_cost, most_turn, cost[k, p])
    return cost


@nb.njit(cache=True)
def ways_through(
    forward: Layer,
    backward: Layer,
    edges: Layer,
    spaces: IntArray,
    counts: IntArray,
    turn_cost: float,
    most_turn: int,
) -> tuple[IntArray, Layer]:
    """Columns (N, last + 1) and costs (N,) of the cheapest way through each free space of the row with most of them."""
    last = backward.shape[0] - 1
    row = 1 + int(np.argmax(counts[1 : last + 1]))
    columns = np.zeros((counts[row], last + 1), dtype=np.int32)
    costs = np.full(counts[row], INF, dtype=np.float32)
    found = 0
    for g in range(counts[row]):
        column, shift = -1, -1
        for o in range(forward.shape[1]):
            for c in range(spaces[row, g, 0], spaces[row, g, 1] + 1):
                value = forward[row, o, c] + backward[row, o, c]
                if value < costs[found]:
                    costs[found], column, shift = value, c, o
        if column >= 0:
            _trace(forward, backward, edges, row, column, shift, turn_cost, most_turn, columns[found])
            found += 1
    return columns[:found], costs[:found]


@nb.njit(cache=True)
def _trace(
    forward: Layer,
    backward: Layer,
    edges: Layer,
    row: int,
    column: int,
    shift: int,
    turn_cost: float,
    most_turn: int,
    way: IntArray,
) -> None:
    """Fills ``way`` (last + 1,) with the columns of the cheapest way that stands at (row, column) by ``shift``."""
    shifts = forward.shape[1]
    reach = shifts // 2
    way[row] = column
    o = shift
    for k in range(row, 0, -1):
        way[k - 1] = way[k] - (o - reach)
        if k > 1:
            best, from_ = INF, o
            for p in range(max(0, o - most_turn), min(shifts, o + most_turn + 1)):
                value = forward[k - 1, p, way[k - 1]] + np.float32(turn_cost * abs(o - p))
                if value < best:
                    best, from_ = value, p
            o = from_
    p = shift
    for k in range(row, way.shape[0] - 1):
        best, to = INF, p
        for o in range(max(0, p - most_turn), min(shifts, p + most_turn + 1)):
            target = way[k] + o - reach
            if 0 <= target < forward.shape[2]:
                value = edges[k, o, way[k]] + backward[k + 1, o, target] + np.float32(turn_cost * abs(o - p))
                if value < best:
                    best, to = value, o
        way[k + 1] = way[k] + to - reach
        p = to
