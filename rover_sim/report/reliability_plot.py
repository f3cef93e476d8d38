"""Reliability diagrams: how often what was forecast came true."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from planner.risk_scores import Reliability


def draw_reliability(curves: Mapping[str, Mapping[str, Reliability]], path: Path) -> None:
    """A panel for each event with a curve for each kind of forecast; the dots are as large as their bins."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(curves), 3.4), layout="constrained")
    for axes, (event, kinds) in zip(figure.subplots(1, len(curves), squeeze=False)[0], curves.items(), strict=True):
        axes.plot([0.0, 1.0], [0.0, 1.0], color="0.7", linewidth=1.0)
        for kind, curve in kinds.items():
            line = axes.plot(curve.forecast, curve.happened, label=kind, linewidth=1.0)[0]
            axes.scatter(curve.forecast, curve.happened, 2.0 + 2.0 * curve.count, color=line.get_color(), alpha=0.6)
        axes.set(title=event, xlabel="forecast", ylabel="happened", xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=120, format="png")
