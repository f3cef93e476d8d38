"""The row-by-row search for a free path (2004 paper, section 3), layer by layer through a local frame.

The frame's x axis points at the goal. Across it lie rows; in each row divide and conquer finds the free spaces right
and left of the rover, and each space gets a risk proportional to the weighted sum of the obstacles around it. From row
to row the rover may shift sideways by a bounded angle. Where the paper keeps one waypoint a row, every free cell of a
row keeps its cheapest way from the rover, so a space that closes further on costs nothing but itself; a second pass
from the far end tells the cheapest way through each space: the best ways through different spaces are the candidates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from planner import row_kernels as kernels
from planner.ground_cells import GroundCells, sample
from planner.obstacle_map import (
    MAX_CLEARANCE_M,
    DriveModel,
    Frame2,
    ObstacleGrid,
    in_frame,
    let_leave,
    near,
    obstacle_grid,
    segment_clearance,
)
from worlds.types import FloatArray, IntArray

EndCost = Callable[[FloatArray], FloatArray]  # world points (N, 2) -> metres still to go (N,)


@dataclass(frozen=True)
class RowModel:
    """Layout of the rows and what is charged, in metres of way."""

    row_m: float = 0.4
    sub_rows: int = 4  # checks between two rows
    cell_m: float = 0.1
    depth_m: float = 7.2
    half_width_m: float = 5.0
    most_shift: int = 4  # cells a row: 45 deg
    most_turn: int = 3  # shifts between two rows
    turn_cost: float = 0.06  # a shift of change
    first_turn_cost: float = 0.35  # a radian turned before setting out
    hill_cost: float = 0.8
    near_cost: float = 1.0
    unseen_cost: float = 0.35
    near_unseen_cost: float = 2.0  # ground so near that the camera will not see it in time
    near_unseen_m: float = 1.5
    rough_cost: float = 0.4
    space_cost: float = 0.3  # of the risk of the free space
    off_line_cost: float = 0.02  # a metre from the straight line
    candidates: int = 4
    most_leg_m: float = 1.5


@dataclass(frozen=True, eq=False)
class Task:
    """One search: from where, whither, and with which berth."""

    frame: Frame2
    length_m: float  # rows go so far, at most the model's depth
    heading_rad: float  # of the rover, in the world
    need_m: float  # centre line to hard rock
    end_cost: EndCost
    turn_range_rad: tuple[float, float] = (-np.pi, np.pi)  # how far the rover can turn on the spot, right and left


@dataclass(frozen=True, eq=False)
class Candidate:
    """A way that is free, and what it is like."""

    waypoints_w: FloatArray  # (N, 2), begins at the rover
    cost: float
    length_m: float
    clearance_m: float  # centre line to the nearest hard rock, at most MAX_CLEARANCE_M
    hill: float  # mean of the hilly field
    roughness: float  # mean, 0..1
    unseen: float  # share never seen
    complete: bool  # reaches the last row


@dataclass(frozen=True, eq=False)
class RowSearch:
    """What the search found; ``blocked_row`` is the first row that cannot be reached, None if all can."""

    candidates: tuple[Candidate, ...]  # cheapest first
    blocked_row: int | None
    rows_m: FloatArray  # distance of each row along the frame
    spaces: tuple[IntArray, ...] = field(default=())  # free spaces of each row, (G, 2) columns


def search(
    table_w: FloatArray, cells: GroundCells, task: Task, drive: DriveModel, model: RowModel | None = None
) -> RowSearch:
    """Free ways from the rover along the frame of ``task`` among the obstacles ``table_w`` (N, 7) of the world."""
    model = model or RowModel()
    reach = float(np.hypot(model.depth_m, model.half_width_m)) + 1.5
    table = let_leave(
        in_frame(near(table_w, np.asarray(task.frame.origin_w), reach), task.frame), np.zeros(2), task.need_m
    )
    rows = max(1, round(min(task.length_m, model.depth_m) / model.row_m))
    length = min(task.length_m, model.depth_m)
    columns = 2 * round(model.half_width_m / model.cell_m) + 1
    limits = (-model.half_width_m, model.half_width_m)
    grid = obstacle_grid(table, (0.0, length), limits, (rows * model.sub_rows + 1, columns))
    ground = _Ground.over(grid, cells, task.frame, model.sub_rows)
    spaces = _spaces(grid, task.need_m, model.sub_rows)
    cost = _cell_cost(grid, ground, spaces, task.need_m, drive, model)
    edges = kernels.edge_costs(
        grid.clearance_m, cost, task.need_m, model.sub_rows, model.most_shift, grid.step_x_m, grid.step_y_m
    )
    ways = _ways(edges, grid, task, spaces, model)
    candidates = tuple(
        _candidate(columns_of, way_cost, table, grid, ground, task, drive, model, complete=ways.blocked_row is None)
        for columns_of, way_cost in ways.found
    )
    return RowSearch(candidates, ways.blocked_row, np.linspace(0.0, length, rows + 1), spaces)


@dataclass(frozen=True, eq=False)
class _Ground:
    """Whether and how rough the ground was seen, one value a row and column."""

    unseen: FloatArray  # (rows + 1, columns)
    roughness: FloatArray

    @staticmethod
    def over(grid: ObstacleGrid, cells: GroundCells, frame: Frame2, sub: int) -> _Ground:
        x = grid.x0_m + grid.step_x_m * np.arange(0, grid.hill.shape[0], sub)
        y = grid.y0_m + grid.step_y_m * np.arange(grid.hill.shape[1])
        seen, rough = sample(cells, frame.to_world(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)))
        return _Ground(np.where(seen, 0.0, 1.0), rough)


@dataclass(frozen=True, eq=False)
class _Ways:
    found: list[tuple[IntArray, float]]  # column in each row, cost
    blocked_row: int | None


def _spaces(grid: ObstacleGrid, need: float, sub: int) -> tuple[IntArray, ...]:
    free = (grid.clearance_m[::sub] >= need).astype(np.float64)
    middle = grid.hill.shape[1] // 2
    return tuple(kernels.free_spaces(row, middle) for row in free)


def _space_risk(grid: ObstacleGrid, spaces: tuple[IntArray, ...], sub: int) -> FloatArray:
    """Risk of the free space of each row and column: mean of the hilly field over it and half a metre beyond."""
    hill = grid.hill[::sub]
    sums = np.concatenate([np.zeros((len(hill), 1)), np.cumsum(hill, axis=1)], axis=1)
    risk = np.zeros_like(hill)
    beyond = round(0.5 / grid.step_y_m)
    for row, found in enumerate(spaces):
        for first, last in found:
            low, high = max(first - beyond, 0), min(last + 1 + beyond, hill.shape[1])
            risk[row, first : last + 1] = (sums[row, high] - sums[row, low]) / (high - low)
    return risk


def _cell_cost(
    grid: ObstacleGrid,
    ground: _Ground,
    spaces: tuple[IntArray, ...],
    need: float,
    drive: DriveModel,
    model: RowModel,
) -> FloatArray:
    """Cost of a metre at each grid cell: one for the way and what the place adds."""
    sub = model.sub_rows
    y = grid.y0_m + grid.step_y_m * np.arange(grid.hill.shape[1])
    near_rows = np.arange(len(ground.unseen)) * sub * grid.step_x_m < model.near_unseen_m
    unseen_cost = np.where(near_rows, model.near_unseen_cost, model.unseen_cost)[:, None]
    by_row = unseen_cost * ground.unseen + model.rough_cost * ground.roughness
    by_row += model.space_cost * _space_risk(grid, spaces, sub) + model.off_line_cost * np.abs(y)
    between = np.minimum((np.arange(grid.hill.shape[0]) + sub // 2) // sub, len(by_row) - 1)
    close = np.clip((need + drive.comfort_m - grid.clearance_m) / drive.comfort_m, 0.0, 1.0)
    cost: FloatArray = 1.0 + model.hill_cost * grid.hill + model.near_cost * close**2 + by_row[between]
    return cost


def _ways(edges: FloatArray, grid: ObstacleGrid, task: Task, spaces: tuple[IntArray, ...], model: RowModel) -> _Ways:
    """Columns and cost of the cheapest way through each free space of the row that has most of them."""
    rows, columns, _ = edges.shape
    middle = columns // 2
    first = _first_costs(task, grid, model)
    forward, before = kernels.search_forward(edges, middle, first, model.turn_cost, model.most_turn)
    reached = np.flatnonzero(np.isfinite(forward).any(axis=(1, 2)))
    last = int(reached.max(initial=0))
    if last == 0:
        return _Ways([], 1)
    y = grid.y0_m + grid.step_y_m * np.arange(columns)
    x = np.full(columns, grid.x0_m + grid.step_x_m * model.sub_rows * last)
    final = task.end_cost(task.frame.to_world(np.stack([x, y], axis=1)))
    backward, after = kernels.search_backward(edges, final, last, model.turn_cost, model.most_turn)
    total = forward[: last + 1] + backward
    row = 1 + int(np.argmax([len(found) for found in spaces[1 : last + 1]]))
    found: list[tuple[IntArray, float]] = []
    for low, high in spaces[row]:
        through = total[row, low : high + 1]
        best = int(np.argmin(through))
        if np.isfinite(through.flat[best]):
            column, shift = divmod(best, through.shape[1])
            way = _trace(before, after, row, int(low) + column, shift, last)
            found.append((way, float(through.flat[best])))
    found.sort(key=lambda way: way[1])
    return _Ways(found[: model.candidates], None if last == rows else last + 1)


def _first_costs(task: Task, grid: ObstacleGrid, model: RowModel) -> FloatArray:
    """Cost of setting out with each shift: the turn on the spot; inf where the rover has no room for it."""
    shifts = np.arange(-model.most_shift, model.most_shift + 1)
    direction = task.frame.heading_rad + np.arctan2(shifts * grid.step_y_m, grid.step_x_m * model.sub_rows)
    turn = (direction - task.heading_rad + np.pi) % (2 * np.pi) - np.pi
    right, left = task.turn_range_rad
    # Small turns are driven as a curve, not on the spot.
    room = (turn >= min(right, -0.35)) & (turn <= max(left, 0.35))
    return np.where(room, model.first_turn_cost * np.abs(turn), np.inf)


def _trace(before: IntArray, after: IntArray, row: int, column: int, shift: int, last: int) -> IntArray:
    """Columns (last + 1,) of the way that stands at (row, column, shift)."""
    reach = before.shape[2] // 2
    way = np.zeros(last + 1, dtype=np.int32)
    way[row] = column
    back = shift
    for k in range(row, 0, -1):
        way[k - 1] = way[k] - (back - reach)
        back = before[k, way[k], back]
    onward = shift
    for k in range(row, last):
        onward = after[k, way[k], onward]
        way[k + 1] = way[k] + (onward - reach)
    return way


def _candidate(
    way: IntArray,
    cost: float,
    table: FloatArray,
    grid: ObstacleGrid,
    ground: _Ground,
    task: Task,
    drive: DriveModel,
    model: RowModel,
    *,
    complete: bool,
) -> Candidate:
    rows = np.arange(len(way))
    path = np.stack(
        [grid.x0_m + grid.step_x_m * model.sub_rows * rows, grid.y0_m + grid.step_y_m * way.astype(float)], axis=1
    )
    hard = np.ascontiguousarray(table[table[:, 6] > 0.5])
    kept = path[kernels.simplify(hard, path, task.need_m, 0.6 * drive.comfort_m, model.most_leg_m)]
    clear = segment_clearance(table, kept)
    return Candidate(
        waypoints_w=task.frame.to_world(kept),
        cost=cost,
        length_m=float(np.linalg.norm(np.diff(kept, axis=0), axis=1).sum()),
        clearance_m=float(clear.min(initial=MAX_CLEARANCE_M)),
        hill=float(grid.hill[rows * model.sub_rows, way].mean()),
        roughness=float(ground.roughness[rows, way].mean()),
        unseen=float(ground.unseen[rows, way].mean()),
        complete=complete,
    )
