"""Ground at every scale: a map from orbit and what the rover saw itself, each cell with its variance and its source.

After Olson, Matthies, Wright, Li and Di, "Visual terrain mapping for Mars exploration", CVIU 105(1), 2007, who unite
orbital, descent and rover pictures in one multi-resolution map. Here the coarse layer is an elevation map, the fine one
square tiles of 5 cm cells where the rover has been; a question about a square of any size is answered from both,
weighted by their variances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from planner.ground_cells import CELL_M, UNKNOWN_VARIANCE_M2, GroundCells
from planner.route_ground import ElevationMap
from worlds.types import BoolArray, ByteArray, FloatArray, HeightField

TILE = 64  # cells of 5 cm along the side of a tile
TILE_M = TILE * CELL_M
LEAST_OVERLAP = 20  # coarse cells that both have seen, before their difference of level is believed
ENOUGH = 0.25  # share of a square that the rover must have seen to speak for it
Key = tuple[int, int]
Places = tuple[NDArray[np.int64], NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class Tile:
    """Fine cells ``[row, column]``, each (TILE, TILE)."""

    height_m: FloatArray
    variance_m2: FloatArray  # inf where the rover has seen nothing
    source: ByteArray  # `planner.ground_cells.Source`


@dataclass(frozen=True, eq=False)
class TerrainStore:
    """Both layers; a tile's key is (row, column) of its lower left corner, in steps of `TILE_M` from zero."""

    coarse: ElevationMap
    tiles: Mapping[Key, Tile] = field(default_factory=dict)
    level_m: float = 0.0  # of the rover's heights over those of the coarse map


@dataclass(frozen=True)
class Square:
    """What is known of a square of ground."""

    mean_m: float  # height, on the level of the coarse map; NaN where nothing is known
    variance_m2: float  # of that mean; inf where nothing is known
    roughness_m: float  # rms about a plane; NaN where too little was seen at this scale
    seen: float  # share that the rover has seen itself
    sources: frozenset[int]  # `planner.ground_cells.Source` of the fine cells in it


def with_cells(store: TerrainStore, cells: GroundCells) -> TerrainStore:
    """The store after the rover's own cells of now; of two readings of a cell the surer one stays.

    The rover's heights share errors, of its plane and its position, so they are not averaged cell by cell.
    """
    told = cells.seen & (cells.variance_m2 < UNKNOWN_VARIANCE_M2)
    rows, columns = np.nonzero(told)
    if not len(rows):
        return store
    first = np.round(cells.origin_w / CELL_M).astype(np.int64)
    row, column = rows + first[1], columns + first[0]
    tiles, keys = dict(store.tiles), np.stack([row // TILE, column // TILE])
    for key in map(tuple, np.unique(keys, axis=1).T.tolist()):
        here = (keys[0] == key[0]) & (keys[1] == key[1])
        place = row[here] % TILE, column[here] % TILE
        tiles[key] = _surer(tiles.get(key) or _blank(), place, cells, (rows[here], columns[here]))
    after = replace(store, tiles=tiles)
    return replace(after, level_m=_level(after))


def square(store: TerrainStore, centre_w: tuple[float, float], side_m: float) -> Square:
    """Mean, variance and roughness of a square of any side about a place, from all that is known of it."""
    heights, variances, sources, seen = _fine(store, centre_w, side_m)
    coarse_mean, coarse_variance, coarse_roughness = _coarse(store.coarse, centre_w, side_m)
    mean, variance = coarse_mean, coarse_variance
    if len(heights):
        own = float(heights.mean()) - store.level_m
        # One error for all cells, and the ground that was not seen may differ by as much as the seen does from itself.
        spread = max(float(heights.var()), 1e-6)
        own_variance = float(variances.mean()) + spread * (1.0 - seen) / max(seen, 1e-3)
        mean, variance = _fused((coarse_mean, coarse_variance), (own, own_variance))
    roughness = _roughness(store, centre_w, side_m) if seen >= ENOUGH else coarse_roughness
    return Square(mean, variance, roughness, seen, frozenset(int(value) for value in np.unique(sources)))


def fused(store: TerrainStore) -> ElevationMap:
    """The coarse map with each cell's height and variance fused with what the rover saw of it."""
    grid = store.coarse.field
    heights, variances = grid.heights_m.copy(), store.coarse.variance_m2.copy()
    for row, column in _touched(store):
        place = grid.origin_m[0] + grid.resolution_m * column, grid.origin_m[1] + grid.resolution_m * row
        found = square(store, place, grid.resolution_m)
        if np.isfinite(found.mean_m):
            heights[row, column], variances[row, column] = found.mean_m, found.variance_m2
    field = HeightField(heights, grid.resolution_m, grid.origin_m)
    return ElevationMap(field, variances, store.coarse.likeliest)


def _surer(tile: Tile, place: Places, cells: GroundCells, seen: Places) -> Tile:
    """A tile with those of the ``seen`` cells that are surer than what it has at ``place``."""
    better = cells.variance_m2[seen] <= tile.variance_m2[place]
    to, of = (place[0][better], place[1][better]), (seen[0][better], seen[1][better])
    height, variance, source = tile.height_m.copy(), tile.variance_m2.copy(), tile.source.copy()
    height[to], variance[to], source[to] = cells.height_m[of], cells.variance_m2[of], cells.source[of]
    return Tile(height, variance, source)


def _blank() -> Tile:
    shape = (TILE, TILE)
    return Tile(np.zeros(shape), np.full(shape, np.inf), np.zeros(shape, dtype=np.uint8))


def _touched(store: TerrainStore) -> list[tuple[int, int]]:
    """Coarse cells (row, column) that tiles reach."""
    grid, found = store.coarse.field, set()
    ny, nx = grid.heights_m.shape
    for key in store.tiles:
        (south, west), step = np.array(key) * TILE_M, grid.resolution_m
        low = np.floor((np.array([south, west]) - grid.origin_m[::-1]) / step + 0.5).astype(int)
        high = np.floor((np.array([south, west]) + TILE_M - grid.origin_m[::-1]) / step + 0.5).astype(int)
        rows, columns = range(max(low[0], 0), min(high[0] + 1, ny)), range(max(low[1], 0), min(high[1] + 1, nx))
        found |= {(row, column) for row in rows for column in columns}
    return sorted(found)


def _window(
    store: TerrainStore, centre_w: tuple[float, float], side_m: float
) -> tuple[FloatArray, FloatArray, ByteArray]:
    """Fine layers over a square: heights, variances (inf where unseen) and sources, each (n, n)."""
    count = max(1, round(side_m / CELL_M))
    first = [int(np.floor((value - 0.5 * side_m) / CELL_M + 0.5)) for value in (centre_w[1], centre_w[0])]
    height, variance = np.zeros((count, count)), np.full((count, count), np.inf)
    source = np.zeros((count, count), dtype=np.uint8)
    for key in ((r, c) for r in _keys(first[0], count) for c in _keys(first[1], count)):
        tile = store.tiles.get(key)
        if tile is None:
            continue
        cut = [
            (max(key[axis] * TILE, first[axis]), min((key[axis] + 1) * TILE, first[axis] + count)) for axis in (0, 1)
        ]
        inside = tuple(slice(low - key[axis] * TILE, high - key[axis] * TILE) for axis, (low, high) in enumerate(cut))
        to = tuple(slice(low - first[axis], high - first[axis]) for axis, (low, high) in enumerate(cut))
        height[to], variance[to], source[to] = tile.height_m[inside], tile.variance_m2[inside], tile.source[inside]
    return height, variance, source


def _keys(first: int, count: int) -> range:
    return range(first // TILE, (first + count - 1) // TILE + 1)


def _fine(
    store: TerrainStore, centre_w: tuple[float, float], side_m: float
) -> tuple[FloatArray, FloatArray, ByteArray, float]:
    """Heights, variances and sources (N,) of the cells seen in a square, and their share of it."""
    heights, variances, sources = _window(store, centre_w, side_m)
    known: BoolArray = np.isfinite(variances)
    return heights[known], variances[known], sources[known], float(known.mean())


def _coarse(ground: ElevationMap, centre_w: tuple[float, float], side_m: float) -> tuple[float, float, float]:
    """Mean, variance of it and rms about a plane that the coarse map has for a square."""
    grid, half = ground.field, 0.5 * side_m
    ny, nx = grid.heights_m.shape
    edges = []
    for value, start, count in ((centre_w[1], grid.origin_m[1], ny), (centre_w[0], grid.origin_m[0], nx)):
        low, high = (int(np.floor((value + sign * half - start) / grid.resolution_m + 0.5)) for sign in (-1.0, 1.0))
        high = max(high, low + 1) if side_m >= grid.resolution_m else low + 1
        edges.append((max(low, 0), min(high, count)))
    (south, north), (west, east) = edges
    if south >= north or west >= east:
        return np.nan, np.inf, np.nan
    part, noise = grid.heights_m[south:north, west:east], ground.variance_m2[south:north, west:east]
    known = np.isfinite(part)
    if not known.any():
        return np.nan, np.inf, np.nan
    variance = float(noise[known].mean()) / int(known.sum())
    if side_m < grid.resolution_m:
        variance += _relief_within(grid, south, west)
    return float(part[known].mean()), variance, _off_plane(part) if known.all() and min(part.shape) > 2 else np.nan


def _relief_within(grid: HeightField, row: int, column: int) -> float:
    """Variance of the heights inside a coarse cell about its mean, as its own slope gives it."""
    around = grid.heights_m[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    if min(around.shape) < 2 or not np.isfinite(around).all():
        return 0.0
    rise = np.gradient(around)
    return float((rise[0] ** 2 + rise[1] ** 2).mean()) / 12.0


def _off_plane(heights: FloatArray) -> float:
    """Rms of heights (ny, nx) about their plane; unknown ones left out."""
    rows, columns = np.nonzero(np.isfinite(heights))
    values = heights[rows, columns]
    design = np.column_stack([np.ones(len(rows)), rows, columns])
    rest = values - design @ np.linalg.lstsq(design, values)[0]
    return float(np.sqrt(np.mean(rest**2)))


def _roughness(store: TerrainStore, centre_w: tuple[float, float], side_m: float) -> float:
    heights, variances, _ = _window(store, centre_w, side_m)
    return _off_plane(np.where(np.isfinite(variances), heights, np.nan))


def _fused(one: tuple[float, float], two: tuple[float, float]) -> tuple[float, float]:
    """Mean and variance of two independent readings; one of infinite variance says nothing."""
    if not np.isfinite(one[0]):
        return two
    weights = 1.0 / one[1] if one[1] > 0.0 else np.inf, 1.0 / two[1] if two[1] > 0.0 else np.inf
    if not np.isfinite(weights[0]):
        return one
    if not np.isfinite(weights[1]):
        return two
    total = weights[0] + weights[1]
    return (weights[0] * one[0] + weights[1] * two[0]) / total, 1.0 / total


def _level(store: TerrainStore) -> float:
    """Median of the rover's heights less the coarse map's, over cells that it has seen enough of."""
    grid, apart = store.coarse.field, []
    for row, column in _touched(store):
        place = grid.origin_m[0] + grid.resolution_m * column, grid.origin_m[1] + grid.resolution_m * row
        heights, _, _, seen = _fine(store, place, grid.resolution_m)
        if seen >= ENOUGH and np.isfinite(grid.heights_m[row, column]):
            apart.append(float(heights.mean()) - float(grid.heights_m[row, column]))
    return float(np.median(apart)) if len(apart) >= LEAST_OVERLAP else store.level_m
