"""Compiled inner loops of route planning: what a step in a direction costs, and the cheapest way from everywhere.

Ground comes as layers (ny, nx): rise over run along x and along y, level of the error of both, and the care that the
ground asks for (inf where it may not be driven on). What a metre costs along and across a slope comes as tables.
"""

from __future__ import annotations

import heapq
from math import floor, hypot, sqrt

import numba as nb
import numpy as np

from worlds.types import FloatArray, IntArray

# Sixteen steps (dx, dy): the eight neighbours and the knight's moves between them, so that ways in no direction are
# more than 2.8 % longer than straight ones.
STEPS = np.array(
    [
        *((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)),
        *((2, 1), (1, 2), (-1, 2), (-2, 1), (-2, -1), (-1, -2), (1, -2), (2, -1)),
    ],
    dtype=np.int32,
)


@nb.njit(cache=True, error_model="numpy")
def _share(climb: float, lean: float, limits: FloatArray) -> float:
    """How much of what is allowed up, down and across (3,) a slope takes."""
    if climb > 0.0:
        return sqrt((climb / limits[0]) ** 2 + (lean / limits[2]) ** 2)
    return float(max(-climb / limits[1], lean / limits[2]))


@nb.njit(cache=True, error_model="numpy")
def metre_cost(
    rise_x: float,
    rise_y: float,
    level: int,
    way_x: float,
    way_y: float,
    along: FloatArray,
    across: FloatArray,
    risk: FloatArray,
    limits: FloatArray,
    holds_up: FloatArray,
    bin_: float,
) -> float:
    """Cost of a metre in the unit direction (way_x, way_y) on a slope; inf where it is too steep for that.

    ``along`` (levels, 2 n + 1) and ``across`` (levels, n + 1): factors at rises of -n..n and of 0..n bins of ``bin_``;
    ``limits`` (levels, 3): steepest rise up, down and across; ``risk`` (levels, m): what a metre costs more at the
    shares 0..m bins of ``holds_up`` (3,), the rise that holds the rover up. A rover that climbs aslant is carried off
    by all of the slope: rises up and across are then shares of one limit, added as squares.
    """
    climb, lean = rise_x * way_x + rise_y * way_y, abs(rise_x * way_y - rise_y * way_x)
    if not _share(climb, lean, limits[level]) <= 1.0:
        return np.inf
    most = risk.shape[1] - 1
    held = risk[level, min(int(_share(climb, lean, holds_up) / bin_ + 0.5), most)]
    middle = (along.shape[1] - 1) // 2
    climb, lean = climb / bin_ + middle, lean / bin_
    first = min(max(int(climb), 0), along.shape[1] - 2)
    second = min(int(lean), across.shape[1] - 2)
    f, s = climb - first, lean - second
    one = (1.0 - f) * along[level, first] + f * along[level, first + 1]
    return float(one * ((1.0 - s) * across[level, second] + s * across[level, second + 1]) + held)


@nb.njit(cache=True, error_model="numpy")
def step_prices(
    rise_x: FloatArray,
    rise_y: FloatArray,
    level: IntArray,
    care: FloatArray,
    along: FloatArray,
    across: FloatArray,
    risk: FloatArray,
    limits: FloatArray,
    holds_up: FloatArray,
    bin_: float,
) -> FloatArray:
    """Price (ny, nx, 16) of a metre in each direction of `STEPS` on each cell; inf where that may not be driven."""
    ny, nx = care.shape
    lengths = np.sqrt((STEPS**2).sum(axis=1))
    prices = np.full((ny, nx, STEPS.shape[0]), np.inf)
    for iy in range(ny):
        for ix in range(nx):
            worth = care[iy, ix]
            if not worth < np.inf:
                continue
            slope = rise_x[iy, ix], rise_y[iy, ix], level[iy, ix]
            for number in range(STEPS.shape[0]):
                x, y = STEPS[number, 0] / lengths[number], STEPS[number, 1] / lengths[number]
                price = metre_cost(slope[0], slope[1], slope[2], x, y, along, across, risk, limits, holds_up, bin_)
                prices[iy, ix, number] = worth * price
    return prices


@nb.njit(cache=True)
def _step_price(prices: FloatArray, x: int, y: int, number: int) -> float:
    """Mean price of the cells that a step from (x, y) touches: both ends, and aslant the two beside its middle."""
    dx, dy = STEPS[number, 0], STEPS[number, 1]
    ends = 0.5 * (prices[y, x, number] + prices[y + dy, x + dx, number])
    if dx == 0 or dy == 0 or not ends < np.inf:
        return float(ends)
    half_x = dx // abs(dx) if abs(dx) >= abs(dy) else 0
    half_y = dy // abs(dy) if abs(dy) > abs(dx) else 0
    beside = prices[y + half_y, x + half_x, number] + prices[y + dy - half_y, x + dx - half_x, number]
    return float(0.5 * ends + 0.25 * beside)


@nb.njit(cache=True)
def cost_to_goal(prices: FloatArray, seeds: FloatArray, cell: float) -> tuple[FloatArray, IntArray]:
    """Cost (ny, nx) of the cheapest way from each cell to a seed, and the flat index of its next cell (-1: none).

    Dijkstra's search from the seeds backwards over the edges of `STEPS`, each at the mean of `step_prices` on the
    cells that it touches, so that none of them is too steep for it. ``seeds`` (ny, nx): cost there, inf elsewhere.
    """
    ny, nx = seeds.shape
    best = np.full((ny, nx), np.inf)
    onward = np.full(ny * nx, -1, dtype=np.int32)
    closed = np.zeros(ny * nx, dtype=np.bool_)
    heap = [(0.0, 0)]
    heap.pop()
    for flat in range(ny * nx):
        value = seeds[flat // nx, flat % nx]
        if value < np.inf:
            best[flat // nx, flat % nx] = value
            heapq.heappush(heap, (value, flat))
    while len(heap) > 0:
        value, flat = heapq.heappop(heap)
        if closed[flat]:
            continue
        closed[flat] = True
        iy, ix = flat // nx, flat % nx
        for number in range(STEPS.shape[0]):
            dx, dy = STEPS[number, 0], STEPS[number, 1]
            jx, jy = ix - dx, iy - dy
            if jx < 0 or jy < 0 or jx >= nx or jy >= ny or closed[jy * nx + jx]:
                continue
            total = value + cell * hypot(dx, dy) * _step_price(prices, jx, jy, number)
            if total < best[jy, jx]:
                best[jy, jx] = total
                onward[jy * nx + jx] = flat
                heapq.heappush(heap, (total, jy * nx + jx))
    return best, onward.reshape(ny, nx)


@nb.njit(cache=True)
def line_cost(
    ax: float,
    ay: float,
    bx: float,
    by: float,
    rise_x: FloatArray,
    rise_y: FloatArray,
    level: IntArray,
    care: FloatArray,
    cell: float,
    along: FloatArray,
    across: FloatArray,
    risk: FloatArray,
    limits: FloatArray,
    holds_up: FloatArray,
    bin_: float,
) -> float:
    """Cost of a straight way from a to b, in cells (x, y): of points half a cell apart, each by its cell."""
    ny, nx = care.shape
    length = hypot(bx - ax, by - ay)
    if length == 0.0:
        return 0.0
    count = max(int(np.ceil(2.0 * length)), 1)
    total = 0.0
    for n in range(count):
        share = (n + 0.5) / count
        ix, iy = floor(ax + share * (bx - ax) + 0.5), floor(ay + share * (by - ay) + 0.5)
        ix, iy = min(max(ix, 0), nx - 1), min(max(iy, 0), ny - 1)
        if not care[iy, ix] < np.inf:
            return np.inf
        way = ((bx - ax) / length, (by - ay) / length)
        price = metre_cost(
            rise_x[iy, ix], rise_y[iy, ix], level[iy, ix], way[0], way[1], along, across, risk, limits, holds_up, bin_
        )
        total += care[iy, ix] * price
    return total * cell * length / count


@nb.njit(cache=True)
def pulled(
    way: FloatArray,
    to_go: FloatArray,
    slack: float,
    most: int,
    rise_x: FloatArray,
    rise_y: FloatArray,
    level: IntArray,
    care: FloatArray,
    cell: float,
    along: FloatArray,
    across: FloatArray,
    risk: FloatArray,
    limits: FloatArray,
    holds_up: FloatArray,
    bin_: float,
) -> IntArray:
    """Indices of the points of a way (N, 2), in cells, to keep; ``to_go`` (N,) is what is left to pay from each.

    A straight leg costs at most ``slack`` times the stretch that it replaces, which has at most ``most`` points.
    """
    count = way.shape[0]
    kept = np.zeros(count, dtype=np.int32)
    size, at = 1, 0
    while at < count - 1:
        following = at + 1
        for to in range(at + 2, min(at + most, count - 1) + 1):
            a, b = way[at], way[to]
            cost = line_cost(
                a[0], a[1], b[0], b[1], rise_x, rise_y, level, care, cell, along, across, risk, limits, holds_up, bin_
            )
            if cost <= slack * (to_go[at] - to_go[to]):
                following = to
        at = following
        kept[size] = at
        size += 1
    return kept[:size]


@nb.njit(cache=True)
def sees(heights: FloatArray, ax: float, ay: float, eye: float, bx: float, by: float, top: float) -> bool:
    """Whether a point at height ``top`` over b is seen from height ``eye`` over a, over heights (ny, nx); in cells."""
    ny, nx = heights.shape
    count = max(int(2.0 * hypot(bx - ax, by - ay)), 1)
    for n in range(1, count):
        share = n / count
        ix, iy = round(ax + share * (bx - ax)), round(ay + share * (by - ay))
        if not (0 <= ix < nx and 0 <= iy < ny):
            return False
        if heights[iy, ix] > eye + share * (top - eye):
            return False
    return True
