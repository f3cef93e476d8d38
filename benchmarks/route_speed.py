"""Speed and quality of route planning on 500 x 500 m at 1 m: how near to the best, how often rightly refused.

    uv run python benchmarks/route_speed.py [--first 0] [--maps 20] [--goals 5] [--error 0.1] [--worlds FOLDER]

A true map of fractal hills (waves of 120 to 4 m) is measured with an error, one sigma a cell, white. Between pairs of
places that may truly be driven on, 100 to 500 m apart, a route of the Husky is planned on the measured map and driven
on the true one, where no slope may hold the rover up; the best is planned on the true one. Where that finds no way
within the planner's limits, there may be one that holds nothing up, or none at all. Then goals inside a ring of steep
ground, with and without a gap. With --worlds, a real elevation map (marsyard2022_hm.tif in that folder, about
50 x 50 m) is measured at 0.5 m instead, goals 15 to 60 m apart. Times are processor time, least of three.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from planner.denoise import denoised
from planner.route import CostMap, Place, Refusal, Route, cost_map, plan_route, way_cost
from planner.route_cost import HOLDS_UP, slope_costs
from planner.route_ground import ElevationMap
from rover_sim.sim.rover import load_rover
from worlds.dem import load_dem
from worlds.scenario import Terrain
from worlds.synthesis import fractal
from worlds.types import HeightField

SIDE = 501
HILLS_M = (120.0, 4.0)
RMS_M = (1.0, 1.5, 2.0, 2.5, 3.0)
HUSKY = load_rover("husky").footprint()
COSTS, HELD_UP = slope_costs("mars_sand", HUSKY, "husky"), slope_costs("mars_sand", HUSKY, "husky", HOLDS_UP)
YARD = "marsyard2022_hm.tif"


def hills(seed: int, rms_m: float) -> HeightField:
    """A true map."""
    flat = HeightField(np.zeros((SIDE, SIDE)), 1.0, (0.0, 0.0))
    return HeightField(fractal(flat, rms_m, np.random.default_rng(seed), HILLS_M), 1.0, (0.0, 0.0))


def yard(folder: Path) -> HeightField:
    """The real map at 0.5 m."""
    terrain = Terrain(kind="dem", path=str(folder / YARD), resolution_m=0.5)
    return load_dem(terrain, "--worlds", np.random.default_rng(0)).field


def measured(truth: HeightField, error_m: float, rng: np.random.Generator) -> ElevationMap:
    """The map as somebody who flew over it has it."""
    heights = truth.heights_m + rng.normal(0.0, error_m, truth.heights_m.shape)
    return denoised(ElevationMap.of(HeightField(heights, truth.resolution_m, truth.origin_m), error_m))


def pairs(
    truth: CostMap, count: int, apart_m: tuple[float, float], rng: np.random.Generator
) -> Iterator[tuple[Place, Place]]:
    """Start and goal on ground that may be driven on, some distance apart."""
    rows, columns = np.nonzero(np.isfinite(truth.care))
    while count:
        one, two = rng.integers(len(rows), size=2)
        start, goal = (truth.place((int(rows[n]), int(columns[n]))) for n in (one, two))
        if apart_m[0] <= np.hypot(start[0] - goal[0], start[1] - goal[1]) <= apart_m[1]:
            count -= 1
            yield start, goal


@dataclass(frozen=True, eq=False)
class Truth:
    """The true map by the limits of the planner, and by those at which slopes hold the rover up."""

    wanted: CostMap
    possible: CostMap

    @staticmethod
    def of(field: HeightField) -> Truth:
        """Both maps of true heights."""
        ground = ElevationMap.of(field)
        return Truth(cost_map(ground, COSTS), cost_map(ground, HELD_UP))


def judged(truth: Truth, best: Route, planned: Route, ends: tuple[Place, Place]) -> tuple[str, float]:
    """What there is and what became of a plan, and its true cost over the best."""
    there = "a way"
    if best.refusal is not None:
        only = plan_route(truth.possible, *ends)
        there = "only one over the limits" if only.refusal is None else "no way"
    if planned.refusal is not None:
        return f"{there}: refused", np.nan
    cost = way_cost(truth.possible, planned.way_w)
    return (
        f"{there}: planned{', is held up' if np.isinf(cost) else ''}",
        cost / best.cost if best.refusal is None else np.nan,
    )


def spent_s(truth: HeightField, error_m: float, ends: tuple[Place, Place]) -> tuple[float, float, float]:
    """Least processor time of filtering the noise, of making the cost map and of planning on it."""
    times = []
    for _ in range(3):
        marks = [time.process_time()]
        ground = measured(truth, error_m, np.random.default_rng(0))
        marks.append(time.process_time())
        map_ = cost_map(ground, COSTS)
        marks.append(time.process_time())
        plan_route(map_, *ends)
        times.append(np.diff([*marks, time.process_time()]))
    filtered, made, found = np.min(times, axis=0).tolist()
    return filtered, made, found


def ringed(seed: int, *, gap: bool) -> HeightField:
    """Hills with a ridge of 30 degrees and more all round the middle, 40 m away from it; a gap is 12 m wide."""
    truth, rng = hills(seed, 1.0), np.random.default_rng([seed, 2])
    x, y = np.meshgrid(np.arange(SIDE) - SIDE // 2, np.arange(SIDE) - SIDE // 2)
    ridge = 5.0 * np.exp(-0.5 * ((np.hypot(x, y) - 40.0) / 4.0) ** 2)
    if gap:
        turn = (np.arctan2(y, x) - rng.uniform(-np.pi, np.pi) + np.pi) % (2 * np.pi) - np.pi
        ridge *= 1.0 - np.exp(-((40.0 * np.abs(turn) / 9.0) ** 6))
    return HeightField(truth.heights_m + ridge, truth.resolution_m, truth.origin_m)


def into_rings(seeds: range, error_m: float) -> None:
    """Routes from outside to the middle of rings."""
    for gap in (False, True):
        counts: Counter[str] = Counter()
        for seed in seeds:
            field, rng = ringed(seed, gap=gap), np.random.default_rng([seed, 3])
            truth, map_ = Truth.of(field), cost_map(measured(field, error_m, rng), COSTS)
            for angle in rng.uniform(0.0, 2.0 * np.pi, 3):
                ends = (250.0 + 150.0 * np.cos(angle), 250.0 + 150.0 * np.sin(angle)), (250.0, 250.0)
                best = plan_route(truth.wanted, *ends)
                if best.refusal in {None, Refusal.NO_WAY}:
                    counts[judged(truth, best, plan_route(map_, *ends), ends)[0]] += 1
        print(f"rings {'with' if gap else 'without'} a gap: {told(counts)}", flush=True)


def told(counts: Counter[str]) -> str:
    """Counts in words."""
    return "; ".join(f"{kind} {count}" for kind, count in sorted(counts.items()))


def over_hills(options: argparse.Namespace, rms_m: float) -> None:
    """A line for a height of hills, or for the real map."""
    apart = (100.0, 500.0) if options.worlds is None else (15.0, 60.0)
    counts: Counter[str] = Counter()
    ratios, slopes = [], []
    for seed in range(options.first, options.first + options.maps):
        field = hills(seed, rms_m) if options.worlds is None else yard(options.worlds)
        rng = np.random.default_rng([seed, 1])
        truth, map_ = Truth.of(field), cost_map(measured(field, options.error, rng), COSTS)
        slopes.append(truth.wanted.layers.slope_deg.ravel())
        for ends in pairs(truth.wanted, options.goals, apart, rng):
            kind, ratio = judged(truth, plan_route(truth.wanted, *ends), plan_route(map_, *ends), ends)
            counts[kind] += 1
            ratios.append(ratio)
    known = np.array(ratios)[np.isfinite(ratios)]
    name = YARD if options.worlds is not None else f"hills of {rms_m:.1f} m rms"
    half, most = np.percentile(np.concatenate(slopes), [50, 99])
    print(f"{name} (slopes {half:.0f} deg, at most {most:.0f} but for 1 %): {told(counts)}")
    if len(known):
        p95, most = np.percentile(known, [95, 100])
        print(f"    true cost over best: mean {known.mean():.3f}, p95 {p95:.3f}, max {most:.3f}", flush=True)


def main() -> None:
    """Print times, then a line a height of hills."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--first", type=int, default=0, help="seed of the first map")
    parser.add_argument("--maps", type=int, default=20)
    parser.add_argument("--goals", type=int, default=5)
    parser.add_argument("--error", type=float, default=0.1, help="one sigma of a height, m")
    parser.add_argument("--worlds", type=Path)
    options = parser.parse_args()
    if options.worlds is not None:
        over_hills(options, 0.0)
        return
    truth = hills(0, 1.0)
    ends = next(pairs(cost_map(ElevationMap.of(truth), COSTS), 1, (400.0, 500.0), np.random.default_rng(0)))
    ground = measured(truth, options.error, np.random.default_rng(0))
    plan_route(cost_map(ground, COSTS), *ends)  # compiles
    filtered, made, found = spent_s(truth, options.error, ends)
    print(f"{SIDE} x {SIDE} cells: noise filtered {filtered:.3f} s, cost map {made:.3f} s, route {found:.3f} s")
    into_rings(range(options.first, options.first + options.maps), options.error)
    for rms in RMS_M:
        over_hills(options, rms)


if __name__ == "__main__":
    main()
