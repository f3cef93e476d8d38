"""The map of a traverse: ground, rocks true and perceived, path planned and driven, slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from planner.route_following import Following
from rover_sim.files import atomic_path
from rover_sim.report.believed_track import draw_believed_track
from rover_sim.report.ground_map import draw_ground, draw_ruts
from rover_sim.report.route_drawing import draw_route
from rover_sim.risk_watch import RiskyWay
from rover_sim.sim.mobility_events import Kind, MobilityEvent
from worlds.types import FloatArray, World

if TYPE_CHECKING:
    from rover_sim.sim.ruts import SavedRuts

SLIP_SCALE = 0.6  # slip ratio at the upper end of the colour bar
MARGIN_M = 3.0
EVENT_SPACING_M = 0.5  # events of one kind closer than this share a marker
# Marker, colour and size of each kind of mobility event; the gravest last, on top.
EVENT_MARKS: Mapping[Kind, tuple[str, str, float]] = {
    Kind.SUPPORT_LOSS: (".", "white", 22.0),
    Kind.TRACTION_LOSS: ("v", "gold", 30.0),
    Kind.WHEEL_TRAP: ("s", "tab:green", 30.0),
    Kind.HIGH_CENTRED: ("D", "tab:cyan", 30.0),
    Kind.EMBEDDING: ("P", "tab:orange", 42.0),
    Kind.TIP_OVER: ("X", "red", 48.0),
}
SURE_M = 0.3  # rocks whose place is less certain are drawn pale
PERCEIVED = "rock perceived (pale: place uncertain)"
MAP_WIDTH_IN, MAP_HEIGHT_IN = 8.4, 9.0  # at most


@dataclass(frozen=True, eq=False)
class MapData:
    """What is drawn over the true ground."""

    trace: dict[str, NDArray[np.float64]]
    plans: Sequence[FloatArray]  # each (N, 2), in the order they were sent
    perceived: FloatArray  # (M, 4): x, y, diameter and one sigma of the place of the remembered rocks
    events: Sequence[MobilityEvent]
    title: str
    ruts: SavedRuts | None = None
    route: Following | None = None
    risky: Sequence[RiskyWay] = ()  # legs of the route with their forecasts


def _extent(data: MapData, world: World) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of the part of the world that matters, square enough to look at."""
    routes = [] if data.route is None else [route.way_w for route in (*data.route.routes, data.route.route)]
    points = np.vstack([data.trace["position_w"][:, :2], np.asarray(world.goal_w)[None, :2], *routes])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    short = max(0.0, 0.45 * float((high - low).max()) - float((high - low).min())) / 2
    axis = int(np.argmin(high - low))
    low[axis] -= short
    high[axis] += short
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _mean_slip(trace: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Mean absolute slip (rows,) of the wheels that turn."""
    turning = np.abs(trace["wheel_speed"]) > 0.2
    counted = np.maximum(turning.sum(axis=1), 1)
    return np.asarray((np.abs(trace["slip"]) * turning).sum(axis=1) / counted)


def _draw_driven(axes: Axes, data: MapData) -> Any:
    """The driven path, coloured by slip; returns the collection for the colour bar."""
    path = data.trace["position_w"][:, :2]
    lines = LineCollection(
        list(np.stack([path[:-1], path[1:]], axis=1)),
        array=_mean_slip(data.trace)[:-1],
        cmap="plasma",
        linewidths=2.6,
        zorder=6,
    )
    lines.set_clim(0.0, SLIP_SCALE)
    axes.add_collection(lines)
    return lines


def _draw_belief(axes: Axes, data: MapData) -> None:
    """What the rover believed: remembered rocks as circles, the plans as thin lines, the last one bold."""
    for placed, alpha in ((True, 1.0), (False, 0.35)):
        chosen = data.perceived[(data.perceived[:, 3] < SURE_M) == placed]
        circles = [Circle((x, y), max(diameter, 0.05) / 2) for x, y, diameter, _ in chosen]
        rings = PatchCollection(circles, facecolor="none", edgecolor="deepskyblue", alpha=alpha, zorder=5)
        axes.add_collection(rings)
    for plan in data.plans[:-1]:
        axes.plot(plan[:, 0], plan[:, 1], color="white", linewidth=0.5, alpha=0.45, zorder=4)
    for plan in data.plans[-1:]:
        axes.plot(plan[:, 0], plan[:, 1], color="white", marker="o", markersize=3, linewidth=1.2, zorder=5)
    handles = [
        Line2D([], [], marker="o", linestyle="", markerfacecolor="none", color="deepskyblue", label=PERCEIVED),
        Line2D([], [], color="white", linewidth=1.2, label="path planned"),
        Line2D([], [], color="darkviolet", linewidth=2.6, label="path driven (colour: slip)"),
    ]
    known = axes.get_legend_handles_labels()[0]
    axes.legend(handles=[*known, *handles], loc="upper left", ncols=2, fontsize=7, facecolor="0.35", labelcolor="white")


def _draw_events(axes: Axes, events: Sequence[MobilityEvent]) -> None:
    """One marker a kind and place, the gravest on top; the legend counts all of them."""
    for order, (kind, (marker, colour, size)) in enumerate(EVENT_MARKS.items()):
        places = [event.position_m[:2] for event in events if event.kind is kind]
        if places:
            x, y = np.array(_apart(places)).T
            label = f"{kind.value.replace('_', ' ')} ({len(places)})"
            style: dict[str, Any] = {"marker": marker, "c": colour, "edgecolors": "black", "linewidths": 0.5}
            axes.scatter(x, y, s=size, zorder=7 + order, label=label, **style)


def _apart(places: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Those of some places that keep a distance from the ones before."""
    kept: list[tuple[float, ...]] = []
    for place in places:
        if all(np.hypot(place[0] - other[0], place[1] - other[1]) > EVENT_SPACING_M for other in kept):
            kept.append(place)
    return kept


def _draw_profile(axes: Axes, data: MapData) -> None:
    """Slip and tilt along the way."""
    position, quaternion = data.trace["position_w"], data.trace["quaternion_w"]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    tilt_deg = np.degrees(np.arccos(np.clip(1 - 2 * (quaternion[:, 0] ** 2 + quaternion[:, 1] ** 2), -1, 1)))
    axes.plot(way, 100 * _mean_slip(data.trace), color="darkviolet", linewidth=1.0, label="mean slip, %")
    axes.plot(way, tilt_deg, color="tab:orange", linewidth=1.0, label="tilt, deg")
    axes.set(xlabel="distance driven, m", xlim=(0, max(float(way[-1]), 0.1)), ylim=(0, 100 * SLIP_SCALE))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, loc="upper right")


def run_figure(world: World, data: MapData) -> Figure:
    """The figure: the map above, slip and tilt along the way below."""
    left, right, bottom, top = _extent(data, world)
    shape = (top - bottom) / (right - left)
    width = min(MAP_WIDTH_IN, MAP_HEIGHT_IN / shape)
    figure = Figure(figsize=(max(6.5, width + 1.6), width * shape + 2.7), layout="constrained")
    map_axes, profile_axes = figure.subplots(2, 1, height_ratios=(width * shape, 1.6))
    draw_ground(map_axes, world, (left, right, bottom, top))
    if data.ruts is not None:
        draw_ruts(map_axes, data.ruts)
    _draw_events(map_axes, data.events)
    draw_believed_track(map_axes, data.trace)
    if data.route is not None:
        draw_route(map_axes, data.route, data.risky)
    _draw_belief(map_axes, data)
    bar = figure.colorbar(_draw_driven(map_axes, data), ax=map_axes, shrink=0.8, pad=0.01)
    bar.set_label("mean slip ratio")
    map_axes.set_title(data.title)
    _draw_profile(profile_axes, data)
    return figure


def save_run_map(path: Path, world: World, data: MapData) -> None:
    """Write the map as a PNG, atomically."""
    figure = run_figure(world, data)
    FigureCanvasAgg(figure)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png")
