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
from planner.ground_cells import GroundCells, sample_grid
from planner.map_kernels import least_clearance, simplify
from planner.obstacle_map import MAX_CLEARANCE_M, DriveModel, Frame2, ObstacleGrid, around, obstacle_grid
from planner.row_kernels import Layer
from worlds.types import BoolArray, FloatArray, IntArray

CURVE_RAD = 0.35  # turns up to this need no room of their own
TurnPrices = Callable[[FloatArray], FloatArray]  # turns (N,), left positive -> prices in radians (N,)
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

    @property
    def prices(self) -> tuple[float, ...]:
        """What `row_kernels.cell_costs` charges."""
        unseen = (self.near_unseen_cost, self.unseen_cost, self.near_unseen_m)
        return (self.hill_cost, self.near_cost, *unseen, self.rough_cost, self.space_cost, self.off_line_cost)


@dataclass(frozen=True, eq=False)
class Task:
    """One search: from where, whither, and with which berth."""

    frame: Frame2
    length_m: float  # rows go so far, at most the model's depth
    heading_rad: float  # of the rover, in the world
    need_m: float  # centre line to hard rock
    end_cost: EndCost
    turn_range_rad: tuple[float, float] = (-np.pi, np.pi)  # how far the rover can turn on the spot, right and left
    turn_prices: TurnPrices = np.abs


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


@dataclass(frozen=True, eq=False)
class RowMap:
    """The ground as one row search sees it, in the frame of its task."""

    grid: ObstacleGrid
    hard: FloatArray  # (N, 7) the hard obstacles
    unseen: Layer  # (rows + 1, columns) 1 where nobody has seen the ground
    roughness: Layer  # (rows + 1, columns)
    spaces: IntArray  # (rows + 1, most, 2) first and last column of each free space, padded
    counts: IntArray  # (rows + 1,) how many there are
    cost: Layer  # (nx, columns) of a metre


def search(
    table_w: FloatArray, cells: GroundCells, task: Task, drive: DriveModel, model: RowModel | None = None
) -> RowSearch:
    """Free ways from the rover along the frame of ``task`` among the obstacles ``table_w`` (N, 7) of the world."""
    model = model or RowModel()
    return search_rows(row_map(table_w, cells, task, drive, model), task, drive, model)


def row_map(table_w: FloatArray, cells: GroundCells, task: Task, drive: DriveModel, model: RowModel) -> RowMap:
    """Clearance, hilly field, free spaces and costs along the frame of ``task``."""
    reach = float(np.hypot(model.depth_m, model.half_width_m)) + 1.5
    table = around(table_w, task.frame, reach, task.need_m)
    length, sub = min(task.length_m, model.depth_m), model.sub_rows
    rows = max(1, round(length / model.row_m))
    columns = 2 * round(model.half_width_m / model.cell_m) + 1
    limits = (-model.half_width_m, model.half_width_m)
    grid = obstacle_grid(table, (0.0, length), limits, (rows * sub + 1, columns))
    steps = (grid.x0_m, grid.y0_m, sub * grid.step_x_m, grid.step_y_m)
    frame = (*task.frame.origin_w, task.frame.heading_rad)
    unseen, rough = sample_grid(cells, frame, steps, (rows + 1, columns))
    beyond = round(0.5 / grid.step_y_m)
    layers = grid.clearance_m, grid.hill
    spaces, counts, risk = kernels.spaces_and_risk(*layers, sub, task.need_m, columns // 2, beyond)
    sizes = grid.step_x_m, grid.step_y_m, task.need_m, drive.comfort_m
    cost = kernels.cell_costs(*layers, unseen, rough, risk, sub, *sizes, model.prices)
    hard = np.ascontiguousarray(table[table[:, 6] > 0.5])
    return RowMap(grid, hard, unseen, rough, spaces, counts, cost)


def search_rows(ground: RowMap, task: Task, drive: DriveModel, model: RowModel) -> RowSearch:
    """The search itself over a map that is made."""
    grid, turning = ground.grid, (model.turn_cost, model.most_turn)
    columns = grid.hill.shape[1]
    sizes = task.need_m, model.sub_rows, model.most_shift, grid.step_x_m, grid.step_y_m
    edges = kernels.edge_costs(grid.clearance_m, ground.cost, *sizes)
    rows = len(edges)
    distance = np.linspace(0.0, grid.step_x_m * model.sub_rows * rows, rows + 1)
    spaces = tuple(part[:count] for part, count in zip(ground.spaces, ground.counts, strict=True))
    forward = kernels.search_forward(edges, columns // 2, _first_costs(task, grid, model), *turning)
    last = int(np.isfinite(forward.min(axis=(1, 2))).nonzero()[0].max(initial=0))
    if last == 0:
        return RowSearch((), 1, distance, spaces)
    y = grid.y0_m + grid.step_y_m * np.arange(columns)
    final = task.end_cost(task.frame.to_world(np.stack([np.full(columns, distance[last]), y], axis=1)))
    backward = kernels.search_backward(edges, final, last, *turning)
    ways, costs = kernels.ways_through(forward, backward, edges, ground.spaces, ground.counts, *turning)
    order = np.argsort(costs, kind="stable")[: model.candidates]
    candidates = tuple(
        _candidate(ways[n], float(costs[n]), ground, task, drive, model, complete=last == rows) for n in order
    )
    return RowSearch(candidates, None if last == rows else last + 1, distance, spaces)


def _first_costs(task: Task, grid: ObstacleGrid, model: RowModel) -> FloatArray:
    """Cost of setting out with each shift: the turn on the spot; inf where the rover has no room for it."""
    shifts = np.arange(-model.most_shift, model.most_shift + 1)
    direction = task.frame.heading_rad + np.arctan2(shifts * grid.step_y_m, grid.step_x_m * model.sub_rows)
    turn = (direction - task.heading_rad + np.pi) % (2 * np.pi) - np.pi
    return np.where(room_for(turn, task.turn_range_rad), model.first_turn_cost * task.turn_prices(turn), np.inf)


def room_for(turns_rad: FloatArray, range_rad: tuple[float, float]) -> BoolArray:
    """Which turns (N,), left positive, there is room for; small ones are driven as a curve, not on the spot."""
    right, left = range_rad
    room: BoolArray = (turns_rad >= min(right, -CURVE_RAD)) & (turns_rad <= max(left, CURVE_RAD))
    return room


def _candidate(
    way: IntArray, cost: float, ground: RowMap, task: Task, drive: DriveModel, model: RowModel, *, complete: bool
) -> Candidate:
    rows, grid, hard = np.arange(len(way)), ground.grid, ground.hard
    path = np.stack([grid.x0_m + grid.step_x_m * model.sub_rows * rows, grid.y0_m + grid.step_y_m * way], axis=1)
    kept = path[simplify(hard, path, task.need_m, 0.6 * drive.comfort_m, model.most_leg_m)]
    steps = np.diff(kept, axis=0)
    return Candidate(
        waypoints_w=task.frame.to_world(kept),
        cost=cost,
        length_m=float(np.hypot(steps[:, 0], steps[:, 1]).sum()),
        clearance_m=float(least_clearance(hard, kept, MAX_CLEARANCE_M).min(initial=MAX_CLEARANCE_M)),
        hill=float(grid.hill[rows * model.sub_rows, way].mean()),
        roughness=float(ground.roughness[rows, way].mean()),
        unseen=float(ground.unseen[rows, way].mean()),
        complete=complete,
    )
