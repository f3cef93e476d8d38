"""How many rocks of which diameter lie where: the size-frequency law of Golombek and placement without overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from worlds.errors import ScenarioError
from worlds.types import BoolArray, FloatArray

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
    for _ in range(_MAX_ROUNDS):
        blocked = _overlapping_smaller(centres, radii)
        if not blocked.any():
            placed = np.empty_like(centres)
            placed[order] = centres
            return placed
        centres[blocked] = radii[blocked, None] + rng.uniform(size=(int(blocked.sum()), 2)) * room[blocked]
    raise ScenarioError(f"rocks.cfa: {len(radii)} rocks cannot be laid without overlap; use less or smaller ones")


def _overlapping_smaller(centres: FloatArray, radii: FloatArray) -> BoolArray:
    """Which discs, of radii in falling order, overlap an earlier one."""
    from scipy.spatial import cKDTree

    blocked = np.zeros(len(radii), dtype=bool)
    # A smaller disc that touches this one has its centre within twice this one's radius.
    neighbours = cKDTree(centres).query_ball_point(centres, 2.0 * radii, return_sorted=False)
    counts = np.fromiter((len(found) for found in neighbours), dtype=np.int64, count=len(radii))
    larger = np.repeat(np.arange(len(radii)), counts)
    smaller = np.concatenate([np.zeros(0), *neighbours]).astype(np.int64)
    gap = np.linalg.norm(centres[larger] - centres[smaller], axis=1) - radii[larger] - radii[smaller]
    blocked[smaller[(smaller > larger) & (gap < 0)]] = True
    return blocked
