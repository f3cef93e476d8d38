"""A route on a map: its ways, the ends of legs, the landmarks that tell them, and what was found blocked."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from planner.route_following import Following

ROUTE = "orange"


def draw_route(axes: Axes, route: Following) -> None:
    """Former routes thin, the last one bold; legend labels are set, the caller draws the legend."""
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
    for x, y, radius in route.blocked_w:
        axes.add_patch(
            Circle((x, y), radius, facecolor="none", edgecolor="red", linestyle=":", linewidth=0.8, zorder=4)
        )
