"""Route planning: the cheapest way over an elevation map, or the reason why there is none.

The map's scale is that of "route planning" in the 2004 paper, section 2: tens to hundreds of metres, ahead of what the
rover sees itself. `planner.route_marks` lays waypoints on a way, `planner.route_following` drives it leg by leg.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.special import ndtr

from planner import route_kernels as kernels
from planner.route_cost import BIN, HELD_UP, SlopeCosts
from planner.route_ground import ElevationMap, GroundLayers, best_index, ground_layers, square_reach, traversability
from worlds.types import BoolArray, FloatArray, HeightField, IntArray

SLACK = 1.005  # of cost that a straight leg may have over the stretch of cells that it replaces
MOST_LEG_CELLS = 60
OVER = 1e3  # cost of a metre over the limit, where the least bad way is looked for to explain a refusal
Place = tuple[float, float]


class Refusal(StrEnum):
    """Why a route is refused."""

    START_OFF_MAP = "start_off_map"
    GOAL_OFF_MAP = "goal_off_map"
    START_UNKNOWN = "start_unknown"
    GOAL_UNKNOWN = "goal_unknown"
    START_FORBIDDEN = "start_forbidden"
    GOAL_FORBIDDEN = "goal_forbidden"
    NO_WAY = "no_way"
    TOO_RISKY = "too_risky"


@dataclass(frozen=True)
class RouteModel:
    """How routes are weighed."""

    care: float = 3.0  # how many metres more one costs on the worst ground there is
    most_step_m: float = 0.6  # a break of the ground that no rover crosses
    leave_m: float = 0.0  # start and goal may lie so far inside forbidden ground


@dataclass(frozen=True, eq=False)
class CostMap:
    """An elevation map with what driving over it costs."""

    ground: ElevationMap
    layers: GroundLayers
    care: FloatArray  # (ny, nx) factor of the cost of a metre, from 1; inf where forbidden or unknown
    costs: SlopeCosts

    @property
    def grid(self) -> HeightField:
        """Where the cells lie."""
        return self.ground.field

    def place(self, cell: tuple[int, int]) -> Place:
        """World x, y of a cell (row, column)."""
        (x, y), step = self.grid.origin_m, self.grid.resolution_m
        return x + step * cell[1], y + step * cell[0]

    def cells(self, places_w: FloatArray) -> FloatArray:
        """Places (N, 2) in cells (column, row), not rounded."""
        return np.asarray((places_w - np.asarray(self.grid.origin_m)) / self.grid.resolution_m)


@dataclass(frozen=True, eq=False)
class Route:
    """A way (N, 2) from start to goal and what it costs; or a refusal with its reason, and no way."""

    way_w: FloatArray
    cost: float  # metres of level ground of the same soil; inf for a refusal
    refusal: Refusal | None = None
    reason: str = ""
    cells: IntArray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int32))  # (M, 2) row and column passed

    @property
    def length_m(self) -> float:
        """Length of the way."""
        return float(np.linalg.norm(np.diff(self.way_w, axis=0), axis=1).sum())


def cost_map(
    ground: ElevationMap,
    costs: SlopeCosts,
    model: RouteModel | None = None,
    blocked: BoolArray | None = None,
    crowded: FloatArray | None = None,
) -> CostMap:
    """The cost of driving over a map.

    ``blocked`` (ny, nx) is forbidden whatever its heights say; ``crowded`` (ny, nx), from 1, is how many times more a
    metre costs for what stands in the way.
    """
    model = model or RouteModel()
    layers = ground_layers(ground)
    index = traversability(layers, costs.softness) / best_index()
    care = (1.0 + model.care * np.clip(1.0 - index, 0.0, 1.0)) * (1.0 if crowded is None else crowded)
    care += HELD_UP * belly_meets(layers, square_reach(ground.field.resolution_m) * ground.field.resolution_m, costs)
    steepest = max(costs.up_deg, costs.down_deg, costs.across_deg)
    care[~layers.known | (layers.slope_deg > steepest) | (layers.step_m > model.most_step_m)] = np.inf
    if blocked is not None:
        care[blocked] = np.inf
    return CostMap(ground, layers, care, costs)


def belly_meets(layers: GroundLayers, over_m: float, costs: SlopeCosts) -> FloatArray:
    """Probability (ny, nx) that a break of the ground holds the rover up; it comes within ``over_m``, half a square.

    A break between the wheels as high as the belly does; the map tells it over its own squares, taken as alike.
    """
    short = costs.break_rise * over_m - layers.break_m
    return np.asarray(ndtr(-short / np.maximum(layers.break_sd_m, 1e-9)))


def plan_route(map_: CostMap, start_w: Place, goal_w: Place, model: RouteModel | None = None) -> Route:
    """The cheapest way from start to goal, straightened; a refusal where there is none."""
    model = model or RouteModel()
    ends = []
    for place, codes in ((start_w, _START), (goal_w, _GOAL)):
        found = _drivable(map_, place, codes, model)
        if isinstance(found, Route):
            return found
        ends.append(found)
    start, goal = ends
    seeds = np.full(map_.care.shape, np.inf)
    seeds[goal] = 0.0
    part, costs, cell = map_.layers, map_.costs, map_.grid.resolution_m
    tables = _tables(costs, costs.limits)
    prices = kernels.step_prices(part.rise_x, part.rise_y, part.level, map_.care, *tables)
    to_go, onward = kernels.cost_to_goal(prices, seeds, cell)
    if not np.isfinite(to_go[start]):
        return _no_way(map_, start, seeds)
    cells = _followed(onward, start)
    return _straightened(map_, cells, to_go, start_w, goal_w)


def way_cost(map_: CostMap, way_w: FloatArray, costs: SlopeCosts | None = None) -> float:
    """Cost of driving a polyline (N, 2); inf where it leaves what may be driven on."""
    points, costs = map_.cells(np.asarray(way_w, dtype=np.float64)), costs or map_.costs
    (ny, nx), total = map_.care.shape, 0.0
    if np.any(points < -0.5) or np.any(points > (nx - 0.5, ny - 0.5)):
        return np.inf
    for a, b in pairwise(points):
        total += kernels.line_cost(a[0], a[1], b[0], b[1], *_layers(map_, costs))
    return float(total)


def without_limits(map_: CostMap) -> CostMap:
    """The same map for judging a way that was driven: a slope over the limits costs what it does, and no more."""
    costs = replace(map_.costs, limits=np.full_like(map_.costs.limits, np.inf), risk=np.zeros_like(map_.costs.risk))
    return replace(map_, care=np.minimum(map_.care, 1.0 + RouteModel().care), costs=costs)


_START = (Refusal.START_OFF_MAP, Refusal.START_UNKNOWN, Refusal.START_FORBIDDEN, "the start")
_GOAL = (Refusal.GOAL_OFF_MAP, Refusal.GOAL_UNKNOWN, Refusal.GOAL_FORBIDDEN, "the goal")


def _drivable(
    map_: CostMap, place: Place, codes: tuple[Refusal, Refusal, Refusal, str], model: RouteModel
) -> tuple[int, int] | Route:
    """The cell of a place, or the nearest one that may be driven on within ``leave_m``; or a refusal."""
    off, unknown, forbidden, name = codes
    (column, row), (ny, nx) = map_.cells(np.array([place]))[0], map_.care.shape
    where = f"{name} ({place[0]:.1f}, {place[1]:.1f}) m"
    if not (-0.5 <= column < nx - 0.5 and -0.5 <= row < ny - 0.5):
        (west, east), (south, north) = map_.grid.x_limits_m, map_.grid.y_limits_m
        return _refused(
            off, f"{where} is not on the map, which covers x {west:.1f} to {east:.1f} and y {south:.1f} to {north:.1f}"
        )
    cell = round(row), round(column)
    if np.isfinite(map_.care[cell]):
        return cell
    rows, columns = np.nonzero(np.isfinite(map_.care))
    apart = map_.grid.resolution_m * np.hypot(rows - row, columns - column)
    if len(apart) and apart.min() <= model.leave_m:
        nearest = int(np.argmin(apart))
        return int(rows[nearest]), int(columns[nearest])
    if not map_.layers.known[cell]:
        return _refused(unknown, f"{where} lies where the map has no heights")
    slope, step = map_.layers.slope_deg[cell], map_.layers.step_m[cell]
    return _refused(
        forbidden, f"{where} lies on ground that may not be driven on: {slope:.0f} deg steep, breaks of {step:.2f} m"
    )


def _refused(code: Refusal, reason: str) -> Route:
    return Route(np.zeros((0, 2)), np.inf, code, reason)


def _layers(map_: CostMap, costs: SlopeCosts) -> tuple[Any, ...]:
    """The last arguments of `kernels.line_cost`."""
    part = map_.layers
    tables = _tables(costs, costs.limits)
    return (part.rise_x, part.rise_y, part.level, map_.care, map_.grid.resolution_m, *tables)


def _tables(costs: SlopeCosts, limits: FloatArray) -> tuple[Any, ...]:
    """The last arguments of the kernels: what a metre costs, and how steep it may be."""
    return costs.along, costs.across, costs.risk, limits, costs.holds_up, BIN


def _followed(onward: IntArray, start: tuple[int, int]) -> IntArray:
    """Cells (M, 2) from the start to where the way ends."""
    nx = onward.shape[1]
    flat, cells = start[0] * nx + start[1], []
    while flat >= 0:
        cells.append(divmod(flat, nx))
        flat = int(onward.flat[flat])
    return np.array(cells, dtype=np.int32)


def _straightened(map_: CostMap, cells: IntArray, to_go: FloatArray, start_w: Place, goal_w: Place) -> Route:
    """The cells' way with as few waypoints as cost allows, from the very start to the very goal."""
    points = cells[:, ::-1].astype(np.float64)
    left = to_go[cells[:, 0], cells[:, 1]]
    kept = kernels.pulled(points, left, SLACK, MOST_LEG_CELLS, *_layers(map_, map_.costs))
    way = np.asarray(map_.grid.origin_m) + map_.grid.resolution_m * points[kept]
    way = np.vstack([[start_w], way[1:-1], [goal_w]])
    cost = way_cost(map_, way)
    return Route(way, cost if np.isfinite(cost) else float(left[0]), cells=cells)


def _no_way(map_: CostMap, start: tuple[int, int], seeds: FloatArray) -> Route:
    """A refusal that tells the limits, and what the least bad way would meet."""
    part, costs = map_.layers, map_.costs
    care = np.where(np.isfinite(map_.care), map_.care, OVER)
    tables = _tables(costs, np.full_like(costs.limits, np.inf))
    cell = map_.grid.resolution_m
    # Without limits a metre that is too steep costs `route_cost.HELD_UP`.
    prices = kernels.step_prices(part.rise_x, part.rise_y, part.level, care, *tables)
    _, onward = kernels.cost_to_goal(prices, seeds, cell)
    cells = tuple(_followed(onward, start).T)
    limits = f"{costs.up_deg:.0f} deg up, {costs.down_deg:.0f} down and {costs.across_deg:.0f} across"
    closed = ~np.isfinite(map_.care[cells])
    gaps, slope = ~part.known[cells], np.where(part.known[cells], part.slope_deg[cells], 0.0)
    worst = int(np.argmax(np.where(closed, slope, 0.0) if closed.any() else slope))
    x, y = map_.place((int(cells[0][worst]), int(cells[1][worst])))
    meets = f"meets {slope[worst]:.0f} deg at ({x:.1f}, {y:.1f}) m"
    if gaps.any():
        x, y = map_.place((int(cells[0][np.argmax(gaps)]), int(cells[1][np.argmax(gaps)])))
        meets = f"crosses ground without heights from ({x:.1f}, {y:.1f}) m on"
    elif closed.any() and slope[worst] < min(costs.up_deg, costs.down_deg, costs.across_deg):
        meets = f"crosses a break of the ground, or a place known to be blocked, at ({x:.1f}, {y:.1f}) m"
    return _refused(Refusal.NO_WAY, f"no way keeps to {limits}; the least bad one {meets}")
