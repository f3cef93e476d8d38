"""Ground beside a leg that the map forbids, as obstacles for navigation, which sees rocks and no slopes."""

from __future__ import annotations

import numpy as np

from planner.obstacle_map import NO_OBSTACLES
from planner.route import CostMap, Place
from worlds.types import BoolArray, FloatArray, Footprint

REACH_M = 15.0  # beside a leg; navigation looks no farther for ways round
RADIUS_SHARE = 0.25  # of a cell's side: its middle is what may not be driven on
SPARE_M = 0.1  # beside the leg, beyond what the body needs to turn on the spot


def too_steep(map_: CostMap, end_w: Place) -> BoolArray:
    """Cells (ny, nx) that may not be driven on at all, or not straight towards a place."""
    part, limits = map_.layers, map_.costs.limits[map_.layers.level]
    ny, nx = map_.care.shape
    (x0, y0), cell = map_.grid.origin_m, map_.grid.resolution_m
    way_x, way_y = (end_w[0] - x0 - cell * np.arange(nx))[None, :], (end_w[1] - y0 - cell * np.arange(ny))[:, None]
    far = np.maximum(np.hypot(way_x, way_y), 1e-9)
    climb = (part.rise_x * way_x + part.rise_y * way_y) / far
    lean = np.abs(part.rise_x * way_y - part.rise_y * way_x) / far
    up, down, across = np.moveaxis(limits, -1, 0)
    # As `planner.route_kernels.metre_cost` has it.
    share = np.where(climb > 0.0, np.hypot(climb / up, lean / across), np.maximum(-climb / down, lean / across))
    return np.asarray(~np.isfinite(map_.care) | (share > 1.0))


def forbidden(map_: CostMap, place: Place, way_w: FloatArray, end_w: Place, footprint: Footprint) -> FloatArray:
    """Obstacles (N, 7) of navigation: cells about a leg that are too steep for driving to its end.

    They are hard, except so near to the planned way (M, 2) or to where the rover stands that it could not drive there
    and turn on the spot: there they only cost.
    """
    cell = map_.grid.resolution_m
    start, end = np.asarray(place), np.asarray(end_w)
    corners = np.stack([np.minimum(start, end) - REACH_M, np.maximum(start, end) + REACH_M])
    (west, south), (east, north) = map_.cells(corners)
    ny, nx = map_.care.shape
    rows = slice(max(0, int(np.ceil(south))), max(0, min(ny, int(north) + 1)))
    columns = slice(max(0, int(np.ceil(west))), max(0, min(nx, int(east) + 1)))
    row, column = np.nonzero(too_steep(map_, end_w)[rows, columns])
    if not len(row):
        return NO_OBSTACLES
    middle = np.asarray(map_.grid.origin_m) + cell * np.column_stack([column + columns.start, row + rows.start])
    radius = RADIUS_SHARE * cell
    free_m = 0.5 * float(np.hypot(footprint.length_m, footprint.width_m)) + radius + SPARE_M
    hard = np.minimum(distances(middle, way_w), np.linalg.norm(middle - start, axis=1)) > free_m
    ones = np.ones(len(middle))
    return np.column_stack([middle, middle, radius * ones, ones, hard])


def distances(points: FloatArray, way_w: FloatArray) -> FloatArray:
    """Distance (N,) of points (N, 2) from a polyline (M, 2)."""
    start, along = way_w[:-1], np.diff(way_w, axis=0)
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1))
