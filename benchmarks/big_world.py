"""Start-up time and memory of large worlds: build, simulation, renderer, first and median frame, some driving.

Usage: ``python benchmarks/big_world.py [SIDE_M ...] [--cfa 0.05]``; a fresh process for each side, so that the peak of
memory is its own. Times are wall time of that process; a smaller world in the same run is the peer.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

DRIVE_S = 2.0


def measure(side_m: float, cfa: float) -> dict[str, float]:
    """Seconds and megabytes of each stage for a square world of 0.1 m cells."""
    found: dict[str, float] = {}

    @contextmanager
    def stage(name: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        found[f"{name}_s"] = time.perf_counter() - begin
        found[f"{name}_MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

    with stage("import"):
        import numpy as np

        from rover_sim.sim.renderer import make_renderer
        from rover_sim.sim.rover import load_rover
        from rover_sim.sim.simulation import Simulation
        from worlds.build import build_world
        from worlds.geometry import camera_pose
        from worlds.scenario import Goal, Rocks, Scenario, Terrain
    scenario = Scenario(
        name="big",
        terrain=Terrain(size_m=(side_m, side_m), resolution_m=0.1),
        rocks=Rocks(cfa=cfa),
        goal=Goal(position_m=(20.0, 0.0)),
    )
    with stage("build"):
        world = build_world(scenario, 1)
    rover = load_rover("husky")
    with stage("simulation"):
        simulation = Simulation(world, rover, np.random.default_rng(0))
    with stage("renderer"):
        renderer = make_renderer(world)
    camera = rover.camera(scenario.camera)
    pose = camera_pose(simulation.state.pose, camera)
    with stage("first_frame"):
        renderer.render(camera, pose)
    with stage("ten_frames"):
        for _ in range(10):
            renderer.render(camera, pose)
    with stage("drive"):
        for _ in range(round(DRIVE_S / simulation.dt)):
            simulation.step([2.0] * 4)
    found["rocks"] = len(world.rocks)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sides", nargs="*", type=float, default=[40.0, 100.0, 200.0, 500.0], metavar="SIDE_M")
    parser.add_argument("--cfa", type=float, default=0.05)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.sides[0], options.cfa)))
        return
    stages = ("import", "build", "simulation", "renderer", "first_frame")
    print(
        "side m    rocks  " + "  ".join(f"{name:>11}" for name in (*stages, "start s", "peak MB", "frame ms", "x real"))
    )
    for side in options.sides:
        command = [sys.executable, __file__, str(side), "--cfa", str(options.cfa), "--one"]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)  # noqa: S603
        found = json.loads(done.stdout)
        start = sum(found[f"{name}_s"] for name in stages)
        numbers = [found[f"{name}_s"] for name in stages]
        numbers += [start, found["drive_MB"], 100 * found["ten_frames_s"], DRIVE_S / found["drive_s"]]
        print(f"{side:6g} {found['rocks']:8.0f}  " + "  ".join(f"{number:11.2f}" for number in numbers), flush=True)


if __name__ == "__main__":
    main()
