"""The way that somebody who knew the true map could drive: for SPL, and to tell a refusal from a failure."""

from __future__ import annotations

import numpy as np

from planner.field_kernels import cost_to_go
from planner.obstacle_map import obstacle_grid, segment_clearance
from planner.route import CostMap, Route, cost_map, plan_route
from planner.route_cost import HOLDS_UP, slope_costs
from planner.route_ground import ElevationMap
from rover_sim.route_map import averaged
from rover_sim.true_obstacles import obstacle_table
from worlds.types import FloatArray, Footprint, World

STEP_M = 0.05
AROUND_M = 6.0  # ground beside start and goal that a way round may use


def oracle_length_m(world: World, footprint: Footprint) -> float | None:
    """Length of the oracle's way; None where there is none."""
    way = oracle_way(world, footprint)
    return None if way is None else float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def oracle_way(world: World, footprint: Footprint) -> FloatArray | None:
    """About the shortest way (N, 2) into the goal's circle; None where there is none.

    The way keeps half the rover's width from every obstacle higher than its belly. Turning needs room too, which this
    leaves out.
    """
    table = obstacle_table(world, footprint.clearance_m)
    need = footprint.width_m / 2.0
    start, goal = world.start.position_w[:2], np.asarray(world.goal_w[:2])
    low, high = _limits(world, start, goal)
    shape = (round((high[0] - low[0]) / STEP_M) + 1, round((high[1] - low[1]) / STEP_M) + 1)
    grid = obstacle_grid(
        table, (low[0], low[0] + STEP_M * (shape[0] - 1)), (low[1], low[1] + STEP_M * (shape[1] - 1)), shape
    )
    places = np.stack(np.meshgrid(*(low[axis] + STEP_M * np.arange(shape[axis]) for axis in (0, 1)), indexing="ij"), -1)
    cost = np.where(grid.clearance_m >= need, 1.0, np.inf)
    radius = max(world.scenario.goal.radius_m, STEP_M)
    inside = (np.linalg.norm(places - goal, axis=-1) <= radius) & np.isfinite(cost)
    to_go, onward = cost_to_go(cost, np.where(inside, 0.0, np.inf), STEP_M)
    first = tuple(int(value) for value in np.round((start - low) / STEP_M))
    if not np.isfinite(to_go[first]):
        return None
    cells = [first[0] * shape[1] + first[1]]
    while onward.flat[cells[-1]] >= 0:
        cells.append(int(onward.flat[cells[-1]]))
    return _pulled(places.reshape(-1, 2)[cells], table, need - STEP_M)


def best_route(world: World, footprint: Footprint) -> tuple[CostMap, Route]:
    """The true map without its error, at the scale of the route's own, and the cheapest route over it."""
    scenario = world.scenario
    assert scenario.route is not None
    ground = ElevationMap.of(averaged(world, scenario.route.resolution_m))
    true_map = cost_map(ground, slope_costs(scenario.soil.preset, footprint, scenario.rover.model))
    return true_map, plan_route(true_map, scenario.rover.start_m, scenario.goal.position_m)


def way_there(world: World, footprint: Footprint, best: Route) -> str:
    """Which ways there are over the true map: ``within`` the limits of a route, only ``over`` them, or ``none``.

    The latter two by whether slopes hold the rover up, which they do not yet at its limits.
    """
    if best.refusal is None:
        return "within"
    scenario = world.scenario
    assert scenario.route is not None
    ground = ElevationMap.of(averaged(world, scenario.route.resolution_m))
    possible = cost_map(ground, slope_costs(scenario.soil.preset, footprint, scenario.rover.model, HOLDS_UP))
    over = plan_route(possible, scenario.rover.start_m, scenario.goal.position_m)
    return "over" if over.refusal is None else "none"


def _limits(world: World, start: FloatArray, goal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Corners of the ground that counts: around start and goal, and on the map."""
    x, y = world.ground.x_limits_m, world.ground.y_limits_m
    edges = np.array([[x[0], y[0]], [x[1], y[1]]])
    return np.maximum(np.minimum(start, goal) - AROUND_M, edges[0]), np.minimum(
        np.maximum(start, goal) + AROUND_M, edges[1]
    )


def _pulled(way: FloatArray, table: FloatArray, need_m: float) -> FloatArray:
    """The way pulled taut: points between which the straight line is free are left out."""
    kept, place = [way[0]], 0
    while place < len(way) - 1:
        ahead = len(way) - 1
        while ahead > place + 1 and segment_clearance(table, way[[place, ahead]]).min() < need_m:
            ahead = place + max(1, (ahead - place) * 3 // 4)
        kept.append(way[ahead])
        place = ahead
    return np.array(kept)
