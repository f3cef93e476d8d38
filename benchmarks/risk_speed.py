"""Processor time of risk forecasts: 200 rollouts of one leg, and of a whole route leg by leg.

    OMP_NUM_THREADS=1 uv run python benchmarks/risk_speed.py [--distance 200] [--seed 5]

The route is one of ``rover-sim trials route`` (crater), over its map from orbit; times are the least of three, after
one that compiles. The bound is 2 s for 200 rollouts on one core.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

from planner.risk import ROLLOUTS
from planner.route_risk import RouteRisk, route_risk
from rover_sim.risk_belief import risk_vehicle
from rover_sim.route_map import first_route
from rover_sim.sim.rover import load_rover
from rover_sim.trials.suites import trials_of
from worlds.build import build_world


def least_s(call: Callable[[], RouteRisk]) -> tuple[float, RouteRisk]:
    """Processor time of the fastest of three calls."""
    call()
    times = []
    for _ in range(3):
        begun_s = time.process_time()
        found = call()
        times.append(time.process_time() - begun_s)
    return min(times), found


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description="Processor time of risk forecasts.")
    parser.add_argument("--distance", type=float, default=200.0)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    (trial,) = trials_of("route", {"ground": ("crater",), "distance_m": (options.distance,)}, [options.seed], None)
    rover, world = load_rover(trial.scenario.rover.model), build_world(trial.scenario, options.seed)
    route = first_route(world, rover.footprint(), risk_vehicle(rover, trial.scenario))
    assert route is not None
    assert route.risk_model is not None
    model, ground, start = route.risk_model, route.store.coarse.field, trial.scenario.rover.start_m
    assert route.risk is not None
    longest = max(range(len(route.legs)), key=lambda number: route.legs[number].length_m)
    start_of_leg = tuple(route.risk.ways_w[longest][0].tolist())
    for name, origin, legs in (
        ("longest leg", start_of_leg, route.legs[longest : longest + 1]),
        ("whole route", start, route.legs),
    ):
        seconds, risk = least_s(partial(route_risk, model, ground, origin, legs, 0))
        length_m = sum(leg.length_m for leg in legs)
        print(
            f"{name}: {length_m:.0f} m, {len(legs)} legs, {ROLLOUTS} rollouts {seconds:.2f} s "
            f"(fails {100 * risk.whole.fails.probability:.0f} %)"
        )
    begun_s = time.process_time()
    hazard = model.hazard
    print(
        f"slope hazard for another route: {time.process_time() - begun_s:.2f} s ({len(hazard.along)} levels of error)"
    )


if __name__ == "__main__":
    main()
