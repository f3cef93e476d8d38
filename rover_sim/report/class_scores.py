"""The picture of class scores: confusion of the six classes by method, and TTAM picture by picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rover_sim.files import atomic_path

LETTERS = ("S", "V", "m", "M", "B", "U")


def save_class_scores(
    path: Path,
    methods: Mapping[str, Mapping[str, Any]],
    ttams: Mapping[str, Sequence[float]],
    titles: Mapping[str, str],
) -> None:
    """Write confusions (rows: true) and TTAM of the pictures, worst first, as a PNG."""
    figure = Figure(figsize=(4.2 * len(methods) + 4.5, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    *left, right = figure.subplots(1, len(methods) + 1)
    for axes, (method, figures) in zip(left, methods.items(), strict=True):
        _draw_confusion(axes, np.array(figures["confusion"]))
        axes.set_title(f"{titles[method]}\nTTAM {figures['ttam_without_u']:.1f} without U", fontsize=9)
    for method, values in ttams.items():
        right.plot(np.arange(1, len(values) + 1), sorted(values), marker=".", label=method)
    right.set(xlabel="pictures, worst first", ylabel="TTAM with U, %", ylim=(0.0, 100.0))
    right.grid(alpha=0.3)
    right.legend(loc="lower right", fontsize=8)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=90, format="png")


def _draw_confusion(axes: Axes, counts: np.ndarray[Any, np.dtype[np.int64]]) -> None:
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
    for (row, column), count in np.ndenumerate(counts):
        colour = "white" if share[row, column] > 0.5 else "black"
        axes.text(column, row, str(count), ha="center", va="center", color=colour, fontsize=8)
    axes.set(xticks=range(len(LETTERS)), yticks=range(len(LETTERS)), xlabel="found", ylabel="true")
    axes.set_xticklabels(LETTERS)
    axes.set_yticklabels(LETTERS)
