"""The closed loop over many seeds: success, reasons, real-time factor.

    uv run python benchmarks/closed_loop.py rock-field --seeds 0:20 --workers 2
    uv run python benchmarks/closed_loop.py my-world.toml --seeds 0:5 --out runs/mine

Each seed runs in a process of its own kind (spawn), one thread each. With ``--out`` the run folders are kept.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

SHOWN = (
    "seed",
    "reason",
    "sim_time_s",
    "distance_m",
    "path_inefficiency",
    "collisions",
    "max_tilt_deg",
    "min_stability_margin",
    "mean_slip",
    "failsafe_stops",
    "missions_sent",
    "real_time_factor",
    "ttam",
)


def drive(name: str, seed: int, out: str | None) -> dict[str, Any]:
    """One traverse; its summary and, with ``out``, its run folder."""
    from rover_sim import run_folder
    from rover_sim.sights import Sights
    from rover_sim.sim.rover import load_rover
    from rover_sim.traverse import RunOptions, Traverse
    from worlds.build import build_world
    from worlds.scenario import load_scenario

    scenario = load_scenario(name)
    world = build_world(scenario, seed, source=name)
    with TemporaryDirectory() as scratch:
        folder = Path(out) / f"{scenario.name}-{seed}" if out else Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        with (
            Traverse(world, load_rover(scenario.rover.model), RunOptions(), folder / run_folder.TLOG) as traverse,
            Sights(20.0, None, scenario.camera.rate_hz) as sights,
        ):
            summary = traverse.run(on_sight=sights.take)
            if out:
                run_folder.write(folder, traverse, sights, summary)
    return summary


def wilson(successes: int, count: int) -> tuple[float, float]:
    """95 % score interval of a rate (Wilson, JASA 22, 1927)."""
    z2 = 1.96**2
    middle = (successes + z2 / 2) / (count + z2)
    half = 1.96 / (count + z2) * (successes * (count - successes) / count + z2 / 4) ** 0.5
    return middle - half, middle + half


def main() -> None:
    """Parse, drive all seeds, print a line each and the total."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="?", default="rock-field")
    parser.add_argument("--seeds", default="0:20", metavar="FIRST:END")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out")
    args = parser.parse_args()
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    seeds = range(*(int(part) for part in args.seeds.split(":")))
    rows = []
    with ProcessPoolExecutor(args.workers, mp_context=get_context("spawn")) as pool:
        for future in [pool.submit(drive, args.scenario, seed, args.out) for seed in seeds]:
            row = future.result()
            rows.append(row)
            print("  ".join(f"{key} {row[key]}" for key in SHOWN), flush=True)
    successes = sum(row["success"] for row in rows)
    low, high = wilson(successes, len(rows))
    factors = sorted(row["real_time_factor"] for row in rows)
    print(f"{successes} of {len(rows)} reach the goal (Wilson 95 %: {low:.3f} to {high:.3f})")
    tipped, touched = sum(row["reason"] == "tipped" for row in rows), sum(row["collisions"] for row in rows)
    print(f"tipped: {tipped}; collisions: {touched}")
    print(f"real-time factor: median {factors[len(factors) // 2]}, least {factors[0]}")


if __name__ == "__main__":
    main()
