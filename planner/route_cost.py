"""What a metre of slope costs a rover, by direction and soil, in metres of level ground of the same soil.

Half of it is time, which slip takes, half is energy, both from what slopes did to the rover on the test rig
(``knowledge/slopes``, a file a rover); the nearer a lean is to tipping over, the more it costs. Where slip reaches the
stop that the rover's own monitor has, or the slope carries it off sideways, it does not drive. Where the map is not
sure, what would hold the rover up has a high price, times its probability.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from worlds.errors import InputError
from worlds.strict_toml import read_table
from worlds.types import FloatArray, Footprint, IntArray

KNOWLEDGE = Path(__file__).parent / "knowledge" / "slopes"
UNKNOWN = "unknown"
BIN = 0.01  # between two entries of a table: of rise over run, and of the share of what the rover can
BINS = 100  # up to 45 degrees, and twice as many for shares
ERRORS = (0.0, *(0.01 * 2.0 ** (0.25 * n) for n in range(20)))  # of a rise over run, one sigma: a table each
UNKNOWN_TIP_DEG = 40.0  # of a rover with arms, whose wheels lift before it goes over


@dataclass(frozen=True, eq=False)
class SoilSlopes:
    """What slopes do in one soil: arrays over the same slopes, each as long as the rover kept going."""

    slope_deg: FloatArray
    softness: float  # 0 hard .. 1 soft, for the rules
    slip_up: FloatArray
    power_up_W: FloatArray
    slip_down: FloatArray
    power_down_W: FloatArray
    slip_angle_deg: FloatArray


@dataclass(frozen=True)
class SlopeLimits:
    """Where a rover does not go."""

    slip: float = 0.40  # climbing: the slip stop of the rover's monitor
    skid: float = 0.30  # going down: wheels that turn so much slower than the rover moves brake no longer
    slip_angle_deg: float = 15.0  # across
    tilt_deg: float = 25.0  # in any direction
    tip_reserve_deg: float = 20.0  # between tilt and tipping over


HOLDS_UP = SlopeLimits(slip=0.5, skid=0.5, slip_angle_deg=20.0, tilt_deg=30.0, tip_reserve_deg=15.0)
HELD_UP = 1000.0  # cost of a metre on which a slope holds the rover up
SEEMING = 0.7  # sigma of the map by which a slope may seem to be over its limit before a way is refused for it


@dataclass(frozen=True, eq=False)
class SlopeCosts:
    """Tables of the cost of a metre, a row for each of `ERRORS`, and how steep it may be, in degrees."""

    along: FloatArray  # (levels, 2 BINS + 1), from steep down to steep up
    across: FloatArray  # (levels, BINS + 1)
    risk: FloatArray  # (levels, 2 BINS + 1), over the share of what holds the rover up: what a metre costs more
    limits: FloatArray  # (levels, 3) steepest rise over run up, down and across that a map may show
    holds_up: FloatArray  # (3,) rise over run up, down and across that holds the rover up
    up_deg: float
    down_deg: float
    across_deg: float
    softness: float
    break_rise: float  # a break of the ground that much to the length over which it comes holds the belly up


def slope_costs(soil: str, footprint: Footprint, rover: str, limits: SlopeLimits | None = None) -> SlopeCosts:
    """Tables for a soil and a rover of ``knowledge/slopes``; any other name is taken as the worst of those there.

    With errors a metre costs what it does on average, with `HELD_UP` for what lies beyond `HOLDS_UP`.
    """
    limits = limits or SlopeLimits()
    figures = soils(rover).get(soil) or soils(rover)[UNKNOWN]
    lateral, longitudinal = tip_angles_deg(footprint)
    wanted, most = (_steepest_deg(figures, each, (lateral, longitudinal)) for each in (limits, HOLDS_UP))
    rise = np.degrees(np.arctan(BIN * np.arange(-BINS, BINS + 1)))
    along = expected(_along(figures, rise) * _tipping(rise, longitudinal), mirrored=False)
    across = expected((_across(figures, rise) * _tipping(rise, lateral))[BINS:], mirrored=True)
    nominal, holds_up = np.tan(np.radians(wanted)), np.tan(np.radians(most))
    seen = nominal + np.minimum(SEEMING * np.array(ERRORS)[:, None], np.maximum(holds_up - nominal, 0.0))
    risk, belly = _risk(float(holds_up.min())), footprint.clearance_m / footprint.wheelbase_m
    return SlopeCosts(along, across, risk, seen, holds_up, *wanted, figures.softness, belly)


def _steepest_deg(
    figures: SoilSlopes, limits: SlopeLimits, tips_deg: tuple[float, float]
) -> tuple[float, float, float]:
    """Steepest slopes up, down and across."""
    lean, along = (min(limits.tilt_deg, tip - limits.tip_reserve_deg) for tip in tips_deg)
    up = min(_reached(figures.slope_deg, figures.slip_up, limits.slip), along)
    down = min(_reached(figures.slope_deg, -figures.slip_down, limits.skid), along)
    return up, down, min(_reached(figures.slope_deg, figures.slip_angle_deg, limits.slip_angle_deg), lean)


def _risk(least_rise: float) -> FloatArray:
    """What being held up costs on average (levels, 2 BINS + 1) at shares of what holds the rover up."""
    short = least_rise * (1.0 - BIN * np.arange(2 * BINS + 1))  # in rise over run
    rows = [ndtr(-short / max(error, 1e-9)) for error in ERRORS]
    return HELD_UP * np.array(rows)


def tip_angles_deg(footprint: Footprint) -> tuple[float, float]:
    """Lean sideways and along at which a rigid rover goes over; a careful guess for one with arms."""
    body = footprint.body
    if body is None:
        return UNKNOWN_TIP_DEG, UNKNOWN_TIP_DEG
    ahead, left, up = body.centre_of_mass_m
    height = body.wheel_radius_m + up
    sides = (0.5 * body.track_m - abs(left), 0.5 * body.wheelbase_m - abs(ahead))
    lateral, longitudinal = (float(np.degrees(np.arctan2(side, height))) for side in sides)
    return lateral, longitudinal


def error_level(error: FloatArray) -> IntArray:
    """Which of the tables stands for a one-sigma error of rise over run: the next larger one of `ERRORS`."""
    return np.asarray(np.minimum(np.searchsorted(ERRORS, error), len(ERRORS) - 1), dtype=np.int32)


@cache
def soils(rover: str) -> dict[str, SoilSlopes]:
    """Figures of a rover by soil, and the worst of them at every slope as `UNKNOWN`; of any other rover the worst."""
    known = {path.stem: load_soils(path) for path in sorted(KNOWLEDGE.glob("*.toml"))}
    if rover in known:
        return known[rover]
    each = list(known.values())
    return {name: _worst([figures[name] for figures in each], each[0][name].slope_deg) for name in each[0]}


def load_soils(path: Path) -> dict[str, SoilSlopes]:
    """Soils of a TOML file; InputError names the file and what is wrong with it."""
    tables = read_table(path)
    slopes = np.array(tables.pop("slope_deg", []), dtype=np.float64)
    if len(slopes) < 2 or slopes[0] != 0.0 or np.any(np.diff(slopes) <= 0.0) or not tables:
        raise InputError(
            f"{path}: slope_deg = {slopes.tolist()}: rising slopes from 0 and a table for each soil wanted"
        )
    found = {name: _soil(table, slopes, f"{path}: {name}") for name, table in tables.items()}
    return {**found, UNKNOWN: _worst(list(found.values()), slopes)}


def _soil(table: Any, slopes: FloatArray, source: str) -> SoilSlopes:
    names = [part.name for part in fields(SoilSlopes)[1:]]
    if not isinstance(table, dict) or set(table) != set(names):
        raise InputError(f"{source}: wanted are exactly {', '.join(names)}")
    columns = {name: np.atleast_1d(np.array(table[name], dtype=np.float64)) for name in names[1:]}
    for name, values in columns.items():
        if not 2 <= len(values) <= len(slopes):
            raise InputError(f"{source}.{name}: has {len(values)} numbers; allowed are 2 to {len(slopes)}, one a slope")
    for name in ("slip_up", "slip_angle_deg"):
        if np.any(np.diff(columns[name]) < 0.0):
            raise InputError(f"{source}.{name}: must not fall with the slope")
    return SoilSlopes(slopes, float(table["softness"]), **columns)


def _worst(known: list[SoilSlopes], slopes: FloatArray) -> SoilSlopes:
    """Columns as long as the shortest, each value the worst of all."""
    columns = {}
    for part in fields(SoilSlopes)[2:]:
        each = [getattr(soil, part.name) for soil in known]
        length = min(len(values) for values in each)
        pick = np.min if part.name == "slip_down" else np.max
        columns[part.name] = pick([values[:length] for values in each], axis=0)
    return SoilSlopes(slopes, max(soil.softness for soil in known), **columns)


def _reached(slope_deg: FloatArray, values: FloatArray, limit: float) -> float:
    """Slope at which a rising column reaches a limit, or the last at which the rover kept going."""
    slopes, rising = slope_deg[: len(values)], np.maximum.accumulate(values)
    return float(slopes[-1] if rising[-1] <= limit else np.interp(limit, rising, slopes))


def _along(figures: SoilSlopes, rise_deg: FloatArray) -> FloatArray:
    """Mean of time and energy of a metre up or down a slope, over those of a level one."""
    up, down = rise_deg.clip(0.0), (-rise_deg).clip(0.0)
    climbing = rise_deg >= 0.0
    slip = np.where(climbing, _at(figures, figures.slip_up, up), _at(figures, figures.slip_down, down))
    power = np.where(climbing, _at(figures, figures.power_up_W, up), _at(figures, figures.power_down_W, down))
    time_s = 1.0 / np.maximum(1.0 - slip, 1e-3)
    level = int(np.argmin(np.abs(rise_deg)))
    return np.asarray(0.5 * time_s / time_s[level] + 0.5 * power * time_s / (power * time_s)[level])


def _across(figures: SoilSlopes, rise_deg: FloatArray) -> FloatArray:
    """How much longer a way across gets by crabbing against being carried off."""
    angle = np.radians(_at(figures, figures.slip_angle_deg, np.abs(rise_deg)))
    return np.asarray(1.0 / np.cos(np.minimum(angle, 1.4)))


def _at(figures: SoilSlopes, column: FloatArray, slope_deg: FloatArray) -> FloatArray:
    return np.asarray(np.interp(slope_deg, figures.slope_deg[: len(column)], column))


def _tipping(rise_deg: FloatArray, tip_deg: float) -> FloatArray:
    """One on level ground, and growing as the lean uses up what there is till the rover goes over."""
    return np.asarray(1.0 + np.clip(np.abs(rise_deg) / tip_deg, 0.0, 1.0) ** 2)


def expected(cost: FloatArray, *, mirrored: bool) -> FloatArray:
    """Mean (levels, N) of a table over a normal error of the rise; beyond its ends the table goes on as it ends.

    ``mirrored``: the table begins at the level and is the same on the other side.
    """
    table = np.concatenate([cost[:0:-1], cost]) if mirrored else cost
    rise, rows = np.arange(len(table)), []
    for error in ERRORS:
        width = max(error / BIN, 1e-9)
        offsets = np.linspace(-3.0, 3.0, 25)
        weights = np.exp(-0.5 * offsets**2)
        values = [np.interp(rise + offset * width, rise, table) for offset in offsets]
        rows.append(np.average(values, axis=0, weights=weights))
    return np.array(rows)[:, len(cost) - 1 :] if mirrored else np.array(rows)
