"""Draws docs/images/route.png: a route over a map from orbit, from heights to legs and landmarks.

    uv run python scripts/draw_route.py [OUT.png] [--ground crater] [--distance 200] [--seed 1]

The world is one of `rover-sim trials route`; the map has the error that its scenario states.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from planner.route_following import Following, driven_map
from rover_sim.report.route_drawing import draw_route
from rover_sim.route_map import first_route, from_orbit
from rover_sim.sim.rover import load_rover
from rover_sim.trials.oracle import best_route
from rover_sim.trials.suites import trials_of
from worlds.build import build_world
from worlds.types import FloatArray, HeightField, World

mpl.use("Agg")
from matplotlib import pyplot as plt

OUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "route.png"


def panel(axis: Any, grid: HeightField, layer: FloatArray, title: str, **style: Any) -> None:
    """A layer as a picture with its colour bar."""
    half = 0.5 * grid.resolution_m
    (west, east), (south, north) = grid.x_limits_m, grid.y_limits_m
    extent = (west - half, east + half, south - half, north + half)
    image = axis.imshow(layer, origin="lower", extent=extent, **style)
    axis.figure.colorbar(image, ax=axis, shrink=0.7)
    axis.set_title(title, fontsize=10)
    axis.set(xlabel="x east, m", ylabel="y north, m")


def draw(world: World, route: Following, out: Path) -> None:
    """Heights as measured, slopes, care, and the route beside the best one over the true map."""
    map_, table = driven_map(route), world.scenario.route
    assert table is not None
    grid, layers = map_.grid, map_.layers
    figure, axes = plt.subplots(2, 2, figsize=(13, 11), layout="constrained")
    measured = from_orbit(world, table).field
    panel(
        axes[0, 0],
        measured,
        measured.heights_m,
        f"1  heights from orbit, m ({table.error_m:g} m error)",
        cmap="terrain",
    )
    panel(axes[0, 1], grid, layers.slope_deg, "2  slope after the noise is filtered, degrees", cmap="magma", vmax=30.0)
    care = np.where(np.isfinite(map_.care), map_.care, np.nan)
    panel(
        axes[1, 0], grid, care, "3  care by the fuzzy rules (white: not driven on)", cmap="viridis", vmin=1.0, vmax=4.0
    )
    panel(axes[1, 1], grid, grid.heights_m, "4  the route, its legs and what tells them", cmap="terrain")
    true_map, best = best_route(world, load_rover(world.scenario.rover.model).footprint())
    assert true_map.grid.resolution_m == grid.resolution_m
    axes[1, 1].plot(*best.way_w.T, color="black", linewidth=1.0, label=f"best over the true map, {best.cost:.0f} m")
    draw_route(axes[1, 1], route)
    ends = np.array([world.scenario.rover.start_m, world.scenario.goal.position_m])
    axes[1, 1].plot(*ends[0], "o", color="lime", markeredgecolor="black", label="start")
    axes[1, 1].plot(*ends[1], "*", color="red", markersize=12, markeredgecolor="black", label="goal")
    axes[1, 1].legend(fontsize=8, loc="lower left")
    figure.savefig(out, dpi=85)
    plt.close(figure)


def main() -> None:
    """Draw it."""
    parser = argparse.ArgumentParser(description="A route over a map from orbit.")
    parser.add_argument("out", type=Path, nargs="?", default=OUT)
    parser.add_argument("--ground", default="crater")
    parser.add_argument("--distance", type=float, default=200.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    cell = {"ground": (options.ground,), "distance_m": (options.distance,)}
    (trial,) = trials_of("route", cell, [options.seed], None)
    world = build_world(trial.scenario, options.seed)
    route = first_route(world, load_rover(trial.scenario.rover.model).footprint())
    assert route is not None
    draw(world, route, options.out)


if __name__ == "__main__":
    main()
