"""How many rocks of which diameter lie where: the size-frequency law of Golombek and placement without overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from worlds.errors import ScenarioError
from worlds.types import BoolArray, FloatArray

Indices = NDArray[np.int64]

_MAX_ROUNDS = 300
_TABLE_POINTS = 4096


def decay_per_m(cfa: float) -> float:
    """q(k) = 1.79 + 0.152/k in 1/m (Golombek and Rapp, J. Geophys. Res. 102, 1997)."""
    return 1.79 + 0.152 / cfa


def area_fraction(cfa: float, diameter_m: ArrayLike) -> FloatArray:
    """F_k(D) = k exp(-q D): share of the ground under rocks of at least that diameter (Golombek and Rapp 1997)."""
    return np.asarray(cfa * np.exp(-decay_per_m(cfa) * np.asarray(diameter_m, dtype=np.float64)))


def number_density(cfa: float, diameter_m: ArrayLike) -> FloatArray:
    """Rocks per square metre and metre of diameter, n(D) = k q exp(-q D) / (pi D^2 / 4), from dF/dD."""
    diameter = np.asarray(diameter_m, dtype=np.float64)
    q = decay_per_m(cfa)
    return np.asarray(cfa * q * np.exp(-q * diameter) / (np.pi * diameter**2 / 4.0))


def expected_number(cfa: float, min_diameter_m: float, max_diameter_m: float, area_m2: float) -> float:
    """Mean number of rocks between two diameters on an area."""
    return float(_cumulative(cfa, min_diameter_m, max_diameter_m)[1][-1] * area_m2) if cfa > 0 else 0.0


def sample_diameters(
    cfa: float, min_diameter_m: float, max_diameter_m: float, area_m2: float, rng: np.random.Generator
) -> FloatArray:
    """Diameters (N,) in metres, largest first, of the rocks on one area; N is Poisson distributed.

    The law is cut at both ends: what it holds above ``max_diameter_m`` is missing from the field.
    """
    if cfa <= 0:
        return np.zeros(0)
    diameters, number = _cumulative(cfa, min_diameter_m, max_diameter_m)
    count = int(rng.poisson(number[-1] * area_m2))
    drawn = np.interp(rng.uniform(0.0, number[-1], count), number, diameters)
    return np.asarray(np.sort(drawn)[::-1])


def _cumulative(cfa: float, low_m: float, high_m: float) -> tuple[FloatArray, FloatArray]:
    """Diameters and the number of rocks per square metre below each, from ``low_m`` on, by the trapezium rule."""
    diameters = np.geomspace(low_m, high_m, _TABLE_POINTS)
    density = number_density(cfa, diameters)
    steps = np.diff(diameters) * (density[1:] + density[:-1]) / 2.0
    return diameters, np.concatenate([[0.0], np.cumsum(steps)])


def place_discs(radii_m: FloatArray, size_m: tuple[float, float], rng: np.random.Generator) -> FloatArray:
    """Centres (N, 2) of discs laid at random, none overlapping, all within [0, width] x [0, height].

    Each disc starts at a uniformly random place; of two that overlap the smaller is laid anew until none does.
    Raises `ScenarioError` where the discs are too many or too large for the map.
    """
    order = np.argsort(-radii_m, kind="stable")
    radii = radii_m[order]
    room = np.asarray(size_m) - 2 * radii[:, None]
    if room.size and room.min() <= 0:
        raise ScenarioError(
            f"rocks.max_diameter_m: a rock {2 * radii[0]:.2f} m long does not fit the map {list(size_m)}"
        )
    centres = radii[:, None] + rng.uniform(size=room.shape) * room
    side = float(np.sqrt(size_m[0] * size_m[1] / max(len(radii), 1)))  # a cell for each disc
    columns = int(size_m[0] / side) + 1
    disc, cell = _cells(centres, radii, np.arange(len(radii)), side, columns)
    moved = np.ones(len(radii), dtype=bool)
    for _ in range(_MAX_ROUNDS):
        near = np.isin(cell, cell[moved[disc]])  # others have been looked at before
        blocked = _overlapping_smaller(centres, radii, disc[near], cell[near])
        if not blocked.any():
            placed = np.empty_like(centres)
            placed[order] = centres
            return placed
        centres[blocked] = radii[blocked, None] + rng.uniform(size=(int(blocked.sum()), 2)) * room[blocked]
        stays = ~blocked[disc]
        new_disc, new_cell = _cells(centres, radii, np.flatnonzero(blocked), side, columns)
        disc, cell = np.concatenate([disc[stays], new_disc]), np.concatenate([cell[stays], new_cell])
        moved = blocked
    raise ScenarioError(f"rocks.cfa: {len(radii)} rocks cannot be laid without overlap; use less or smaller ones")


def _cells(
    centres: FloatArray, radii: FloatArray, which: Indices, side_m: float, columns: int
) -> tuple[Indices, Indices]:
    """Every cell of a square grid that the boxes around the discs ``which`` touch: disc (M,) and cell (M,)."""
    low = np.maximum((centres[which] - radii[which, None]) / side_m, 0.0).astype(np.int64)
    wide, high = ((centres[which] + radii[which, None]) / side_m).astype(np.int64).T - low.T + 1
    count = wide * high
    disc = np.repeat(np.arange(len(which)), count)
    step = np.arange(len(disc)) - np.repeat(np.cumsum(count) - count, count)
    row, column = np.divmod(step, wide[disc])
    return which[disc], (low[disc, 1] + row) * columns + low[disc, 0] + column


def _overlapping_smaller(centres: FloatArray, radii: FloatArray, disc: Indices, cell: Indices) -> BoolArray:
    """Which discs, of radii in falling order, overlap an earlier one in one of these cells."""
    order = np.lexsort((disc, cell))
    disc, cell = disc[order], cell[order]
    blocked = np.zeros(len(radii), dtype=bool)
    step = 1
    while (together := np.flatnonzero(cell[step:] == cell[:-step])).size:
        larger, smaller = disc[together], disc[together + step]
        gap = np.linalg.norm(centres[larger] - centres[smaller], axis=1) - radii[larger] - radii[smaller]
        blocked[smaller[gap < 0]] = True
        step += 1
    return blocked
