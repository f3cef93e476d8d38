"""What is still to go from every place the rover knows: the way out of a dead end.

Used when the row search finds no way straight to the goal. It covers a square around the rover; ground never seen
may be crossed at extra cost. If the goal lies outside, the square's border is charged the straight way from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.field_kernels import UNBOUNDED, Bounds, cost_to_go, metre_costs, seed_costs, values_at, way_onward
from planner.ground_cells import GroundCells, nearest_views, sample_grid
from planner.map_kernels import Layer
from planner.obstacle_map import DriveModel, let_leave, near, obstacle_grid
from worlds.types import FloatArray, IntArray

STEP_M = 0.15
HALF_SIZE_M = 13.5
UNSEEN_COST = (0.5, 2.0)  # least and most: ground unseen is taken to be as what was seen
HILL_COST = 0.8
NEAR_COST = 1.0
ROUGH_COST = 0.4
COUNT = round(2 * HALF_SIZE_M / STEP_M) + 1  # cells a side
GAP_COST = 10.0  # of a metre through a far gap that seems too narrow by all that may be doubted


@dataclass(frozen=True, eq=False)
class GoalField:
    """Cost to the goal at cells ``[ix, iy]`` from ``origin_w`` on; inf where it cannot be reached from."""

    origin_w: FloatArray  # (2,)
    cost_m: FloatArray  # (nx, ny)
    onward: IntArray  # (nx, ny) flat index of the next cell

    def at(self, places_w: FloatArray) -> FloatArray:
        """Cost at places (N, 2); inf outside the square."""
        values: FloatArray = values_at(self.cost_m, self.origin_w, STEP_M, places_w)
        return values

    def way(self, place_w: FloatArray, most_m: float) -> FloatArray:
        """Cells (N, 2) that lead from a place towards the goal, at most ``most_m`` long; empty if none does."""
        if not np.isfinite(self.at(place_w[None])[0]):
            return np.zeros((0, 2))
        ix, iy = (int(value) for value in np.round((place_w - self.origin_w) / STEP_M))
        return self.origin_w + STEP_M * way_onward(self.onward, (ix, iy), STEP_M, most_m)


@dataclass(frozen=True, eq=False)
class FieldGround:
    """What the rover knows of the ground in the square around a place: the same for every berth."""

    low_w: FloatArray  # (2,) of the first cell
    unseen: Layer  # (COUNT, COUNT) 1 where nobody has seen the ground
    roughness: Layer  # (COUNT, COUNT)
    away_m: Layer  # (COUNT, COUNT) how far off it was seen


def field_ground(cells: GroundCells, place_w: FloatArray) -> FieldGround:
    """The ground around ``place_w`` (2,)."""
    # Cells that moved along with the rover would open and close narrow gaps from look to look.
    low = STEP_M * np.round((place_w - HALF_SIZE_M) / STEP_M)
    frame = (float(low[0]), float(low[1]), 0.0)
    unseen, rough = sample_grid(cells, frame, (0.0, 0.0, STEP_M, STEP_M), (COUNT, COUNT))
    # What is doubted is judged by how near it was ever seen: a gap that proved too narrow stays so for who backs out.
    return FieldGround(low, unseen, rough, nearest_views(cells, place_w, low, STEP_M, (COUNT, COUNT)))


def goal_field(
    table_w: FloatArray,
    ground: FieldGround,
    place_w: FloatArray,
    goal_w: FloatArray,
    goal_radius_m: float,
    need_m: float,
    drive: DriveModel,
    bounds: Bounds = UNBOUNDED,
) -> GoalField:
    """Field around ``place_w`` (2,) of the cost to get well inside ``goal_radius_m`` of ``goal_w`` (2,).

    ``bounds``: where the search may end, see `cost_to_go`.
    """
    low, shape = ground.low_w, (COUNT, COUNT)
    high = low + STEP_M * (COUNT - 1)
    # The middle of the cell that the rover stands in must be free too, or it would seem walled in.
    table = let_leave(near(table_w, place_w, 1.5 * HALF_SIZE_M), place_w, need_m + STEP_M / np.sqrt(2.0))
    grid = obstacle_grid(table, (low[0], high[0]), (low[1], high[1]), shape)
    prices = (HILL_COST, NEAR_COST, UNSEEN_COST, ROUGH_COST, GAP_COST)
    gaps = (*drive.doubt_range_m, drive.doubt_gap_m)
    layers = grid.clearance_m, grid.hill, ground.unseen, ground.roughness, ground.away_m
    cost, fresh = metre_costs(*layers, need_m, drive.comfort_m, gaps, prices)
    beyond = bool(np.any(np.abs(goal_w - place_w) > HALF_SIZE_M - STEP_M))
    within_m = max(0.7 * goal_radius_m, STEP_M)
    # Beyond the square the way is unknown: it is charged as unseen ground.
    seeds = seed_costs(cost, low, STEP_M, goal_w, within_m, fresh if beyond else 0.0)
    here = round((place_w[0] - low[0]) / STEP_M), round((place_w[1] - low[1]) / STEP_M)
    field, onward = cost_to_go(cost, seeds, STEP_M, here, bounds)
    return GoalField(low, field, onward)
