"""Ground as an elevation map tells it: slope, roughness, breaks, and how well it can be driven by fuzzy rules.

After Howard, Seraji and Tunstel, "A rule-based fuzzy traversability index for mobile robot navigation", ICRA 2001, and
the regional and global scales of Seraji, 2003. The rules stand in ``knowledge/route.toml``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy import ndimage

from planner.route_cost import error_level
from worlds.fuzzy import RuleBase, evaluate, rule_bases
from worlds.types import BoolArray, FloatArray, HeightField, IntArray

KNOWLEDGE = Path(__file__).parent / "knowledge" / "route.toml"
INPUTS = {"ground": {"slope_deg", "roughness_m"}, "index": {"ease", "step_m", "softness"}}
ROVER_M = 1.2  # length of ground that carries the rover: planes are fitted to squares of at least this side
BREAK_SD_SHARE = 0.6  # of the error of heights that is left in a break: found .58 in the yard, .2 to .4 on made ground
TABLE = 81  # entries of a look-up table of the rules along each input


@dataclass(frozen=True, eq=False)
class ElevationMap:
    """Heights as somebody measured them; NaN where nobody did."""

    field: HeightField
    variance_m2: FloatArray  # (ny, nx) of each height
    likeliest: bool = False  # not as measured: errors are what was smoothed away, and make the ground no rougher

    @staticmethod
    def of(field: HeightField, error_m: float = 0.0) -> ElevationMap:
        """A map of equal error, one sigma, everywhere."""
        return ElevationMap(field, np.full(field.heights_m.shape, error_m**2))


@dataclass(frozen=True)
class RouteRules:
    """The two rule tables."""

    ground: RuleBase
    index: RuleBase


@dataclass(frozen=True, eq=False)
class GroundLayers:
    """What was made of an elevation map, layers (ny, nx)."""

    rise_x: FloatArray  # of the plane through the square around a cell, rise over run; 0 where unknown
    rise_y: FloatArray
    level: IntArray  # see `route_cost.error_level`: the error of both
    roughness_m: FloatArray  # rms about that plane, less what the errors of the heights explain
    step_m: FloatArray  # largest distance from it within the square, less two sigma
    break_m: FloatArray  # the same as the map has it, where that is of likeliest heights
    break_sd_m: FloatArray  # one sigma of that
    known: BoolArray  # the whole square has heights

    @property
    def slope_deg(self) -> FloatArray:
        """Steepness in degrees."""
        return np.asarray(np.degrees(np.arctan(np.hypot(self.rise_x, self.rise_y))))


def ground_layers(ground: ElevationMap) -> GroundLayers:
    """Planes fitted by least squares to the square of `ROVER_M`, three cells at least, around each cell.

    At the edge the map goes on as it ends. Cells that nobody measured are unknown, and so are those right beside them.
    Noise in heights as measured makes breaks seem larger than they are; in likeliest ones it does so no longer.
    """
    cell = ground.field.resolution_m
    reach = square_reach(cell)
    side = 2 * reach + 1
    measured = np.isfinite(ground.field.heights_m)
    heights = np.where(measured, ground.field.heights_m, 0.0)
    ramp = np.arange(-reach, reach + 1.0)
    spread = side * float((ramp**2).sum())  # of the cells of a square about its middle
    mean = ndimage.uniform_filter(heights, side, mode="nearest")
    rise = [_ramp(heights, ramp, side, axis) / spread for axis in (1, 0)]
    squares = ndimage.uniform_filter(heights**2, side, mode="nearest")
    noise = ndimage.uniform_filter(ground.variance_m2, side, mode="nearest")
    rest = squares - mean**2 - (rise[0] ** 2 + rise[1] ** 2) * spread / side**2
    explained = noise * (1.0 - 3.0 / side**2)  # three degrees of freedom went into the plane
    known = ndimage.minimum_filter(measured, 3, mode="nearest")
    error = np.sqrt(noise / spread) / cell
    steps = _breaks(heights, mean, rise, reach, noise)
    breaks = _breaks(heights, mean, rise, reach, np.zeros_like(noise)) if ground.likeliest else steps
    return GroundLayers(
        np.where(known, rise[0] / cell, 0.0),
        np.where(known, rise[1] / cell, 0.0),
        error_level(np.asarray(error)),
        np.sqrt(np.maximum(rest - explained, 0.0)),
        steps,
        breaks,
        BREAK_SD_SHARE * np.sqrt(noise),
        known,
    )


def square_reach(cell_m: float) -> int:
    """Cells from the middle of a square to its sides."""
    return max(1, round(0.5 * ROVER_M / cell_m))


def _ramp(heights: FloatArray, ramp: FloatArray, side: int, axis: int) -> FloatArray:
    """Sum over the square of height times distance along an axis, in cells."""
    along = ndimage.correlate1d(heights, ramp, axis=axis, mode="nearest")
    return np.asarray(side * ndimage.uniform_filter1d(along, side, axis=1 - axis, mode="nearest"))


def _breaks(heights: FloatArray, mean: FloatArray, rise: list[FloatArray], reach: int, noise: FloatArray) -> FloatArray:
    """Largest distance of a square's middle and sides from its plane, less two sigma of the heights."""
    off = np.abs(heights - mean)
    for dx, dy in ((reach, 0), (-reach, 0), (0, reach), (0, -reach)):
        beside = np.roll(heights, (-dy, -dx), axis=(0, 1)) - mean - dx * rise[0] - dy * rise[1]
        edge = [slice(None), slice(None)]
        edge[1 if dx else 0] = slice(-reach, None) if dx + dy > 0 else slice(None, reach)
        beside[tuple(edge)] = 0.0  # came round from the other side
        np.maximum(off, np.abs(beside), out=off)
    return np.asarray(np.maximum(off - 2.0 * np.sqrt(noise), 0.0))


def traversability(layers: GroundLayers, softness: float, rules: RouteRules | None = None) -> FloatArray:
    """Fuzzy index (ny, nx), 0 (do not) to 1 (free): no better where steeper, rougher, more broken or softer."""
    rules = rules or shipped_rules()
    ease = _looked_up(rules.ground, {"slope_deg": layers.slope_deg, "roughness_m": layers.roughness_m})
    return _looked_up(rules.index, {"ease": ease, "step_m": layers.step_m}, {"softness": softness})


def best_index(rules: RouteRules | None = None) -> float:
    """What level, smooth, hard ground gets: a centroid never reaches 1."""
    rules = rules or shipped_rules()
    ease = evaluate(rules.ground, {"slope_deg": np.zeros(1), "roughness_m": np.zeros(1)})
    return float(evaluate(rules.index, {"ease": ease, "step_m": np.zeros(1), "softness": np.zeros(1)})[0])


def _looked_up(base: RuleBase, layers: dict[str, FloatArray], fixed: dict[str, float] | None = None) -> FloatArray:
    """The rules at two layers, from a table: inference takes a microsecond a cell, and a map has many."""
    (one, first), (two, second) = layers.items()
    table = _table(base, one, two, tuple((fixed or {}).items()))
    places = []
    for name, values in ((one, first), (two, second)):
        variable = next(part for part in base.inputs if part.name == name)
        places.append((np.clip(values, variable.low, variable.high) - variable.low) / (variable.high - variable.low))
    coordinates = (TABLE - 1) * np.stack([place.ravel() for place in places])
    return np.asarray(ndimage.map_coordinates(table, coordinates, order=1, mode="nearest")).reshape(first.shape)


@cache
def _table(base: RuleBase, one: str, two: str, fixed: tuple[tuple[str, float], ...]) -> FloatArray:
    """The answer (TABLE, TABLE) over the ranges of two inputs."""
    ranges = {part.name: np.linspace(part.low, part.high, TABLE) for part in base.inputs}
    grid = np.meshgrid(ranges[one], ranges[two], indexing="ij")
    inputs = {one: grid[0].ravel(), two: grid[1].ravel()}
    inputs |= {name: np.full(TABLE**2, value) for name, value in fixed}
    return evaluate(base, inputs).reshape(TABLE, TABLE)


@cache
def shipped_rules() -> RouteRules:
    """The rules that come with the package."""
    return load_rules(KNOWLEDGE)


def load_rules(path: Path) -> RouteRules:
    """Rules of a TOML file; InputError names the file and what is wrong with it."""
    return RouteRules(**rule_bases(path, INPUTS))
