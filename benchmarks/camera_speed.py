"""Time of the camera: the rasteriser in a dense rock field, with PyBullet's TinyRenderer beside it.

Usage: ``python benchmarks/camera_speed.py [--frames 40] [--cfa 0.1] [--tiny-frames 3]``. All times are processor
time of one thread, so that other work on the machine counts less. Compilation is timed in a fresh process with an
empty cache, loading in one with a full cache.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from rover_sim.sim.renderer import Renderer, make_renderer
from rover_sim.sim.tiny_renderer import TinyRenderer
from worlds.build import build_world
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.heightfield import height_at
from worlds.scenario import Rocks, Scenario, Terrain
from worlds.types import CameraModel, Pose, World

FIRST_FRAME = """
import time
start = time.process_time()
import numpy as np
from rover_sim.sim.renderer import make_renderer
import rover_sim.sim.rasteriser
loaded = time.process_time()
from worlds.build import build_world
from worlds.scenario import Goal, Rocks, Scenario, Terrain
from worlds.types import CameraModel, Pose
terrain = Terrain(kind="flat", size_m=(8.0, 8.0))
world = build_world(Scenario(name="small", terrain=terrain, rocks=Rocks(cfa=0.05), goal=Goal(position_m=(2.0, 0.0))), 1)
built = time.process_time()
renderer = make_renderer(world)
renderer.render(CameraModel(320, 240, 207.8), Pose(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0, 0.0])))
print(loaded - start, time.process_time() - built)
"""


def lens(width: int, height: int) -> CameraModel:
    """The default camera: 75.2 degrees across, looking 25 degrees down."""
    return CameraModel(width, height, width / 2 / float(np.tan(np.radians(37.6))), pitch_rad=float(np.radians(25.0)))


def poses(world: World, camera: CameraModel, count: int) -> list[Pose]:
    """Places and headings in the inner part of the map, lens 1.1 m above the ground."""
    rng = np.random.default_rng(7)
    (x0, x1), (y0, y1) = world.ground.x_limits_m, world.ground.y_limits_m
    found = []
    for _ in range(count):
        x = rng.uniform(0.6 * x0 + 0.4 * x1, 0.4 * x0 + 0.6 * x1)
        y = rng.uniform(0.6 * y0 + 0.4 * y1, 0.4 * y0 + 0.6 * y1)
        place = np.array([x, y, float(height_at(world.ground, x, y)) + 1.1])
        found.append(camera_pose(Pose(place, quaternion_from_euler(0.0, 0.0, rng.uniform(-np.pi, np.pi))), camera))
    return found


def milliseconds(work: Callable[[], object]) -> float:
    """Processor time of one call."""
    start = time.process_time()
    work()
    return 1e3 * (time.process_time() - start)


def time_frames(
    renderer: Renderer, camera: CameraModel, at: list[Pose]
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Milliseconds of each frame; one more is taken first and not counted."""
    renderer.render(camera, at[0])
    return np.array([milliseconds(partial(renderer.render, camera, pose)) for pose in at])


def first_frame(cache: str) -> tuple[float, float]:
    """Seconds to import, and to make a renderer of a small world with its first frame, in a fresh process."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(  # noqa: S603  (our own text)
        [sys.executable, "-c", FIRST_FRAME], env=environment, check=True, capture_output=True, text=True
    )
    imported, drawn = done.stdout.split()
    return float(imported), float(drawn)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--tiny-frames", type=int, default=3)
    parser.add_argument("--cfa", type=float, default=0.10)
    options = parser.parse_args()
    scenario = Scenario(name="camera-speed", terrain=Terrain(), rocks=Rocks(cfa=options.cfa))
    world = build_world(scenario, 3)
    rows, columns = world.ground.heights_m.shape
    print(f"world: {columns} x {rows} samples, {len(world.rocks)} rocks, {len(world.picture_mesh.faces)} faces")
    start = time.process_time()
    renderer = make_renderer(world)
    print(f"make_renderer: {time.process_time() - start:.2f} s")
    median = {}
    for width, height in [(320, 240), (640, 480)]:
        camera = lens(width, height)
        taken = time_frames(renderer, camera, poses(world, camera, options.frames))
        median[width] = float(np.median(taken))
        low, high = np.percentile(taken, [5, 95])
        print(f"rasteriser {width}x{height}: median {median[width]:.1f} ms, 5-95 % {low:.1f}-{high:.1f} ms")
    if options.tiny_frames:
        camera = lens(320, 240)
        with TinyRenderer(world) as tiny:
            slow = float(np.median(time_frames(tiny, camera, poses(world, camera, options.tiny_frames))))
        print(f"TinyRenderer 320x240, shadow: median {slow:.0f} ms, {slow / median[320]:.0f} times the rasteriser's")
    with tempfile.TemporaryDirectory() as cache:
        cold, warm = first_frame(cache), first_frame(cache)
    print(f"import {warm[0]:.2f} s; small world and first frame: {cold[1]:.1f} s cold, {warm[1]:.2f} s from cache")


if __name__ == "__main__":
    main()
