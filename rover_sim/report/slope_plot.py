"""The picture of a slope campaign: slip, slip angle, pull and turning, with the published curves and bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rover_sim.files import atomic_path
from rover_sim.slope.bands import (
    EARTH_M_S2,
    EVENTS,
    EVENTS_SOURCE,
    SLIP_ANGLE_CURVES,
    SLIP_CURVES,
    Curve,
    band_slopes,
    pioneer_track_ratio,
    slip_band,
)
from rover_sim.slope.campaign import Campaign, Point, of_kind
from rover_sim.slope.drawbar import DrawbarPoint
from rover_sim.slope.rig import SlopePoint
from rover_sim.slope.tilt_table import TiltPoint
from rover_sim.slope.turning import TurnPoint

Colours = Mapping[str, str]
Corner = Literal["upper left", "upper right", "lower right"]
_PALETTE = ("tab:orange", "tab:blue", "tab:red", "tab:green", "tab:purple", "tab:brown", "tab:pink", "tab:cyan")
_STYLES = ("--", "-.", ":")
_SLIP_TOP = 1.05
_SPOT_M = 0.15  # where turns on the spot are drawn on the logarithmic axis


def slope_figure(campaign: Campaign, points: Mapping[int, Point]) -> Figure:
    """The figure of four panels."""
    colours = {soil: _PALETTE[place % len(_PALETTE)] for place, soil in enumerate(campaign.soils)}
    figure = Figure(figsize=(14, 10), layout="constrained")
    (climb, side), (pull, turn) = figure.subplots(2, 2, width_ratios=(5, 4))
    _draw_climb(climb, campaign, of_kind(points, SlopePoint), colours)
    _draw_side(side, campaign, of_kind(points, SlopePoint), colours)
    _draw_pull(pull, of_kind(points, DrawbarPoint), colours)
    _draw_turns(turn, of_kind(points, TurnPoint), colours)
    load = f" with {campaign.load_kg:g} kg" if campaign.load_kg else ""
    title = f"{campaign.rover}{load}, {campaign.gravity_m_s2:g} m/s2, rims at {campaign.speed_m_s:g} m/s"
    figure.suptitle(f"{title}\n{_tilt_text(of_kind(points, TiltPoint))}", fontsize=11)
    return figure


def save_slope_plot(path: Path, campaign: Campaign, points: Mapping[int, Point]) -> None:
    """Write the figure as a PNG, atomically."""
    figure = slope_figure(campaign, points)
    FigureCanvasAgg(figure)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=80, format="png")


def _draw_climb(axes: Axes, campaign: Campaign, rows: list[SlopePoint], colours: Colours) -> None:
    """Slip against slope, downhill to the left, with curves and bands."""
    earth = abs(campaign.gravity_m_s2 - EARTH_M_S2) < 0.05
    for soil, colour in colours.items():
        _draw_band(axes, soil, campaign.gravity_m_s2, colour)
        # The published drives took place on Earth.
        curves = [curve for curve in SLIP_CURVES if curve.soil == soil and earth]
        for curve, style in zip(curves, _STYLES, strict=False):
            _draw_curve(axes, curve, colour, style)
        _draw_slip(axes, [row for row in rows if row.soil == soil], soil, colour)
    if "loose_sand" in colours and earth:
        _draw_events(axes, colours["loose_sand"])
    axes.set(
        xlabel="slope, deg (downhill negative)", ylabel="slip ratio", ylim=(-1.05, _SLIP_TOP), title="slip on slopes"
    )
    _finish(axes, "upper left")


def _draw_slip(axes: Axes, rows: list[SlopePoint], soil: str, colour: str) -> None:
    """Measured points; a stall is a cross, a point outside its band has a red ring."""
    climbs = [row for row in rows if row.direction == "up"]
    downs = [(-row.slope_deg, row.slip) for row in rows if row.direction == "down"]
    _draw_measured(axes, sorted([*downs, *map(_place, climbs)]), soil, colour)
    stuck = [_place(row) for row in climbs if row.stalled or row.embedded]
    outside = [_place(row) for row in climbs if row.inside is False]
    if stuck:
        x, y = zip(*stuck, strict=True)
        axes.scatter(x, y, s=60, marker="x", color=colour, label=f"{soil}: stalls or embeds")
    if outside:
        label = f"{soil}: outside its band"
        x, y = zip(*outside, strict=True)
        axes.scatter(x, y, s=110, facecolors="none", edgecolors="red", label=label)


def _place(row: SlopePoint) -> tuple[float, float]:
    """Slope and slip; a rover that slides back is drawn as one that stands."""
    return row.slope_deg, min(row.slip, 1.0)


def _draw_band(axes: Axes, soil: str, gravity_m_s2: float, colour: str) -> None:
    slopes = [slope for slope in band_slopes(soil) if slip_band(soil, gravity_m_s2, "up", slope)]
    bands = [slip_band(soil, gravity_m_s2, "up", slope) for slope in slopes]
    if slopes:
        low, high = [band.low for band in bands if band], [band.high for band in bands if band]
        axes.fill_between(slopes, low, high, color=colour, alpha=0.15, linewidth=0, label=f"{soil}: reference band")


def _draw_curve(axes: Axes, curve: Curve, colour: str, style: str) -> None:
    label = f"{curve.label} ({curve.confidence})"
    if not curve.low:
        axes.plot(curve.slope_deg, curve.value, color=colour, linestyle=style, linewidth=1.0, label=label)
        return
    value, low, high = (np.array(column) for column in (curve.value, curve.low, curve.high))
    axes.errorbar(
        curve.slope_deg,
        value,
        (value - low, high - value),
        color=colour,
        fmt="s",
        markersize=3,
        capsize=2,
        linewidth=0.8,
        alpha=0.8,
        label=label,
    )


def _draw_events(axes: Axes, colour: str) -> None:
    for slope_deg, text in EVENTS:
        axes.axvline(slope_deg, color=colour, linewidth=0.7, linestyle=(0, (1, 3)))
        axes.annotate(text, (slope_deg, -1.0), fontsize=7, rotation=90, ha="right", va="bottom", color=colour)
    axes.plot([], [], color=colour, linewidth=0.7, linestyle=(0, (1, 3)), label=EVENTS_SOURCE)


def _draw_side(axes: Axes, campaign: Campaign, rows: list[SlopePoint], colours: Colours) -> None:
    """How far a rover that drives across a slope slides downhill."""
    for soil, colour in colours.items():
        across = [row for row in rows if row.soil == soil and row.direction == "across"]
        _draw_measured(axes, [(row.slope_deg, row.slip_angle_deg) for row in across], soil, colour)
        if abs(campaign.gravity_m_s2 - EARTH_M_S2) < 0.05:
            for curve in SLIP_ANGLE_CURVES:
                if curve.soil == soil:
                    _draw_curve(axes, curve, colour, "--")
    axes.set(xlabel="slope, deg", ylabel="slip angle, deg downhill", ylim=(0, 92), title="driving across")
    _finish(axes, "upper left")


def _draw_pull(axes: Axes, rows: list[DrawbarPoint], colours: Colours) -> None:
    """Pull over weight against slip; thin lines: steady Wong-Reece wheels."""
    for soil, colour in colours.items():
        own = [row for row in rows if row.soil == soil]
        _draw_measured(axes, [(row.slip, row.pull_per_weight) for row in own], soil, colour)
        if own:
            steady = [row.steady_wheel_per_weight for row in own]
            label = f"{soil}: steady wheels, equal loads, fresh soil"
            axes.plot([row.slip for row in own], steady, color=colour, linewidth=0.8, linestyle="--", label=label)
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlabel="slip ratio", ylabel="drawbar pull / weight", title="drawbar test on level ground")
    _finish(axes, "lower right")


def _draw_turns(axes: Axes, rows: list[TurnPoint], colours: Colours) -> None:
    """Effective track ratio against path radius; turns on the spot at the left edge."""
    turning = [(row, row.radius_m, row.track_ratio) for row in rows if row.radius_m is not None and row.track_ratio]
    for soil, colour in colours.items():
        own = [(max(radius, _SPOT_M), ratio) for row, radius, ratio in turning if row.soil == soil]
        _draw_measured(axes, own, soil, colour)
    pioneer = [(max(radius, _SPOT_M), pioneer_track_ratio(row.path_curvature)) for row, radius, _ in turning]
    if pioneer:
        label = "Pioneer 3-AT, form of Wang et al. 2015 (coefficients unconfirmed)"
        axes.plot(*zip(*sorted(pioneer), strict=True), color="0.3", linestyle="--", linewidth=1.0, label=label)
        label = "hard ground: vendors' multipliers 1.5 to 1.875"
        axes.axhspan(1.4, 1.9, color="0.5", alpha=0.12, linewidth=0, label=label)
        axes.set(ylim=(1.3, axes.get_ylim()[1] + 0.3), xscale="log")
    axes.set_title("turning on level ground")
    axes.set(xlabel="path radius, m (left edge: on the spot)", ylabel="effective track ratio")
    _finish(axes, "upper right")


def _draw_measured(axes: Axes, points: Sequence[tuple[float, float]], soil: str, colour: str) -> None:
    """What the rig measured on one soil, if anything."""
    if points:
        x, y = zip(*points, strict=True)
        axes.plot(x, y, color=colour, marker="o", markersize=4, linewidth=1.6, label=f"{soil}: measured")


def _finish(axes: Axes, corner: Corner) -> None:
    """Grid and legend, or a word where nothing was measured."""
    axes.grid(alpha=0.3)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=7, loc=corner)
    else:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center")


def _tilt_text(rows: list[TiltPoint]) -> str:
    parts = [f"{row.axis} {row.tip_deg:.1f} ({row.analytic_deg:.1f})" for row in rows if row.tip_deg is not None]
    return f"tilt table, wheels lift at (analytic): {', '.join(parts)} deg" if parts else ""
