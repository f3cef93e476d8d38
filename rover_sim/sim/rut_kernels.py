"""Compiled reading and writing of ruts: depths below the natural ground on a fine grid of tiles.

Called from `soil_kernels`, whose stored machine code has to be renewed (save that file anew) after a change here.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.borrowed import borrowed
from worlds.types import ByteArray, IntArray

Pair = tuple[float, float]
# Which tile lies where (rows, columns), -1 for none; depths (m) of the tiles (T, 64, 64); which were changed (T,);
# how many are in use (1,); x and y of the first texel's corner; texels a metre.
Ruts = tuple[IntArray, NDArray[np.float32], ByteArray, IntArray, float, float, float]
TILE_TEXELS = 64  # a side of a tile
BERM_TEXELS = 3.0  # width of the soil that rises beside a wheel
PILED_SHARE = 0.5  # of the pressed volume that rises beside the wheel; the rest is compacted


@njit(cache=True, inline="always")
def lent(ruts: Ruts) -> Ruts:
    """The same ruts, uncounted: see `borrowed`."""
    return borrowed(ruts[0]), borrowed(ruts[1]), borrowed(ruts[2]), borrowed(ruts[3]), ruts[4], ruts[5], ruts[6]


@njit(cache=True)
def rut_depth(ruts: Ruts, x: float, y: float) -> float:
    """Depth (m) of the ground at world x, y below the natural one; negative on what was piled up."""
    directory = ruts[0]
    u, v = (x - ruts[4]) * ruts[6], (y - ruts[5]) * ruts[6]
    if u < 0.0 or v < 0.0:
        return 0.0
    i, j = int(u), int(v)
    row, column = j // TILE_TEXELS, i // TILE_TEXELS
    if row >= directory.shape[0] or column >= directory.shape[1]:
        return 0.0
    tile = directory[row, column]
    if tile < 0:
        return 0.0
    depth: float = ruts[1][tile, j % TILE_TEXELS, i % TILE_TEXELS]
    return depth


@njit(cache=True)
def coming(ruts: Ruts, foot: Pair, ahead: Pair, spans: Pair, way: Pair) -> float:
    """Depth (m) of the soil that comes under a wheel: read ahead of it, or beside where it slides.

    ``foot``: the lowest point of the rim; ``ahead``: level unit vector along the wheel; ``spans``: how far ahead its
    contact reaches and its half width; ``way``: its speeds forward and to the left.
    """
    texel = 1.0 / ruts[6]
    before = (spans[0] + texel) if way[0] >= 0.0 else -(spans[0] + texel)
    beside = (spans[1] + texel) if way[1] >= 0.0 else -(spans[1] + texel)
    front = 0.0
    for k in range(3):
        c = 0.7 * (k - 1) * spans[1]
        x, y = foot[0] + before * ahead[0] - c * ahead[1], foot[1] + before * ahead[1] + c * ahead[0]
        front += max(rut_depth(ruts, x, y), 0.0) / 3.0
    share = abs(way[1]) / max(abs(way[0]) + abs(way[1]), 1e-9)
    return (1.0 - share) * front + share * side_depth(ruts, foot, ahead, spans[0], beside)


@njit(cache=True)
def side_depth(ruts: Ruts, foot: Pair, ahead: Pair, reach: float, beside: float) -> float:
    """Mean depth (m) along a line ``beside`` a wheel, to its left where positive; not below zero on piles."""
    depth = 0.0
    for k in range(3):
        a = 0.5 * (k - 1) * reach
        x, y = foot[0] + a * ahead[0] - beside * ahead[1], foot[1] + a * ahead[1] + beside * ahead[0]
        depth += max(rut_depth(ruts, x, y), 0.0) / 3.0
    return depth


@njit(cache=True)
def _tile(ruts: Ruts, j: int, i: int) -> int:
    """Number of the tile of a texel, taken into use if need be; -1 where there is none to have."""
    directory, used = ruts[0], ruts[3]
    if i < 0 or j < 0:
        return -1
    row, column = j // TILE_TEXELS, i // TILE_TEXELS
    if row >= directory.shape[0] or column >= directory.shape[1]:
        return -1
    if directory[row, column] < 0:
        if used[0] >= ruts[1].shape[0]:
            return -1
        directory[row, column] = used[0]
        used[0] += 1
    tile: int = directory[row, column]
    ruts[2][tile] = 1
    return tile


@njit(cache=True)
def _box(ruts: Ruts, foot: Pair, ahead: Pair, length: float, width: float) -> tuple[int, int, int, int]:
    """First and past-last texel, columns then rows, around a rectangle of half ``length`` along ``ahead``."""
    dx = length * abs(ahead[0]) + width * abs(ahead[1])
    dy = length * abs(ahead[1]) + width * abs(ahead[0])
    return (
        int((foot[0] - dx - ruts[4]) * ruts[6]),
        int((foot[0] + dx - ruts[4]) * ruts[6]) + 1,
        int((foot[1] - dy - ruts[5]) * ruts[6]),
        int((foot[1] + dy - ruts[5]) * ruts[6]) + 1,
    )


@njit(cache=True)
def press_rut(ruts: Ruts, foot: Pair, ahead: Pair, rim: Pair, sinkage: float, lean: float) -> None:
    """Press the round rim of a wheel into the ground under ``foot``, and pile up half of what it pushes aside.

    ``ahead``: level unit vector along the wheel; ``rim``: radius and half width (m); ``lean``: -1 where all soil goes
    to the right, 1 to the left.
    """
    radius, half = rim
    texel = 1.0 / ruts[6]
    reach = sqrt(2.0 * radius * sinkage) + 0.5 * texel
    i0, i1, j0, j1 = _box(ruts, foot, ahead, reach, half)
    pressed = 0.0
    for j in range(j0, j1):
        dy = (j + 0.5) * texel + ruts[5] - foot[1]
        for i in range(i0, i1):
            dx = (i + 0.5) * texel + ruts[4] - foot[0]
            a, c = dx * ahead[0] + dy * ahead[1], dy * ahead[0] - dx * ahead[1]
            new = sinkage - a * a / (2.0 * radius)
            if abs(c) > half or abs(a) > reach or new <= 0.0:
                continue
            tile = _tile(ruts, j, i)
            if tile < 0:
                continue
            old = ruts[1][tile, j % TILE_TEXELS, i % TILE_TEXELS]
            if new > old:
                pressed += new - old
                ruts[1][tile, j % TILE_TEXELS, i % TILE_TEXELS] = new
    if pressed > 0.0:
        _pile(ruts, foot, ahead, (reach, half), PILED_SHARE * pressed, sinkage, lean)


@njit(cache=True)
def _pile(ruts: Ruts, foot: Pair, ahead: Pair, spans: Pair, volume: float, highest: float, lean: float) -> None:
    """Raise the soil in a bank on both sides of a wheel by ``volume`` (m a texel), at most to ``highest``."""
    reach, half = spans
    texel = 1.0 / ruts[6]
    berm = BERM_TEXELS * texel
    crest = volume / (2.0 * reach / texel * BERM_TEXELS)  # two banks, triangles across
    i0, i1, j0, j1 = _box(ruts, foot, ahead, reach, half + berm)
    for j in range(j0, j1):
        dy = (j + 0.5) * texel + ruts[5] - foot[1]
        for i in range(i0, i1):
            dx = (i + 0.5) * texel + ruts[4] - foot[0]
            a, c = dx * ahead[0] + dy * ahead[1], dy * ahead[0] - dx * ahead[1]
            beside = abs(c) - half
            if beside <= 0.0 or beside > berm or abs(a) > reach:
                continue
            tile = _tile(ruts, j, i)
            if tile < 0:
                continue
            old = ruts[1][tile, j % TILE_TEXELS, i % TILE_TEXELS]
            raised = old - crest * (1.0 - abs(2.0 * beside / berm - 1.0)) * (1.0 + (lean if c > 0.0 else -lean))
            ruts[1][tile, j % TILE_TEXELS, i % TILE_TEXELS] = max(raised, min(old, -highest))
