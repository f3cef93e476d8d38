"""What a traverse loses by the planner and what by the eyes: each drive again with true rocks in place of perceived.

    uv run python benchmarks/true_rocks.py [--cfa 0.15] [--sensors stereo] [--seeds 7600 7604] [--height-sd 0.0]

Trials of the suite `nav` on level `mars_sand`, by the whole simulator. The true rocks of a look are those within 6 m
inside what the picture shows of the ground, with their heights over the ground that wheels beside them stand on, and
with a height error of the given sigma, the same in all looks. Ground, classes and hidden places are as perceived.
Inefficiency is the driven over the straight way, less one; the oracle's way is the shortest over the true map.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.rock_belief import over_wheels
from planner import navigator
from planner.ground_cells import inside_polygon
from rover_sim.trials.drive import drive
from rover_sim.trials.suites import Choices, trials_of
from rover_sim.trials.trial import Row, Trial
from worlds.build import build_world
from worlds.types import FloatArray, Observation, PerceivedRock, World

REACH_M, LEAST_M, CERTAINTY = 6.0, 0.03, 0.9
LEAST_SD_M, POSITION_SD_M = 0.004, 0.03  # that are stated
Step = Callable[..., Any]


class Truth:
    """Observations with the true rocks of a world."""

    def __init__(self, world: World, height_sd_m: float) -> None:
        self.world, self.sd_m = world, max(height_sd_m, LEAST_SD_M)
        error = height_sd_m * np.random.default_rng(world.seed).normal(size=len(world.rocks))
        self.height_m = np.array([over_wheels(world, row) for row in range(len(world.rocks))]) + error

    def told(self, observation: Observation, place_w: FloatArray) -> Observation:
        """The observation from a place (2,) with the true rocks that it could show."""
        rocks = self.world.rocks
        away = np.hypot(*(rocks.position_w[:, :2] - place_w).T)
        seen = (away < REACH_M) & (self.height_m > LEAST_M)
        seen &= inside_polygon(observation.footprint_w, rocks.position_w[:, :2])
        return replace(observation, rocks=tuple(self._rock(n, float(away[n])) for n in np.flatnonzero(seen).tolist()))

    def _rock(self, n: int, range_m: float) -> PerceivedRock:
        rocks = self.world.rocks
        x, y, z = rocks.position_w[n].tolist()
        length_m, width_m, _ = rocks.extents_m[n].tolist()
        return PerceivedRock(
            (x, y, z),
            length_m,
            width_m,
            float(self.height_m[n]),
            float(rocks.yaw_rad[n]),
            CERTAINTY,
            int(rocks.formation[n]),
            range_m,
            POSITION_SD_M,
            height_sd_m=self.sd_m,
        )

    def instead(self, step: Step) -> Step:
        """``navigator.step`` that is told the truth."""

        def told(state: Any, observation: Observation | None, estimate: Any, *rest: Any) -> Any:
            place_w = estimate.pose.position_w[:2]
            return step(state, None if observation is None else self.told(observation, place_w), estimate, *rest)

        return told


def driven(trial: Trial, truth: Truth | None) -> Row:
    """The row of one drive, by perceived rocks or by true ones."""
    step = navigator.step if truth is None else truth.instead(navigator.step)
    with TemporaryDirectory() as folder, patch.object(navigator, "step", step):
        return drive(trial, Path(folder), "none")


def main() -> None:
    """Print a line a drive and the means."""
    parser = argparse.ArgumentParser(description="Drives with perceived rocks, and the same with true ones.")
    parser.add_argument("--cfa", type=float, default=0.15, help="share of the ground under rocks")
    parser.add_argument("--sensors", choices=("camera", "stereo"), default="stereo")
    parser.add_argument("--seeds", type=int, nargs=2, default=(7600, 7604), metavar=("FIRST", "END"))
    parser.add_argument("--height-sd", type=float, default=0.0, help="sigma of the true rocks' heights, metres")
    options = parser.parse_args()
    cell: Choices = {"cfa": (options.cfa,), "slope_deg": (0.0,), "soil": ("mars_sand",), "sensors": (options.sensors,)}
    ways: dict[str, list[float]] = {"perceived": [], "true": []}
    reached = dict.fromkeys(ways, 0)
    for trial in trials_of("nav", cell, range(*options.seeds), None):
        truth = Truth(build_world(trial.scenario, trial.seed), options.height_sd)
        for name in ways:
            row = driven(trial, truth if name == "true" else None)
            done = row.metrics
            print(
                f"{trial.seed} {name:9s} rocks: {row.reason:10s} {done['sim_time_s']:6.1f} s, "
                f"{done['distance_m']:6.1f} m, straight {done['straight_line_m']:.1f} m, "
                f"oracle {done['oracle_length_m'] or np.nan:.1f} m, "
                f"violations {', '.join(done['violations']) or 'none'}",
                flush=True,
            )
            reached[name] += row.success
            ways[name] += [done["path_inefficiency"]] if row.success else []
    for name, excess in ways.items():
        mean = f"{np.mean(excess):.2f}" if excess else "-"
        print(f"{name} rocks: {reached[name]} reached the goal, inefficiency in the mean {mean}")


if __name__ == "__main__":
    main()
