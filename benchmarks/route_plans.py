"""Routes of the suite ``trials route`` planned and not driven: found where there is a way, refused where there is none.

    uv run python benchmarks/route_plans.py --ground swells [--first 6000] [--maps 20] [--distance 200]

Each seed's true ground is measured as the suite does it, and the first route is compared with the best one over the
true map (`rover_sim.trials.oracle`).
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from planner.route import cost_map, way_cost, without_limits
from planner.route_cost import HOLDS_UP, slope_costs
from rover_sim.route_map import first_route
from rover_sim.sim.rover import load_rover
from rover_sim.trials.oracle import best_route, way_there
from rover_sim.trials.suites import trials_of
from worlds.build import build_world

HUSKY = load_rover("husky").footprint()
HELD_UP = slope_costs("mars_sand", HUSKY, "husky", HOLDS_UP)


def planned(ground: str, distance_m: float, seed: int) -> tuple[str, str, float]:
    """Which ways there are, what became of the plan, and its true cost over the best; NaN where one is refused."""
    (trial,) = trials_of("route", {"ground": (ground,), "distance_m": (distance_m,)}, [seed], None)
    world = build_world(trial.scenario, seed, source=trial.key)
    true_map, best = best_route(world, HUSKY)
    way, following = way_there(world, HUSKY, best), first_route(world, HUSKY)
    assert following is not None
    route = following.route
    if route.refusal is not None:
        return way, "refused", np.nan
    held_up = np.isinf(way_cost(cost_map(true_map.ground, HELD_UP), route.way_w))
    over = way_cost(without_limits(true_map), route.way_w) / best.cost if best.refusal is None else np.nan
    return way, "planned, is held up" if held_up else "planned", over


def main() -> None:
    """Print counts and ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--ground", required=True, help="of the suite, as hills")
    parser.add_argument("--distance", type=float, default=200.0, help="m")
    parser.add_argument("--first", type=int, default=6000, help="seed of the first map")
    parser.add_argument("--maps", type=int, default=20)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.maps)
    rows = [planned(options.ground, options.distance, seed) for seed in seeds]
    for (way, became), count in sorted(Counter(row[:2] for row in rows).items()):
        print(f"{options.ground}, way {way}: {became} {count}")
    ratios = np.array([row[2] for row in rows])
    known = ratios[np.isfinite(ratios)]
    if len(known):
        p95, most = np.percentile(known, [95, 100])
        print(f"    true cost over best: mean {known.mean():.3f}, p95 {p95:.3f}, max {most:.3f}")


if __name__ == "__main__":
    main()
