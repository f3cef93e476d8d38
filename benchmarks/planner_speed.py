"""Speed of navigation decisions, and the row search against three A* on the same obstacle map.

    uv run python benchmarks/planner_speed.py [--cfa 0.10] [--seeds 20]

All go over the row search's own cost grid (8-connected, 5 cm) from the rover to the end of the row search's best way:
one compiled by numba with a binary heap and the octile distance times the least cost as its admissible heuristic, the
same one as plain Python, and scikit-image's `graph.route_through_array` (no heuristic). Risk is the mean of the hilly
field along a way.
The map is made once for all and is told separately. Times are processor time.
"""

from __future__ import annotations

import argparse
import heapq
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numba as nb
import numpy as np
from skimage.graph import route_through_array

sys.path.insert(0, str(Path(__file__).parents[1]))

from planner import obstacle_map as om
from planner.ground_cells import empty_cells
from planner.row_search import Candidate, RowMap, RowModel, Task, row_map, search_rows
from tests.planner_factory import FOOTPRINT, DiscWorld, rock_field, traverse
from worlds.types import FloatArray, IntArray

DRIVE = om.DriveModel()
NEED = DRIVE.need_m(FOOTPRINT)
GOAL = np.array([20.0, 0.0])
REPEATS = 5


@nb.njit(cache=True)
def a_star(
    cost: FloatArray, start: tuple[int, int], goal: tuple[int, int], step: tuple[float, float], least: float
) -> IntArray:
    """Cells (N, 2) of the cheapest way over a grid whose metre costs ``cost``, inf where blocked; empty if none."""
    nx, ny = cost.shape
    best = np.full((nx, ny), np.inf)
    before = np.full(nx * ny, -1, dtype=np.int32)
    closed = np.zeros((nx, ny), dtype=np.bool_)
    best[start] = 0.0
    heap = [(0.0, start[0] * ny + start[1])]
    while len(heap) > 0:
        _, flat = heapq.heappop(heap)
        ix, iy = flat // ny, flat % ny
        if closed[ix, iy]:
            continue
        closed[ix, iy] = True
        if ix == goal[0] and iy == goal[1]:
            break
        for jx in range(max(ix - 1, 0), min(ix + 2, nx)):
            for jy in range(max(iy - 1, 0), min(iy + 2, ny)):
                if closed[jx, jy] or not np.isfinite(cost[jx, jy]):
                    continue
                length = np.sqrt(((jx - ix) * step[0]) ** 2 + ((jy - iy) * step[1]) ** 2)
                total = best[ix, iy] + 0.5 * length * (cost[ix, iy] + cost[jx, jy])
                if total < best[jx, jy]:
                    best[jx, jy] = total
                    before[jx * ny + jy] = flat
                    # Cells are all but square: the smaller step keeps the octile distance a lower bound.
                    dx, dy = abs(goal[0] - jx), abs(goal[1] - jy)
                    rest = min(step) * (max(dx, dy) + 0.41421356 * min(dx, dy))
                    heapq.heappush(heap, (total + least * rest, jx * ny + jy))
    way = np.empty((nx * ny, 2), dtype=np.int32)
    count, flat = 0, goal[0] * ny + goal[1]
    while flat >= 0 and np.isfinite(best[goal]):
        way[count, 0], way[count, 1] = flat // ny, flat % ny
        count += 1
        flat = before[flat]
    return way[:count][::-1]


def obstacle_table(world: DiscWorld) -> FloatArray:
    """The world's rocks as the planner would remember them if it knew them exactly."""
    hard = world.height > FOOTPRINT.climb_height_m
    return np.column_stack([world.centre, world.centre, world.radius, np.clip(world.height / 0.25, 0.1, 1.0), hard])


def spent_ms(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Least processor time of a few repeats, milliseconds: others load the machine."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return 1e3 * min(times)


def peers(ground: RowMap, best: Candidate) -> dict[str, tuple[float, float, float]]:
    """Milliseconds, length and mean risk of each A* to the end of ``best``."""
    grid = ground.grid
    cost = np.where(grid.clearance_m < NEED, np.inf, ground.cost).astype(np.float64)
    steps = (grid.step_x_m, grid.step_y_m)
    start = (0, cost.shape[1] // 2)
    cost[start] = min(cost[start], 9.0)
    end = best.waypoints_w[-1]
    goal = round(end[0] / steps[0]), round((end[1] - grid.y0_m) / steps[1])
    least = float(cost.min())
    walled = np.where(np.isfinite(cost), cost, 1e6)
    ours = a_star(cost, start, goal, steps, least)
    theirs = np.array(route_through_array(walled, start, goal, geometric=True)[0])  # type: ignore[no-untyped-call]
    told = {}
    for name, way, work, repeats in (
        ("A*, numba", ours, lambda: a_star(cost, start, goal, steps, least), REPEATS),
        ("A*, Python", ours, lambda: a_star.py_func(cost, start, goal, steps, least), 1),
        ("A*, scikit-image", theirs, lambda: route_through_array(walled, start, goal, geometric=True), REPEATS),  # type: ignore[no-untyped-call]
    ):
        length = float(np.hypot(*(np.diff(way, axis=0) * steps).T).sum())
        told[name] = (spent_ms(work, repeats), length, float(grid.hill[way[:, 0], way[:, 1]].mean()))
    return told


def told(name: str, values: list[float]) -> None:
    """One line of percentiles."""
    p50, p95, most = np.percentile(values, [50, 95, 100])
    print(f"{name:44s} p50 {p50:7.2f}  p95 {p95:7.2f}  max {most:7.2f}")


def compare(worlds: list[DiscWorld]) -> None:
    """Row search and the A* on each world's map."""
    model, cells = RowModel(cell_m=0.05, most_shift=8, most_turn=6, turn_cost=0.03), empty_cells(np.zeros(2))
    task = Task(om.Frame2((0.0, 0.0), 0.0), 20.0, 0.0, NEED, lambda p: np.linalg.norm(p - GOAL, axis=1))
    columns: dict[str, list[float]] = {}
    for number, world in enumerate(worlds):
        table = obstacle_table(world)
        ground = row_map(table, cells, task, DRIVE, model)
        found = search_rows(ground, task, DRIVE, model)
        if found.blocked_row is not None or not found.candidates:
            print(f"world {number}: row {found.blocked_row} is blocked")
            continue
        best = found.candidates[0]
        rows_ms = spent_ms(lambda: search_rows(ground, task, DRIVE, model))  # noqa: B023 - called at once
        map_ms = spent_ms(lambda: row_map(table, cells, task, DRIVE, model))  # noqa: B023
        line = {"the map, ms": map_ms, "row search, ms": rows_ms, "row search, mean risk": best.hill}
        for name, (ms, length, risk) in peers(ground, best).items():
            line |= {f"{name}, ms": ms, f"{name}: its time over the row search's": ms / rows_ms}
            line |= {f"row search's length over that of {name}": best.length_m / length, f"{name}, mean risk": risk}
        for name, value in line.items():
            columns.setdefault(name, []).append(value)
    for name, values in columns.items():
        told(name, values)


def main() -> None:
    """Run both comparisons and print their figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cfa", type=float, default=0.10)
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    worlds = [rock_field(options.cfa, 20.0, np.random.default_rng(seed)) for seed in range(options.seeds)]
    compare(worlds)
    traverse(worlds[0], (20.0, 0.0), rng=np.random.default_rng(0))  # compiles
    spent_s: list[float] = []
    runs = []
    for seed, world in enumerate(worlds):
        run = traverse(world, (20.0, 0.0), rng=np.random.default_rng(1000 + seed), clock=time.process_time)
        spent_s += run.decision_s
        runs.append(run)
    told("one decision, closed loop, ms", [1e3 * value for value in spent_s])
    good = [run for run in runs if run.end == "arrived" and run.collisions == 0]
    excess = np.mean([run.length_m / 20.0 - 1.0 for run in good]) if good else np.nan
    print(
        f"CFA {options.cfa:.0%}: {len(good)} of {len(runs)} reached the goal untouched, path inefficiency {excess:.1%}"
    )


if __name__ == "__main__":
    main()
