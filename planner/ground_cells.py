"""The ground around the rover on a 5 cm grid that moves with it: height, its variance, age, source and roughness.

Heights are those of the plane that the rover believed in when it saw a cell, or of its wheels where it drove. All
views share the error of that plane, so a cell keeps its surest reading instead of a mean. Roughness comes from the six
terrain classes (2004 paper, section 5) as a share 0..1 of "hard to drive"; it is a light cost beside the rocks
themselves, which are remembered one by one (`planner.terrain_map`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from planner import ground_kernels as kernels
from planner.ground_kernels import Layer
from worlds.types import BoolArray, ByteArray, FloatArray, GroundPlane, Observation, TerrainClass

Index = NDArray[np.intp]
CELL_M = 0.05
CELLS = 448  # 22.4 m
RECENTRE_M = 3.2  # the window follows when the rover is so far from its middle
BLOCK = 5  # cells along a block that shares the class of one look
CAMERA_HEIGHT_M = 1.1  # for the length of what a rock hides; a lower camera hides more
HIDING_HEIGHT_M = 0.15
VIEW_ERROR = (0.02, 0.035)  # one sigma of a height at the rover, and a metre away (decisions.md, "The loop")
UNKNOWN_VARIANCE_M2 = 1.0  # of a height that nobody measured
DRIVEN_ERROR = (0.02, 0.0)
UP = np.array([0.0, 0.0, 1.0])
ROUGHNESS = {
    TerrainClass.SAND: 0.0,
    TerrainClass.VERY_SMALL_ROCKS: 0.15,
    TerrainClass.ROUGH: 0.45,
    TerrainClass.VERY_ROUGH: 0.8,
    TerrainClass.BIG_ROCK: 0.6,
}


class Source(IntEnum):
    """Who told about a cell; 0 means nobody did."""

    NOBODY = 0
    CAMERA = 1
    LASER = 2
    WHEELS = 3


@dataclass(frozen=True, eq=False)
class GroundCells:
    """Cells ``[iy, ix]`` whose lower left corner lies at ``origin_w + CELL_M * (ix, iy)``: layers (CELLS, CELLS)."""

    origin_w: FloatArray  # (2,)
    source: ByteArray  # see `Source`: of the height
    seen_s: Layer  # time of the last view, for the age
    height_m: Layer  # of the ground without its rocks
    variance_m2: Layer  # of the height
    roughness: Layer  # 0..1; 0 where nothing is known

    @property
    def seen(self) -> BoolArray:
        """Which cells anyone has told about."""
        return np.asarray(self.source != Source.NOBODY)


def empty_cells(centre_w: FloatArray) -> GroundCells:
    """Cells around a place, none seen."""
    origin = np.floor(np.asarray(centre_w, dtype=float)[:2] / CELL_M) * CELL_M - CELLS // 2 * CELL_M
    shape = (CELLS, CELLS)
    layers = (np.zeros(shape, dtype=np.float32) for _ in range(4))
    return GroundCells(origin, np.zeros(shape, dtype=np.uint8), *layers)


@dataclass(frozen=True, eq=False)
class View:
    """Ground that something told about: the first outline less the others."""

    viewpoint_w: FloatArray  # (2,)
    outlines_w: tuple[FloatArray, ...]  # each (N, 2)
    plane: GroundPlane
    errors: tuple[float, float]  # one sigma of a height at the viewpoint, and how much more a metre away
    time_s: float
    source: Source
    centres_w: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))  # (M, 2) of looks at the roughness
    roughness: FloatArray = field(default_factory=lambda: np.zeros(0))  # (M,)


def camera_view(observation: Observation, viewpoint_w: FloatArray) -> View:
    """What an observation tells of the ground: what is inside its outline and behind no rock."""
    outlines = (observation.footprint_w, *_shadows(observation, viewpoint_w))
    plane = observation.ground or GroundPlane(np.zeros(3), UP)
    return View(viewpoint_w, outlines, plane, VIEW_ERROR, observation.time_s, Source.CAMERA, *_classes(observation))


def driven_view(wheels_w: FloatArray, radius_m: float, time_s: float) -> View:
    """What standing with the wheels about a place (3,) tells of the ground under the rover."""
    angle = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    outline = wheels_w[:2] + radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return View(wheels_w[:2], (outline,), GroundPlane(wheels_w, UP), DRIVEN_ERROR, time_s, Source.WHEELS)


def take_in(cells: GroundCells, *views: View) -> GroundCells:
    """The cells after views, moved along with the viewpoint."""
    if not views:
        return cells
    cells = recentre(cells, views[-1].viewpoint_w)
    after = replace(cells, **{part.name: getattr(cells, part.name).copy() for part in fields(GroundCells)[1:]})
    for view in views:
        if len(view.outlines_w[0]) >= 3:
            _write(after, view)
    return after


def mark_seen(
    cells: GroundCells, free: BoolArray, first: tuple[int, int], source: Source, time_s: float
) -> GroundCells:
    """The cells after another eye called those of ``free`` (rows, columns), from cell ``first`` (row, column) on, free.

    What lies beyond the window is left out; heights that are known stay.
    """
    low = np.maximum(first, 0)
    high = np.minimum(np.add(first, free.shape), CELLS)
    if np.any(low >= high):
        return cells
    part = free[low[0] - first[0] : high[0] - first[0], low[1] - first[1] : high[1] - first[1]]
    window = np.s_[low[0] : high[0], low[1] : high[1]]
    sources, seen_s, variance = cells.source.copy(), cells.seen_s.copy(), cells.variance_m2.copy()
    fresh = part & (sources[window] == Source.NOBODY)
    sources[window][fresh] = source
    variance[window][fresh] = UNKNOWN_VARIANCE_M2
    seen_s[window][part] = time_s
    return replace(cells, source=sources, seen_s=seen_s, variance_m2=variance)


def sample(cells: GroundCells, places_w: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Seen or not, and roughness, at places (..., 2); outside the window nothing is seen."""
    index = np.floor((places_w - cells.origin_w) / CELL_M).astype(np.int64)
    inside = np.all((index >= 0) & (index < CELLS), axis=-1)
    index = np.clip(index, 0, CELLS - 1)
    column, row = index[..., 0], index[..., 1]
    known: BoolArray = (cells.source[row, column] > 0) & inside
    return known, np.where(inside, cells.roughness[row, column], 0.0).astype(np.float64)


def sample_grid(
    cells: GroundCells,
    frame: tuple[float, float, float],
    grid: tuple[float, float, float, float],
    shape: tuple[int, int],
) -> tuple[Layer, Layer]:
    """Unseen (1 or 0) and roughness, each ``shape``, on a regular grid of a local frame.

    ``frame``: x, y and heading of its origin; ``grid``: first x and y, and the steps along them.
    """
    unseen, rough = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.float32)
    kernels.sample_grid(cells.source, cells.roughness, cells.origin_w, CELL_M, frame, grid, unseen, rough)
    return unseen, rough


def nearest_views(
    cells: GroundCells, place_w: FloatArray, low_w: FloatArray, step_m: float, shape: tuple[int, int]
) -> Layer:
    """Distance ``shape`` (nx, ny) from which places were seen at the nearest, in metres; now, where they never were.

    The places lie ``step_m`` apart from ``low_w`` (2,) on; the rover is at ``place_w`` (2,).
    """
    place, low = ((float(point[0]), float(point[1])) for point in (place_w, low_w))
    away: Layer = kernels.nearest_views(
        cells.source, cells.variance_m2, cells.origin_w, CELL_M, VIEW_ERROR, place, low, step_m, shape
    )
    return away


def recentre(cells: GroundCells, place_w: FloatArray) -> GroundCells:
    """The same cells, moved so that ``place_w`` (2,) lies about the middle of the window."""
    middle = cells.origin_w + CELLS * CELL_M / 2
    if np.all(np.abs(place_w - middle) < RECENTRE_M):
        return cells
    shift = np.round((place_w - middle) / CELL_M).astype(np.int64)
    moved = empty_cells(place_w)
    if np.any(np.abs(shift) >= CELLS):
        return moved
    target, source = [], []
    for step in (int(shift[1]), int(shift[0])):
        target.append(slice(max(-step, 0), CELLS - max(step, 0)))
        source.append(slice(max(step, 0), CELLS - max(-step, 0)))
    for layer in fields(GroundCells)[1:]:
        getattr(moved, layer.name)[tuple(target)] = getattr(cells, layer.name)[tuple(source)]
    return replace(moved, origin_w=cells.origin_w + shift * CELL_M)


def inside_polygon(outline: FloatArray, points: FloatArray) -> BoolArray:
    """Which points (N, 2) lie inside a polygon (M, 2): even-odd rule."""
    inside: BoolArray = kernels.inside_polygon(np.ascontiguousarray(outline), np.ascontiguousarray(points))
    return inside


def _write(cells: GroundCells, view: View) -> None:
    """Writes a view into ``cells``."""
    local = [(outline - cells.origin_w) / CELL_M for outline in view.outlines_w]
    low = np.clip(np.floor(local[0].min(axis=0)), 0, CELLS).astype(np.int64) // BLOCK * BLOCK
    high = np.clip(np.ceil(local[0].max(axis=0)), 0, CELLS).astype(np.int64)
    if np.any(low >= high):
        return
    mask = np.zeros((high[1] - low[1], high[0] - low[0]), dtype=np.uint8)
    for number, outline in enumerate(local):
        kernels.fill_polygon(mask, outline - low, 1 if number == 0 else 0)
    first = cells.origin_w + CELL_M * low
    rough = np.full(((mask.shape[0] - 1) // BLOCK + 1, (mask.shape[1] - 1) // BLOCK + 1), np.nan, dtype=np.float32)
    if len(view.roughness):
        kernels.nearest_values(view.centres_w, view.roughness, first + 0.5 * BLOCK * CELL_M, BLOCK * CELL_M, rough)
    normal = view.plane.normal_w / view.plane.normal_w[2]
    height = float(view.plane.point_w[2] - (first - view.plane.point_w[:2]) @ normal[:2])
    rise = (height, -float(normal[0]) * CELL_M, -float(normal[1]) * CELL_M)
    window = np.s_[low[1] : high[1], low[0] : high[0]]
    layers = tuple(getattr(cells, part.name)[window] for part in fields(GroundCells)[1:])
    place = (view.viewpoint_w - first) / CELL_M
    kernels.note_cells(mask, rough, BLOCK, place, CELL_M, rise, view.errors, view.time_s, int(view.source), layers)


def _shadows(observation: Observation, viewpoint_w: FloatArray) -> list[FloatArray]:
    """Outlines (4, 2) of the ground behind each rock, as far as it hides it from the camera."""
    outlines = []
    from_x, from_y = viewpoint_w.tolist()
    for rock in observation.rocks:
        sight_x, sight_y = rock.position_w[0] - from_x, rock.position_w[1] - from_y
        distance = float(np.hypot(sight_x, sight_y))
        if rock.height_m <= HIDING_HEIGHT_M or distance < 1e-6:
            continue
        reach = distance * min(CAMERA_HEIGHT_M / max(CAMERA_HEIGHT_M - rock.height_m, 0.05), 4.0)
        start = distance + 0.5 * rock.width_m
        if reach > start:
            x, y = sight_x / distance, sight_y / distance
            half = 0.5 * rock.width_m / distance  # a metre away
            ends = ((start, -half * start), (reach, -half * reach), (reach, half * reach), (start, half * start))
            outlines.append(np.array([(from_x + (a * x - b * y), from_y + (a * y + b * x)) for a, b in ends]))
    return outlines


def _classes(observation: Observation) -> tuple[FloatArray, FloatArray]:
    """Places (N, 2) and roughness (N,) of the windows whose class says something."""
    centres = observation.class_centre_w.reshape(-1, 2)
    letters = np.asarray(observation.classes).ravel()
    values = np.full(len(letters), np.nan)
    for terrain, value in ROUGHNESS.items():
        values[letters == terrain.value] = value
    useful = np.isfinite(values) & np.isfinite(centres).all(axis=1)
    return centres[useful], values[useful]
