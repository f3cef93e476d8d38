"""The picture of rock scores: overlap with the labels, picture by picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rover_sim.files import atomic_path


def save_rock_scores(
    path: Path, ious: Mapping[str, Sequence[float]], summaries: Mapping[str, Mapping[str, float]]
) -> None:
    """Write curves of the pictures' IoU by method, worst to best, as a PNG."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for method, values in ious.items():
        figures = summaries[method]
        label = f"{method}: pooled {figures['iou']:.3f}, mean {figures['mean_iou']:.3f}, F1 {figures['object_f1']:.3f}"
        axes.plot(np.arange(1, len(values) + 1), sorted(values), marker=".", label=label)
    axes.set(xlabel="pictures, worst first", ylabel="IoU of rock pixels", ylim=(0.0, 1.0), title="rocks against labels")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", fontsize=8)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=90, format="png")
