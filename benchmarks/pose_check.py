"""Pose check against the truth: no unsafe pose may be called safe, and how many safe ones are called unsafe.

    uv run python benchmarks/pose_check.py [--poses 100000] [--rover husky] [--cells 0.05] [--sds 0.0]

Poses are drawn anywhere, also on rocks, on ground of several rock covers and slopes (fractal hills of 10 cm rms, rocks
as half ellipsoids, 12.5 mm grid). The truth is `tests/settling.py`: least height of the centre of mass from five first
guesses; a pose is unsafe if any rest that they find is, and safe if all are. The map that is checked has a plane
a cell and how far the ground leaves it, with ``--sds`` also an eye's error, bounded at three deviations.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from planner.pose_check import GroundBounds, PoseBounds, PoseLimits, pose_bounds, rigid_body
from rover_sim.sim.rover import load_rover
from tests.settling import settle, tilt
from worlds.heightfield import grid_points
from worlds.rock_field import HEIGHT_OVER_WIDTH, RockField, draw_rock_field
from worlds.scenario import Rocks, Terrain
from worlds.synthesis import synthesise
from worlds.types import BoolArray, FloatArray, HeightField

COVERS, SLOPES_DEG = (0.0, 0.05, 0.10, 0.15, 0.20), (0.0, 5.0, 10.0, 15.0)
SIZE_M, FINE_M, MARGIN_M = 14.0, 0.0125, 1.0
STARTS = np.array([[0.0, 0.0], [0.12, 0.0], [-0.12, 0.0], [0.0, 0.12], [0.0, -0.12]])
SIGMAS = 3.0
HANGING_M = 0.003


def true_ground(cover: float, slope_deg: float, seed: int) -> HeightField:
    """Hills, a tilt of any direction and rocks, all of it ground."""
    rng = np.random.default_rng(seed)
    terrain = Terrain(
        size_m=(SIZE_M, SIZE_M), resolution_m=FINE_M, slope_deg=slope_deg, slope_azimuth_deg=float(rng.uniform(0, 360))
    )
    ground = synthesise(terrain, (0.0, 0.0), rng)
    if cover > 0.0:
        rocks = draw_rock_field(Rocks(cfa=cover, clear_radius_m=0.0), ground, rng, rng, rng)
        add_rocks(ground, rocks)
    return ground


def add_rocks(ground: HeightField, rocks: RockField) -> None:
    """Raise the ground to half ellipsoids that stand on it."""
    x, y = grid_points(ground)
    base = ground.heights_m.copy()
    columns = (rocks.centres_m, rocks.lengths_m, rocks.widths_m, rocks.yaws_rad)
    for (cx, cy), length, width, yaw in zip(*columns, strict=True):
        (left, right), (low, high) = (
            np.searchsorted(axis, (c - length / 2, c + length / 2)).tolist() for axis, c in ((x, cx), (y, cy))
        )
        dx, dy = x[left:right] - cx, (y[low:high] - cy)[:, None]
        along, across = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
        dome = np.maximum(1.0 - (2 * along / length) ** 2 - (2 * across / width) ** 2, 0.0)
        part = np.s_[low:high, left:right]
        rise = HEIGHT_OVER_WIDTH * width * np.sqrt(dome)
        np.maximum(ground.heights_m[part], np.where(dome > 0, base[part] + rise, -np.inf), out=ground.heights_m[part])


def cell_bounds(ground: HeightField, cell_m: float, sd_m: float, rng: np.random.Generator) -> GroundBounds:
    """What a map of cells tells of the ground: a plane a cell that the ground is near to, by an eye's error if any."""
    count = round(cell_m / FINE_M)
    nodes = blocks(ground.heights_m, count)
    offset = (np.arange(count + 1) - count / 2) * FINE_M
    norm = (count + 1) * (offset**2).sum()
    middle = nodes.mean(axis=(2, 3))
    rise_y, rise_x = (nodes * offset[:, None]).sum(axis=(2, 3)) / norm, (nodes * offset).sum(axis=(2, 3)) / norm
    apart = (
        nodes - middle[..., None, None] - rise_x[..., None, None] * offset - rise_y[..., None, None] * offset[:, None]
    )
    low, high = apart.min(axis=(2, 3)), apart.max(axis=(2, 3))
    error = np.clip(rng.normal(0.0, sd_m, middle.shape), -SIGMAS * sd_m, SIGMAS * sd_m)
    # A millionth more, for single precision.
    half = 0.5 * (high - low) + SIGMAS * sd_m + 1e-6
    layers = np.stack([middle + 0.5 * (high + low) + error, rise_x, rise_y, half])
    return GroundBounds(np.array(ground.origin_m), cell_m, layers.astype(np.float32))


def blocks(heights: FloatArray, count: int) -> FloatArray:
    """The nodes (by, bx, count + 1, count + 1) in and around each block of ``count`` by ``count`` cells of a grid."""
    windows = np.lib.stride_tricks.sliding_window_view(heights, (count + 1, count + 1))
    return np.asarray(windows[::count, ::count])


def truly(rests: FloatArray, limits: PoseLimits) -> tuple[BoolArray, BoolArray]:
    """Which poses (N,) are safe in every rest found, and which are not in one; neither where none came to rest."""
    rest = rests[..., 5] < HANGING_M
    bad = tilt(rests[..., 0], rests[..., 1]) >= limits.tilt_rad
    bad |= (rests[..., 3] < limits.clearance_m) | (rests[..., 4] < limits.margin_rad)
    safe, unsafe = rest.any(axis=1) & ~(bad & rest).any(axis=1), (bad & rest).any(axis=1)
    return np.asarray(safe), np.asarray(unsafe)


def outside(bounds: PoseBounds, rests: FloatArray, limits: PoseLimits) -> int:
    """How many poses called safe have a rest within the limits of lean whose figures leave the bounds."""
    safe = (
        bounds.safe(limits)[:, None]
        & (rests[..., 5] < HANGING_M)
        & (tilt(rests[..., 0], rests[..., 1]) < limits.tilt_rad)
    )
    left = (rests[..., 0] < bounds.roll[:, :1] - 1e-4) | (rests[..., 0] > bounds.roll[:, 1:] + 1e-4)
    left |= (rests[..., 1] < bounds.pitch[:, :1] - 1e-4) | (rests[..., 1] > bounds.pitch[:, 1:] + 1e-4)
    left |= (rests[..., 3] < bounds.clearance_m[:, None]) | (rests[..., 4] < bounds.margin[:, None] - 1e-4)
    return int((safe & left).any(axis=1).sum())


def main() -> None:
    """Run the comparison and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--rover", default="husky")
    parser.add_argument("--cells", type=float, nargs="+", default=[0.05], help="sizes of the map's cells, m")
    parser.add_argument("--sds", type=float, nargs="+", default=[0.0], help="errors of its heights, m")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    body, limits = rigid_body(load_rover(options.rover).footprint()), PoseLimits()
    each = options.poses // (len(COVERS) * len(SLOPES_DEG))
    totals: dict[tuple[float, float], FloatArray] = {}
    print("cover slope  cell   sd   safe  unsafe called safe  safe called unsafe  us/pose")
    for number, (cover, slope) in enumerate(product(COVERS, SLOPES_DEG)):
        rng = np.random.default_rng([options.seed, number])
        ground = true_ground(cover, slope, 1000 * options.seed + number)
        span = SIZE_M / 2 - MARGIN_M
        poses = np.column_stack([rng.uniform(-span, span, (each, 2)), rng.uniform(-np.pi, np.pi, each)])
        rests = settle(ground, poses, body, STARTS)
        safe, unsafe = truly(rests, limits)
        for cell_m, sd_m in product(options.cells, options.sds):
            believed = cell_bounds(ground, cell_m, sd_m, rng)
            pose_bounds(believed, poses[:10], body, limits)  # compiles
            began = time.process_time()
            bounds = pose_bounds(believed, poses, body, limits)
            spent = time.process_time() - began
            called = bounds.safe(limits)
            counts = np.array([
                each, safe.sum(), unsafe.sum(), (called & unsafe).sum(), (~called & safe).sum(), spent,
                outside(bounds, rests, limits),
            ])  # fmt: skip
            totals[cell_m, sd_m] = totals.get((cell_m, sd_m), 0.0) + counts
            print(line(f"{cover:5.2f} {slope:5.0f}", cell_m, sd_m, counts), flush=True)
    for (cell_m, sd_m), counts in totals.items():
        print(line("all".ljust(11), cell_m, sd_m, counts), f"rests outside of their bounds: {counts[6]:.0f}")


def line(name: str, cell_m: float, sd_m: float, counts: FloatArray) -> str:
    """One row of the table."""
    poses, safe, unsafe, missed, alarms, spent, _ = counts
    share = alarms / max(safe, 1)
    return (
        f"{name} {cell_m:5.3f} {sd_m:5.3f} {safe / poses:6.1%} {missed:11.0f} of {unsafe:6.0f} "
        f"{alarms:8.0f} = {share:6.1%} {1e6 * spent / poses:8.1f}"
    )


if __name__ == "__main__":
    main()
