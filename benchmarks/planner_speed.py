"""Speed of navigation decisions, and the row search against A* on the same obstacle map.

    uv run python benchmarks/planner_speed.py [--cfa 0.10] [--seeds 20]

A* is scikit-image's `graph.route_through_array` (best first with a heap, without a heuristic) on the same cost grid,
from the rover to the end of the row search's best way, so both answer the same question. Times are processor time.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from skimage.graph import route_through_array

sys.path.insert(0, str(Path(__file__).parents[1]))

from planner import obstacle_map as om
from planner.ground_cells import empty_cells
from planner.row_search import Candidate, RowModel, Task, search
from tests.planner_factory import FOOTPRINT, DiscWorld, rock_field, traverse
from worlds.types import FloatArray

DRIVE = om.DriveModel()
NEED = DRIVE.need_m(FOOTPRINT)
GOAL = np.array([20.0, 0.0])


def obstacle_table(world: DiscWorld) -> FloatArray:
    """The world's rocks as the planner would remember them if it knew them exactly."""
    hard = world.height > FOOTPRINT.climb_height_m
    return np.column_stack([world.centre, world.centre, world.radius, np.clip(world.height / 0.25, 0.1, 1.0), hard])


def row_search(table: FloatArray, model: RowModel) -> tuple[Candidate | None, float]:
    """Best complete way and milliseconds."""
    task = Task(om.Frame2((0.0, 0.0), 0.0), 20.0, 0.0, NEED, lambda p: np.linalg.norm(p - GOAL, axis=1))
    began = time.process_time()
    found = search(table, empty_cells(np.zeros(2)), task, DRIVE, model)
    spent = 1e3 * (time.process_time() - began)
    return (found.candidates[0] if found.candidates and found.blocked_row is None else None), spent


def a_star(table: FloatArray, end: FloatArray, cell_m: float) -> tuple[float, float]:
    """Length of the cheapest way on the grid to ``end`` and milliseconds, the making of the map included."""
    began = time.process_time()
    shape = (round(7.2 / cell_m) + 1, round(10.0 / cell_m) + 1)
    grid = om.obstacle_grid(om.let_leave(table, np.zeros(2), NEED), (0.0, 7.2), (-5.0, 5.0), shape)
    close = np.clip((NEED + DRIVE.comfort_m - grid.clearance_m) / DRIVE.comfort_m, 0.0, 1.0)
    cost = np.where(grid.clearance_m < NEED, 1e6, 1.0 + 0.8 * grid.hill + close**2)
    target = round(end[0] / cell_m), round((end[1] + 5.0) / cell_m)
    path, _ = route_through_array(cost, (0, shape[1] // 2), target, geometric=True)  # type: ignore[no-untyped-call]
    spent = 1e3 * (time.process_time() - began)
    return cell_m * float(np.linalg.norm(np.diff(np.array(path), axis=0), axis=1).sum()), spent


def told(name: str, values: list[float]) -> None:
    """One line of percentiles."""
    p50, p95, most = np.percentile(values, [50, 95, 100])
    print(f"{name:34s} p50 {p50:7.2f}  p95 {p95:7.2f}  max {most:7.2f}")


def main() -> None:
    """Run both comparisons and print their figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cfa", type=float, default=0.10)
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    worlds = [rock_field(options.cfa, 20.0, np.random.default_rng(seed)) for seed in range(options.seeds)]
    for cell in (0.10, 0.05):
        model = RowModel(cell_m=cell, most_shift=round(0.4 / cell), most_turn=round(0.3 / cell))
        row_search(obstacle_table(worlds[0]), model)  # compiles
        rows_ms, star_ms, ratios = [], [], []
        for world in worlds:
            table = obstacle_table(world)
            best, spent = row_search(table, model)
            if best is None:
                continue
            length, star = a_star(table, best.waypoints_w[-1], cell)
            rows_ms.append(spent)
            star_ms.append(star)
            ratios.append(best.length_m / length)
        told(f"row search, {cell:.2f} m cells, ms", rows_ms)
        told(f"A*, {cell:.2f} m cells, ms", star_ms)
        told("length of row search over A*", ratios)
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
