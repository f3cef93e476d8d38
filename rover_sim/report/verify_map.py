"""Top view of a virtual terrain with the paths planned and driven, beside the picture that it was made from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from perception.pipeline import Perception
from perception.rock_placement import View
from rover_sim.files import atomic_path
from rover_sim.report.perceived_overlay import CLASS_COLOURS, CLASS_NAMES, VERDICT_COLOURS, VERDICT_NAMES
from rover_sim.verify import Check
from rover_sim.virtual_terrain import placed_rocks, window_corners
from worlds.rock_shape import outlines
from worlds.types import ByteArray, FloatArray, Footprint, RockTable

_GROUND, _ROCK = "#d8c3a0", "#5a4a3c"
_MARGIN_M = 1.0


def save_verify_map(
    path: Path,
    overlay: ByteArray,
    found: Perception,
    view: View,
    checks: Sequence[tuple[FloatArray, Check]],
    footprint: Footprint,
    reach_m: float,
    title: str,
) -> None:
    """Write the figure, atomically; ``checks`` are planned ways (N, 2) and how they were driven, best first."""
    figure = Figure(figsize=(13.0, 6.8), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    left.imshow(overlay)
    left.set_axis_off()
    figure.suptitle(title, fontsize=11)
    draw_terrain(right, found, view, reach_m)
    for number, (way_w, check) in enumerate(checks, start=1):
        _draw_check(right, number, way_w, check)
    _draw_rover(right, footprint)
    _finish(right, found, checks)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=100, format="png")


def draw_terrain(axes: Axes, found: Perception, view: View, reach_m: float) -> None:
    """Ground in the colours of its classes and rocks by their outlines, what lies ahead at the top."""
    corners = window_corners(view, (found.classes.shape[0], found.classes.shape[1]), reach_m)
    quads = np.stack([corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:], corners[:-1, :-1]], axis=2)
    seen = ~np.isnan(quads).any(axis=(2, 3))
    colours = [shade(CLASS_COLOURS[letter]) for letter in found.classes[seen].tolist()]
    axes.set_facecolor(_GROUND)
    axes.add_collection(PolyCollection(list(_ahead_up(quads[seen])), facecolors=colours, alpha=0.45, edgecolors="none"))
    rocks = RockTable.of(placed_rocks(found, view))
    if len(rocks):
        edges = outlines(rocks.section_ratio, rocks.extents_m[:, 0], rocks.extents_m[:, 1], rocks.yaw_rad)
        shapes = _ahead_up(edges + rocks.position_w[:, None, :2])
        axes.add_collection(PolyCollection(list(shapes), facecolors=_ROCK, edgecolors="black", linewidths=0.6))


def shade(colour: tuple[int, int, int]) -> tuple[float, float, float]:
    """A colour of the overlay as matplotlib has it."""
    red, green, blue = colour
    return red / 255, green / 255, blue / 255


def _ahead_up(points_w: FloatArray) -> FloatArray:
    """Drawing coordinates (..., 2), right and ahead, of places in the world."""
    return np.stack([-points_w[..., 1], points_w[..., 0]], axis=-1)


def _draw_check(axes: Axes, number: int, way_w: FloatArray, check: Check) -> None:
    drive, colour = check.drive, shade(VERDICT_COLOURS[check.verdict])
    axes.plot(*_ahead_up(way_w).T, color="white", linestyle="--", linewidth=1.4, marker="o", markersize=2.5, zorder=4)
    axes.plot(*_ahead_up(drive.track_w).T, color=colour, linewidth=2.6, zorder=5)
    end = _ahead_up(drive.track_w[-1])
    text = f"{number} {check.fault or check.verdict.value}"
    box = {"facecolor": "black", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
    axes.annotate(
        text,
        (float(end[0]), float(end[1])),
        (4, 4 + 13 * (number - 1)),
        textcoords="offset points",
        color=colour,
        fontsize=8,
        bbox=box,
        zorder=7,
    )


def _draw_rover(axes: Axes, footprint: Footprint) -> None:
    half = np.array([footprint.length_m, footprint.width_m]) / 2.0
    corners = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * half
    hull = PolyCollection([_ahead_up(corners)], facecolors="#3d5a80", edgecolors="black", zorder=6)
    axes.add_collection(hull)


def _finish(axes: Axes, found: Perception, checks: Sequence[tuple[FloatArray, Check]]) -> None:
    """Limits around what matters, labels and legend."""
    rocks = [np.array(rock.placed.position_w[:2]) for rock in found.rocks if rock.placed is not None]
    points = np.vstack([np.zeros((1, 2)), *(way for way, _ in checks), *(rock[None] for rock in rocks)])
    low, high = _ahead_up(points).min(axis=0) - _MARGIN_M, _ahead_up(points).max(axis=0) + _MARGIN_M
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set(xlabel="to the right of the camera, m", ylabel="ahead of the camera, m")
    letters = [letter for letter in CLASS_NAMES if (found.classes == letter).any()]
    handles: list[Patch | Line2D] = [
        Patch(color=shade(CLASS_COLOURS[letter]), alpha=0.45, label=f"{letter} {CLASS_NAMES[letter]}")
        for letter in letters
    ]
    handles += [
        Patch(color=_ROCK, label="rock"),
        Line2D([], [], color="white", linestyle="--", marker="o", markersize=3, label="planned"),
    ]
    handles += [
        Line2D([], [], color=shade(colour), linewidth=2.6, label=VERDICT_NAMES[verdict])
        for verdict, colour in VERDICT_COLOURS.items()
    ]
    axes.figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=7, facecolor="0.75")
