"""Which ground the rover has seen and how rough it looked: a square window of cells that moves with the rover.

Roughness comes from the six terrain classes (2004 paper, section 5) as a share 0..1 of "hard to drive"; it is a light
cost beside the rocks themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from worlds.types import BoolArray, FloatArray, Observation, TerrainClass

Index = NDArray[np.intp]
CELL_M = 0.25
CELLS = 192  # 48 m
CAMERA_HEIGHT_M = 1.1  # for the length of what a rock hides; a lower camera hides more
HIDING_HEIGHT_M = 0.15
ROUGHNESS = {
    TerrainClass.SAND: 0.0,
    TerrainClass.VERY_SMALL_ROCKS: 0.15,
    TerrainClass.ROUGH: 0.45,
    TerrainClass.VERY_ROUGH: 0.8,
    TerrainClass.BIG_ROCK: 0.6,
}


@dataclass(frozen=True, eq=False)
class GroundCells:
    """Cells ``[iy, ix]`` whose lower left corner lies at ``origin_w + CELL_M * (ix, iy)``."""

    origin_w: FloatArray  # (2,)
    seen: BoolArray  # (CELLS, CELLS)
    roughness: FloatArray  # (CELLS, CELLS), 0..1; 0 where nothing is known


def empty_cells(centre_w: FloatArray) -> GroundCells:
    """Cells around a place, none seen."""
    origin = np.floor(np.asarray(centre_w, dtype=float)[:2] / CELL_M) * CELL_M - CELLS // 2 * CELL_M
    return GroundCells(origin, np.zeros((CELLS, CELLS), dtype=bool), np.zeros((CELLS, CELLS)))


def note_view(cells: GroundCells, observation: Observation, viewpoint_w: FloatArray) -> GroundCells:
    """The cells after an observation: those inside its outline are seen, with the roughness of the nearest window."""
    cells = recentre(cells, viewpoint_w)
    outline = observation.footprint_w
    if len(outline) < 3:
        return cells
    rows, columns, centres = _cells_inside(cells, outline)
    open_ = ~_shadowed(observation, viewpoint_w, centres)
    rows, columns, centres = rows[open_], columns[open_], centres[open_]
    if len(rows) == 0:
        return cells
    seen = cells.seen.copy()
    seen[rows, columns] = True
    rough, known = _roughness_at(observation, centres)
    layer = cells.roughness.copy()
    distance = np.linalg.norm(centres[known] - viewpoint_w, axis=1)
    # Near views say more: half of a cell's value is replaced at 2 m, a sixth at 6 m.
    share = np.clip(1.0 / np.maximum(distance, 1.0), 0.1, 1.0)
    at = rows[known], columns[known]
    layer[at] += share * (rough - layer[at])
    return GroundCells(cells.origin_w, seen, layer)


def mark_driven(cells: GroundCells, place_w: FloatArray, radius_m: float) -> GroundCells:
    """The cells after the rover stood at a place: the ground under it counts as seen."""
    angle = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    rows, columns, _ = _cells_inside(cells, place_w + radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    seen = cells.seen.copy()
    seen[rows, columns] = True
    return replace(cells, seen=seen)


def sample(cells: GroundCells, places_w: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Seen or not, and roughness, at places (..., 2); outside the window nothing is seen."""
    index = np.floor((places_w - cells.origin_w) / CELL_M).astype(np.int64)
    inside = np.all((index >= 0) & (index < CELLS), axis=-1)
    index = np.clip(index, 0, CELLS - 1)
    column, row = index[..., 0], index[..., 1]
    return cells.seen[row, column] & inside, np.where(inside, cells.roughness[row, column], 0.0)


def recentre(cells: GroundCells, place_w: FloatArray) -> GroundCells:
    """The same cells, moved so that ``place_w`` lies in the middle half of the window."""
    middle = cells.origin_w + CELLS * CELL_M / 2
    if np.all(np.abs(place_w - middle) < CELLS * CELL_M / 4):
        return cells
    shift = np.round((place_w - middle) / CELL_M).astype(np.int64)
    moved = empty_cells(place_w)
    if np.any(np.abs(shift) >= CELLS):
        return moved
    target, source = [], []
    for step in (int(shift[1]), int(shift[0])):
        target.append(slice(max(-step, 0), CELLS - max(step, 0)))
        source.append(slice(max(step, 0), CELLS - max(-step, 0)))
    moved.seen[tuple(target)] = cells.seen[tuple(source)]
    moved.roughness[tuple(target)] = cells.roughness[tuple(source)]
    return replace(moved, origin_w=cells.origin_w + shift * CELL_M)


def inside_polygon(outline: FloatArray, points: FloatArray) -> BoolArray:
    """Which points (N, 2) lie inside a polygon (M, 2): even-odd rule."""
    following = np.roll(outline, -1, axis=0)
    x, y = points[:, 0, None], points[:, 1, None]
    straddles = (outline[:, 1] > y) != (following[:, 1] > y)
    rise = following[:, 1] - outline[:, 1]
    crossing = outline[:, 0] + (y - outline[:, 1]) * (following[:, 0] - outline[:, 0]) / np.where(rise == 0, 1.0, rise)
    hits: BoolArray = np.sum(straddles & (x < crossing), axis=1) % 2 == 1
    return hits


def _cells_inside(cells: GroundCells, outline: FloatArray) -> tuple[Index, Index, FloatArray]:
    """Rows, columns and centres of the cells whose centre lies inside a polygon."""
    low = np.clip(np.floor((outline.min(axis=0) - cells.origin_w) / CELL_M), 0, CELLS).astype(int)
    high = np.clip(np.ceil((outline.max(axis=0) - cells.origin_w) / CELL_M), 0, CELLS).astype(int)
    grid = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    columns, rows = grid[0].ravel(), grid[1].ravel()
    centres = cells.origin_w + CELL_M * (np.stack([columns, rows], axis=1) + 0.5)
    inside = inside_polygon(outline, centres)
    return rows[inside], columns[inside], centres[inside]


def _shadowed(observation: Observation, viewpoint_w: FloatArray, places_w: FloatArray) -> BoolArray:
    """Which places (N, 2) lie behind a rock of the observation, as far as it hides the ground from the camera."""
    rocks = [rock for rock in observation.rocks if rock.height_m > HIDING_HEIGHT_M]
    if not rocks or len(places_w) == 0:
        return np.zeros(len(places_w), dtype=bool)
    sight = np.array([rock.position_w[:2] for rock in rocks]) - viewpoint_w
    height = np.array([rock.height_m for rock in rocks])
    half_width = 0.5 * np.array([rock.width_m for rock in rocks])
    distance = np.linalg.norm(sight, axis=1)
    towards = sight / np.maximum(distance, 1e-6)[:, None]
    offset = places_w - viewpoint_w
    along, across = offset @ towards.T, offset @ np.stack([-towards[:, 1], towards[:, 0]])
    reach = distance * np.minimum(CAMERA_HEIGHT_M / np.maximum(CAMERA_HEIGHT_M - height, 0.05), 4.0)
    behind = (along > distance + half_width) & (along < reach)
    hidden: BoolArray = np.any(behind & (np.abs(across) < half_width * along / np.maximum(distance, 1e-6)), axis=1)
    return hidden


def _roughness_at(observation: Observation, places_w: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Roughness of the nearest classified window, for those places (mask) that have one within a metre."""
    centres = observation.class_centre_w.reshape(-1, 2)
    letters = np.asarray(observation.classes).ravel()
    values = np.full(len(letters), np.nan)
    for terrain, value in ROUGHNESS.items():
        values[letters == terrain.value] = value
    useful = np.isfinite(values) & np.isfinite(centres).all(axis=1)
    if not useful.any():
        return np.zeros(0), np.zeros(len(places_w), dtype=bool)
    centres, values = centres[useful], values[useful]
    squared = ((places_w[:, None] - centres[None]) ** 2).sum(axis=2)
    nearest = squared.argmin(axis=1)
    known = squared[np.arange(len(places_w)), nearest] < 1.0
    return values[nearest[known]], known
