"""How low the belly hangs over the rocks that it passes, how well their heights are known, and what follows.

    uv run python benchmarks/belly_clearance.py [--cfa 0.15] [--sensors stereo] [--seeds 7562 7579]

Trials of the suite `nav` on level `mars_sand`, by the whole simulator. A pass is a rock of 6 cm or more under the belly
from when its middle comes between the wheels until it has left. Heights are over the ground that wheels beside the rock
stand on: that of the rock, that at which it was believed as it came under the rover, and that of the belly over it when
the gap was least. A touch has both spreads: the last table sets the share of pairs of them that touch beside what the
planner takes for it (`planner.obstacle_map.belly_meets`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.rock_belief import over_wheels
from planner import navigator
from planner.obstacle_map import STEREO_DRIVE, DriveModel, belly_meets
from planner.terrain_map import RockMemory, empty_memory
from rover_sim.sim.rover import load_rover
from rover_sim.sim.rover_ground import belly_points
from rover_sim.trials.drive import drive
from rover_sim.trials.suites import Choices, trials_of
from rover_sim.trials.trial import Trial
from worlds.build import build_world
from worlds.geometry import euler_from_quaternion, rotation_from_quaternion
from worlds.types import FloatArray, World

LEAST_M, KNOWN_M, APART_S, EACH = 0.06, 0.15, 3.0, 3
BELIEVED_M = np.arange(0.08, 0.1251, 0.005)
SHARES = (1, 5, 25, 50, 75)


@dataclass(frozen=True)
class Pass:
    """One rock that the belly passed over: heights over the ground of the wheels, metres."""

    true_m: float
    belly_m: float  # where the gap was least
    along_m: float  # of the body, from its middle, there
    believed_m: float  # NaN: not remembered
    believed_sd_m: float


def driven(trial: Trial) -> tuple[dict[str, FloatArray], list[tuple[float, RockMemory]]]:
    """The trace of a drive, and the rocks remembered at each decision."""
    step, looks = navigator.step, []

    def noted(state: Any, observation: Any, estimate: Any, time_s: float, scan: Any = None) -> Any:
        after, decision = step(state, observation, estimate, time_s, scan)
        looks.append((time_s, after.memory.rocks))
        return after, decision

    with TemporaryDirectory() as folder, patch.object(navigator, "step", noted):
        drive(trial, Path(folder), "all")
        (file,) = Path(folder).rglob("trace.npz")
        with np.load(file) as trace:
            return {name: trace[name] for name in ("time_s", "position_w", "quaternion_w")}, looks


def passes(world: World, trace: dict[str, FloatArray], looks: list[tuple[float, RockMemory]]) -> Iterator[Pass]:
    """All passes of a drive."""
    points = belly_points(load_rover("husky"))
    low = float(points[:, 2].min())
    reach, side, _ = points[points[:, 2] < low + 1e-3].max(axis=0)
    yaw = np.array([euler_from_quaternion(q)[2] for q in trace["quaternion_w"]])
    times, seen_s = trace["time_s"], np.array([time_s for time_s, _ in looks])
    for row in np.flatnonzero(world.rocks.extents_m[:, 2] > LEAST_M):
        x, y = (world.rocks.position_w[row, :2] - trace["position_w"][:, :2]).T
        along, across = x * np.cos(yaw) + y * np.sin(yaw), y * np.cos(yaw) - x * np.sin(yaw)
        under = np.flatnonzero((np.abs(along) < reach) & (np.abs(across) < side))[::EACH]
        for part in np.split(under, np.flatnonzero(np.diff(times[under]) > APART_S) + 1):
            if not len(part):
                continue
            top = float(world.rocks.position_w[row, 2] + world.rocks.extents_m[row, 2])
            body = (np.array([along[k], across[k], low]) for k in part)
            turned = [
                rotation_from_quaternion(trace["quaternion_w"][k]) @ place for k, place in zip(part, body, strict=True)
            ]
            gaps = trace["position_w"][part, 2] + np.array(turned)[:, 2] - top
            least = int(np.argmin(gaps))
            rocks = looks[max(int(np.searchsorted(seen_s, times[part[0]])) - 1, 0)][1]
            height_m = over_wheels(world, int(row))
            believed = _believed(rocks, world, int(row))
            yield Pass(height_m, height_m + float(gaps[least]), float(along[part[least]]), *believed)


def _believed(rocks: RockMemory, world: World, row: int) -> tuple[float, float]:
    """Height and its sigma of what is remembered in a rock's place."""
    apart = np.hypot(*(rocks.centre_w - world.rocks.position_w[row, :2]).T)
    if not len(apart) or apart.min() > max(KNOWN_M, 0.5 * float(world.rocks.extents_m[row, 0])):
        return np.nan, np.nan
    nearest = int(apart.argmin())
    return float(rocks.height_m[nearest]), float(rocks.height_sd_m[nearest])


def report(found: list[Pass], model: DriveModel) -> Iterator[str]:
    """The figures as lines."""
    true, belly, along, believed, sd = np.array([list(vars(one).values()) for one in found]).T
    yield f"{len(found)} passes, {np.isnan(believed).sum()} over rocks not remembered, {(belly < true).sum()} touched"
    places: tuple[tuple[str, Callable[[FloatArray], Any]], ...] = (
        ("all", np.isfinite),
        ("rear third of the belly", lambda at: at < -0.14),
        ("middle", lambda at: np.abs(at) <= 0.14),
        ("front third", lambda at: at > 0.14),
    )
    for name, inside in places:
        share = np.percentile(belly[inside(along)], SHARES)
        told = ", ".join(f"{percent} %: {height:.3f}" for percent, height in zip(SHARES, share, strict=True))
        yield f"height of the belly, {name:24s} n {inside(along).sum():4d}  {told} m"
    known = np.isfinite(believed)
    error = (true - believed)[known]
    yield f"true less believed: mean {error.mean():+.4f}, sigma {error.std():.4f}, stated {sd[known].mean():.4f} m"
    climb_m = load_rover("husky").climb_height_m
    for height in BELIEVED_M:
        touching = float(((height + error)[:, None] > belly[None, :]).mean())
        rock = _one(height, float(np.median(sd[known])))
        taken = belly_meets(rock, model, climb_m)[0]
        yield f"believed {height:.3f} m: touches {touching:.3f}, the planner takes {taken:.3f}"


def _one(height_m: float, sd_m: float) -> RockMemory:
    """A memory of one rock of a height."""
    none = empty_memory(np.zeros(2)).rocks
    columns = {name: np.zeros((1, *column.shape[1:])) for name, column in vars(none).items()}
    return RockMemory(**columns | {"height_m": np.array([height_m]), "height_sd_m": np.array([sd_m])})


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="The belly over rocks, and what is believed of them.")
    parser.add_argument("--cfa", type=float, default=0.15, help="share of the ground under rocks")
    parser.add_argument("--sensors", choices=("camera", "stereo"), default="stereo")
    parser.add_argument("--seeds", type=int, nargs=2, default=(7562, 7579), metavar=("FIRST", "END"))
    options = parser.parse_args()
    cell: Choices = {"cfa": (options.cfa,), "slope_deg": (0.0,), "soil": ("mars_sand",), "sensors": (options.sensors,)}
    found: list[Pass] = []
    for trial in trials_of("nav", cell, range(*options.seeds), None):
        found += passes(build_world(trial.scenario, trial.seed), *driven(trial))
        print(f"{trial.seed}: {len(found)} passes so far", file=sys.stderr, flush=True)
    print("\n".join(report(found, STEREO_DRIVE if options.sensors == "stereo" else DriveModel())))


if __name__ == "__main__":
    main()
