"""Draws docs/images/decision.png: one decision of a real run, from the picture to the way that is driven.

    uv run python scripts/draw_decision.py [OUT.png] [--cfa 0.1] [--seed 3008] [--least-ways 2]

The run is one of `rover-sim trials nav` on flat mars_sand. Drawn is the first decision after some seconds that made a
new way round something and had so many ways to choose from.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from planner.goal_field import field_ground, goal_field
from planner.ground_cells import CELL_M, CELLS, Source
from planner.navigator_state import NavigatorState
from planner.obstacle_map import obstacles
from rover_sim.onboard import OnboardComputer, Sight
from rover_sim.report.perceived_overlay import draw_overlay
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, open_traverse
from rover_sim.trials.suites import Choices, trials_of
from worlds.build import build_world
from worlds.types import FloatArray

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.patches import Circle

OUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "decision.png"
EARLIEST_S = 5.0
BEHIND_M, AHEAD_M, BESIDE_M = 2.0, 9.0, 5.5


@dataclass(frozen=True, eq=False)
class Moment:
    """A decision with what it was made from."""

    sight: Sight
    plan: NavigatorState
    place_w: FloatArray  # (2,) of the rover, as it believes


def find_moment(cfa: float, seed: int, least_ways: int) -> Moment:
    """Drive until such a decision is made; SystemExit if the run ends without one."""
    cell: Choices = {"cfa": (cfa,), "slope_deg": (0.0,), "soil": ("mars_sand",)}
    scenario = trials_of("nav", cell, [seed], None)[0].scenario
    found: list[Moment] = []
    with open_traverse(build_world(scenario, seed), load_rover(scenario.rover.model), RunOptions()) as traverse:

        def look(sight: Sight) -> None:
            decision = sight.decision
            new = decision.kind == "drive" and decision.changed and sight.frame.time_s >= EARLIEST_S
            if new and len(decision.candidates) >= least_ways and not found:
                assert isinstance(traverse.onboard, OnboardComputer)
                found.append(Moment(sight, traverse.onboard.plan, np.asarray(decision.waypoints_w[0])))

        traverse.run(on_sight=look, stopped=lambda: bool(found))
    if not found:
        raise SystemExit(f"rock cover {cfa}, seed {seed}: no decision among {least_ways} ways; try another seed")
    return found[0]


def draw(moment: Moment, out: Path) -> None:
    """The four steps side by side."""
    figure, axes = plt.subplots(2, 2, figsize=(13, 11.5), layout="constrained")
    picture = draw_overlay(moment.sight.frame.image, moment.sight.perception, [])
    axes[0, 0].imshow(picture)
    axes[0, 0].set_axis_off()
    axes[0, 0].set_title("1  what is seen: rocks with their certainty,\nclasses of the windows", fontsize=10)
    _memory(axes[0, 1], moment)
    _field(axes[1, 0], moment)
    _ways(axes[1, 1], moment)
    figure.savefig(out, dpi=90)
    plt.close(figure)


def _memory(axis: Any, moment: Moment) -> None:
    """Cells by who told of them, rocks by what they mean for the wheels."""
    cells = moment.plan.memory.cells
    age = moment.sight.frame.time_s - cells.seen_s
    shown = np.where(cells.source == Source.NOBODY, np.nan, np.minimum(age, 20.0))
    size = CELLS * CELL_M
    x, y = cells.origin_w
    image = axis.imshow(shown, origin="lower", extent=(x, x + size, y, y + size), cmap="YlOrBr", vmin=-5, vmax=25)
    axis.figure.colorbar(image, ax=axis, shrink=0.7, label="seconds since a cell was seen (white: never)")
    _rocks(axis, moment)
    _frame(
        axis,
        moment,
        "2  what is remembered: cells of 5 cm; rocks to go round\n(red), low ones and far ones not sure yet (grey)",
    )


def _field(axis: Any, moment: Moment) -> None:
    """What is still to go from everywhere."""
    plan = moment.plan
    table = _table(moment)
    need = plan.models.drive.need_m(plan.models.footprint)
    goal = np.asarray(plan.goal_w)
    field = goal_field(
        table,
        field_ground(plan.memory.cells, moment.place_w),
        moment.place_w,
        goal,
        plan.goal_radius_m,
        need,
        plan.models.drive,
    )
    cost = np.where(np.isfinite(field.cost_m), field.cost_m, np.nan)
    x, y = field.origin_w
    nx, ny = cost.shape
    levels = np.arange(np.floor(np.nanmin(cost)), np.nanmax(cost) + 1.0, 1.0)
    grid = (x + 0.15 * np.arange(nx), y + 0.15 * np.arange(ny))
    drawn = axis.contourf(*grid, cost.T, levels=levels, cmap="viridis_r")
    axis.figure.colorbar(drawn, ax=axis, shrink=0.7, label="metres of easy way to the goal (white: not to be reached)")
    _rocks(axis, moment)
    _frame(axis, moment, "3  what is still to go from everywhere,\nasked where the straight rows are blocked")


def _ways(axis: Any, moment: Moment) -> None:
    """The candidates with their scores, and the one chosen."""
    decision = moment.sight.decision
    _rocks(axis, moment)
    colours = plt.get_cmap("tab10")
    for number, (way, score) in enumerate(zip(decision.candidates, decision.scores, strict=True)):
        points = way.waypoints_w
        label = f"{way.cost:.1f} m by cost, traversability {score:.2f}"
        axis.plot(points[:, 0], points[:, 1], "-o", color=colours(number), markersize=3, linewidth=1.5, label=label)
    chosen = decision.waypoints_w
    axis.plot(chosen[:, 0], chosen[:, 1], color="black", linewidth=5, alpha=0.3, label=f"driven: {decision.reason}")
    axis.legend(loc="lower right", fontsize=8)
    _frame(axis, moment, "4  the ways through different gaps,\nand the one that is driven")


def _table(moment: Moment) -> FloatArray:
    """The obstacles as the planner has them."""
    models = moment.plan.models
    body = models.footprint
    return obstacles(
        moment.plan.memory.rocks,
        models.drive,
        body.climb_height_m,
        wheel_width_m=body.wheel_width_m,
        place_w=moment.place_w,
    )


def _rocks(axis: Any, moment: Moment) -> None:
    table = _table(moment)
    for ax, ay, bx, by, radius, _, hard in table:
        places = np.linspace((ax, ay), (bx, by), 5)
        for px, py in places:
            axis.add_patch(Circle((px, py), radius, color="firebrick" if hard else "0.6", alpha=0.5, linewidth=0))


def _frame(axis: Any, moment: Moment, title: str) -> None:
    """The rover, the direction of the goal, and the same part of the world in every panel."""
    here, goal = moment.place_w, np.asarray(moment.plan.goal_w)
    ahead = (goal - here) / np.linalg.norm(goal - here)
    corners = here + np.array([
        a * ahead + b * np.array([-ahead[1], ahead[0]]) for a in (-BEHIND_M, AHEAD_M) for b in (-BESIDE_M, BESIDE_M)
    ])  # fmt: skip
    axis.plot(*here, marker="s", color="blue", markersize=9)
    axis.annotate("", here + 1.2 * ahead, here, arrowprops={"arrowstyle": "->", "color": "blue", "linewidth": 2})
    axis.set_xlim(corners[:, 0].min(), corners[:, 0].max())
    axis.set_ylim(corners[:, 1].min(), corners[:, 1].max())
    axis.set_aspect("equal")
    axis.set_xlabel("x (m)")
    axis.set_ylabel("y (m)")
    axis.set_title(title, fontsize=10)


def main() -> None:
    """Draw it."""
    parser = argparse.ArgumentParser(description="One decision of a real run.")
    parser.add_argument("out", type=Path, nargs="?", default=OUT)
    parser.add_argument("--cfa", type=float, default=0.1, help="share of the ground under rocks")
    parser.add_argument("--seed", type=int, default=3008)
    parser.add_argument("--least-ways", type=int, default=2)
    options = parser.parse_args()
    draw(find_moment(options.cfa, options.seed, options.least_ways), options.out)


if __name__ == "__main__":
    main()
