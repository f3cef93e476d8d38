"""Start-up time and memory of large worlds: build, simulation, renderer, first and median frame, some driving.

Usage: ``python benchmarks/big_world.py [SIDE_M ...] [--cfa 0.05] [--detail 0.02]``; a fresh process for each side, so
that the peak of memory is its own. With ``--detail`` the ground is an elevation file of 1 m pixels with so much relief
(m, rms) added below them. Stages are wall time of that process, beside the processor time of the whole start; a smaller
world in the same run is the peer. The first run after an installation compiles, too.
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
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

DRIVE_S = 2.0


def peak_MB() -> float:
    """Most memory that this process has held; the system's own count for a child begins with that of its parent."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    line = next(line for line in status.read_text(encoding="ascii").splitlines() if line.startswith("VmHWM"))
    return float(line.split()[1]) / 1024


def measure(side_m: float, cfa: float, elevation: Path | None, detail_m: float) -> dict[str, float]:
    """Seconds and megabytes of each stage for a square world of 0.1 m cells, made or from an ``elevation`` file."""
    found: dict[str, float] = {}

    @contextmanager
    def stage(name: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        found[f"{name}_s"] = time.perf_counter() - begin
        found[f"{name}_MB"] = peak_MB()

    with stage("import"):
        import numpy as np

        from rover_sim.sim.renderer import make_renderer
        from rover_sim.sim.rover import load_rover
        from rover_sim.sim.simulation import Simulation
        from worlds.build import build_world
        from worlds.geometry import camera_pose
        from worlds.scenario import Goal, Rocks, Scenario, Terrain
    terrain = Terrain(size_m=(side_m, side_m), resolution_m=0.1)
    if elevation:
        terrain = Terrain(kind="dem", path=str(elevation), resolution_m=0.1, detail_m=detail_m)
    scenario = Scenario(
        name="big",
        terrain=terrain,
        rocks=Rocks(cfa=cfa),
        goal=Goal(position_m=(10.0, 0.0)),
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
    found["cpu_s"] = time.process_time()
    with stage("ten_frames"):
        for _ in range(10):
            renderer.render(camera, pose)
    with stage("drive"):
        for _ in range(round(DRIVE_S / simulation.dt)):
            simulation.step([2.0] * 4)
    found["rocks"] = len(world.rocks)
    return found


def write_elevation(path: Path, side_m: float) -> None:
    """Hills in pixels of 1 m, with the pixel size as a GeoTIFF has it."""
    import numpy as np
    import tifffile

    x = np.arange(side_m + 1.0)
    heights = 2.0 * np.sin(x / 23.0)[:, None] * np.sin(x / 31.0)
    tifffile.imwrite(path, heights.astype(np.float32), extratags=[(33550, "d", 3, (1.0, 1.0, 0.0), True)])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sides", nargs="*", type=float, default=[40.0, 100.0, 200.0, 500.0], metavar="SIDE_M")
    parser.add_argument("--cfa", type=float, default=0.05)
    parser.add_argument("--detail", type=float, default=0.0, metavar="M")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "hills.tif" if options.detail else None
            if path:
                write_elevation(path, options.sides[0])
            print(json.dumps(measure(options.sides[0], options.cfa, path, options.detail)))
        return
    stages = ("import", "build", "simulation", "renderer", "first_frame")
    columns = (*stages, "start s", "CPU s", "peak MB", "frame ms", "x real")
    print("side m    rocks  " + "  ".join(f"{name:>11}" for name in columns))
    for side in options.sides:
        command = [sys.executable, __file__, str(side), "--cfa", str(options.cfa), "--detail", str(options.detail)]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run([*command, "--one"], env=environment, check=True, capture_output=True, text=True)  # noqa: S603
        found = json.loads(done.stdout)
        numbers = [found[f"{name}_s"] for name in stages]
        numbers += [sum(numbers), found["cpu_s"], found["drive_MB"]]
        numbers += [100 * found["ten_frames_s"], DRIVE_S / found["drive_s"]]
        print(f"{side:6g} {found['rocks']:8.0f}  " + "  ".join(f"{number:11.2f}" for number in numbers), flush=True)


if __name__ == "__main__":
    main()
