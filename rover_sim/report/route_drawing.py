"""A route on a map: its ways, the ends of legs, the landmarks that tell them, and what was found blocked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from planner.route_following import Following, least_risky
from rover_sim.risk_watch import RiskyWay

ROUTE, RISK = "orange", "red"
LEAST_TOLD = 0.01  # probability of failure of a leg


def draw_route(axes: Axes, route: Following, risky: Sequence[RiskyWay] | None = None) -> None:
    """Former routes thin, the last one bold; legend labels are set, the caller draws the legend.

    ``risky``: ways with the forecasts to be told of them; None: the legs of the route as it stands.
    """
    for former in route.routes:
        axes.plot(*former.way_w.T, color=ROUTE, linewidth=0.8, linestyle=":", zorder=4)
    axes.plot(*route.route.way_w.T, color=ROUTE, linewidth=1.4, linestyle="--", zorder=4, label="route")
    legs = (*route.driven, *route.legs)
    ends = np.array([leg.end_w for leg in legs[:-1]]).reshape(-1, 2)
    axes.plot(
        *ends.T,
        marker="s",
        linestyle="",
        markersize=5,
        color=ROUTE,
        markeredgecolor="black",
        zorder=7,
        label="end of a leg",
    )
    for leg in legs:
        if leg.landmark is not None:
            x, y, _ = leg.landmark.position_w
            axes.plot([leg.end_w[0], x], [leg.end_w[1], y], color="white", linewidth=0.6, linestyle=":", zorder=4)
    tops = np.array([leg.landmark.position_w[:2] for leg in legs if leg.landmark is not None]).reshape(-1, 2)
    axes.plot(
        *tops.T,
        marker="^",
        linestyle="",
        markersize=8,
        color="white",
        markeredgecolor="black",
        zorder=7,
        label="landmark",
    )
    if risky is None and (planned := least_risky(route)) is not None:
        risky = list(zip(planned.ways_w, planned.legs, strict=True))
    if risky:
        _draw_risk(axes, risky)
    for x, y, radius in route.blocked_w:
        axes.add_patch(
            Circle((x, y), radius, facecolor="none", edgecolor="red", linestyle=":", linewidth=0.8, zorder=4)
        )


def _draw_risk(axes: Axes, risky: Sequence[RiskyWay]) -> None:
    """The riskiest way broad, and the probability of failure beside each that has one."""
    worst, leg = max(risky, key=lambda one: one[1].fails.probability)
    if leg.fails.probability > 0.0:
        label = f"riskiest leg: fails {100 * leg.fails.probability:.0f} %"
        axes.plot(*worst.T, label=label, color=RISK, linewidth=7.0, alpha=0.45, solid_capstyle="round", zorder=3.5)
    for way, leg in risky:
        if (share := leg.fails.probability) >= LEAST_TOLD:
            middle = way.mean(axis=0)
            text = axes.annotate(f"{100 * share:.0f} %", middle, xytext=(0, 7), textcoords="offset points", fontsize=7)
            text.set(color="white", ha="center", zorder=8, bbox={"facecolor": RISK, "alpha": 0.6, "pad": 1.0, "lw": 0})
