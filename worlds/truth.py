"""What only the world knows and scoring may use; nothing here reaches the rover."""

from __future__ import annotations

import numpy as np

from worlds.heightfield import grid_points
from worlds.types import BoolArray, FloatArray, World


def obstacle_discs(world: World) -> FloatArray:
    """Every rock with a mesh and every cylinder as a disc around all of it: (N, 4) x, y, radius, height in metres."""
    length, _, height = world.rocks.extents_m.T
    rocks = np.column_stack([world.rocks.position_w[:, :2], length / 2.0, height])
    cylinders = [(*item.position_w[:2], item.radius_m, item.height_m) for item in world.cylinders]
    return np.concatenate([rocks, np.array(cylinders, dtype=np.float64).reshape(-1, 4)])


def free_cells(world: World, footprint_radius_m: float, max_height_m: float) -> BoolArray:
    """Grid points (ny, nx) where a disc of that radius touches no obstacle higher than ``max_height_m``."""
    x, y = grid_points(world.ground)
    free = np.ones(world.ground.heights_m.shape, dtype=bool)
    for centre_x, centre_y, radius, height in obstacle_discs(world):
        if height <= max_height_m:
            continue
        reach = radius + footprint_radius_m
        columns = slice(*np.searchsorted(x, (centre_x - reach, centre_x + reach)))
        rows = slice(*np.searchsorted(y, (centre_y - reach, centre_y + reach)))
        distance2 = (x[columns][None, :] - centre_x) ** 2 + (y[rows][:, None] - centre_y) ** 2
        free[rows, columns] &= distance2 >= reach**2
    return free


def reachable(world: World, footprint_radius_m: float, max_height_m: float) -> bool:
    """Whether a disc of that radius can get from the start into the goal's circle past all higher obstacles.

    The map's edge does not block, nor do slopes. Start and goal count as the nearest grid points.
    """
    from scipy.ndimage import label

    free = free_cells(world, footprint_radius_m, max_height_m)
    regions, _ = label(free)
    x, y = grid_points(world.ground)
    column = int(np.abs(x - world.start.position_w[0]).argmin())
    row = int(np.abs(y - world.start.position_w[1]).argmin())
    region = regions[row, column]
    goal_radius = max(world.scenario.goal.radius_m, world.ground.resolution_m)
    near_goal = (x[None, :] - world.goal_w[0]) ** 2 + (y[:, None] - world.goal_w[1]) ** 2 <= goal_radius**2
    return bool(region > 0 and (regions[near_goal] == region).any())
