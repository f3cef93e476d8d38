"""Choosing a way: straight to the goal if the row search allows, else round, else through a narrower gap.

A row search that ends at a blocked row is the sign of a dead end. Then the goal field, over all that is remembered,
names a sub-goal on the way out and the row search is made towards that one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from planner.goal_field import STEP_M, GoalField, goal_field
from planner.ground_cells import sample
from planner.obstacle_map import (
    MAX_CLEARANCE_M,
    DriveModel,
    Frame2,
    let_leave,
    near,
    obstacle_grid,
    passed_by,
    segment_clearance,
)
from planner.room import FREE, Turning, turn_range, turning
from planner.row_search import Candidate, EndCost, RowModel, RowSearch, Task, room_for, search
from planner.terrain_map import TerrainMemory
from planner.traversability import PathFeatures, TraversabilityRules, traversability
from worlds.geometry import wrap_angle
from worlds.types import FloatArray, Footprint

SUB_GOALS_M = (6.5, 4.5, 3.0, 2.0, 1.2)  # along the field's way, tried in turn
SET_OUT_M, DIRECTIONS = 1.2, 24  # of the first stretch of a way round, and how many are compared
AHEAD_M = (1.8, 1.0)  # to make room
SQUEEZE_SHARE, SQUEEZE_M = 1.1, 2.0  # cost of a way through narrow gaps against one that keeps the whole margin
TURN_M = 1.0  # of way that a radian of turning on the spot costs where an old way is compared with a new one
SLOPE_DEG, DEARER_BY_DEG = 5.0, 0.3  # steeper, each degree makes turns on the spot dearer: wheels dig, and jam
DEARER_BY_ROCK = 1.0  # radians for each climb height of rocks that wheels meet
WORTH_M = 4.0  # metres of way that full traversability is worth when candidates are compared


@dataclass(frozen=True)
class Place:
    """Where the rover is, where it wants to go, and how the ground tilts."""

    position_w: tuple[float, float]
    heading_rad: float
    goal_w: tuple[float, float]
    goal_radius_m: float
    slope_deg: float = 0.0
    bold: bool = False  # may turn over ground that was never seen
    speed_m_s: float = 0.0
    downhill_w: tuple[float, float] = (0.0, 0.0)  # of the general slope, rise over run
    turning: Turning = FREE  # what wheels would meet in turns on the spot


@dataclass(frozen=True)
class Models:
    """All that planning is tuned by."""

    footprint: Footprint
    drive: DriveModel = DriveModel()  # noqa: RUF009 - frozen
    rows: RowModel = RowModel()  # noqa: RUF009 - frozen
    rules: TraversabilityRules | None = None  # None: the shipped ones


@dataclass(frozen=True, eq=False)
class Choice:
    """The way chosen, and the others; ``way`` is None when there is none."""

    way: Candidate | None
    traversability: float
    candidates: tuple[Candidate, ...]
    scores: tuple[float, ...]  # traversability of each candidate
    detour: bool  # round by a sub-goal
    squeeze: bool  # with the narrow margin
    enclosed: bool  # no way at all through what is remembered
    reason: str
    to_go: EndCost | None = None  # what is still to go from a place; None: the straight distance


def choose(memory: TerrainMemory, table_w: FloatArray, place: Place, models: Models, *, detour: bool) -> Choice:
    """The best way from ``place`` among the obstacles ``table_w`` (N, 7); ``detour`` tells that it is on a way round.

    On a detour the straight way is taken again only when the field finds it no worse than the way round.
    """
    straight = None
    if not detour:
        straight = _direct(memory, table_w, place, models, squeeze=False, end_cost=_distance_to(place))
        if straight.blocked_row is None and straight.candidates:
            return _chosen(
                straight, table_w, place, models, detour=False, squeeze=False, reason="free rows to the goal"
            )
    fields = [_field(memory, table_w, place, models, squeeze=squeeze) for squeeze in (False, True)]
    wide, narrow = (float(field.at(np.array([place.position_w]))[0]) for field in fields)
    ways, costs = zip(
        *(
            _setting_out(memory, table_w, place, models, field, squeeze=squeeze)
            for squeeze, field in zip((False, True), fields, strict=True)
        ),
        strict=True,
    )
    through = costs[True] * SQUEEZE_SHARE + SQUEEZE_M < costs[False]  # a long way round is no better than a narrow gap
    for squeeze in (True, False) if through else (False, True):
        here = narrow if squeeze else wide
        if not np.isfinite(here):
            continue
        choice = _round(memory, table_w, place, models, fields[squeeze], here, ways[squeeze], squeeze=squeeze)
        if choice is not None:
            return replace(choice, to_go=fields[True].at)
    enclosed = not np.isfinite(narrow)
    if not enclosed:
        ahead = _ahead(memory, table_w, place, models, fields[True], narrow)
        if ahead is not None:
            return replace(ahead, to_go=fields[True].at)
    row = straight.blocked_row if straight is not None else None
    where = f"row {row} ahead is blocked" if row is not None else "no row is free"
    return Choice(None, 0.0, (), (), detour=True, squeeze=True, enclosed=enclosed, reason=where)


def way_cost(
    waypoints_w: FloatArray,
    memory: TerrainMemory,
    table_w: FloatArray,
    place: Place,
    models: Models,
    to_go: EndCost | None = None,
) -> float:
    """Cost of any polyline in metres of way, with the first turn and the rest to the goal, straight without ``to_go``.

    To compare old and new ways.
    """
    points = dense(waypoints_w, 0.25)
    low, high = points.min(axis=0) - 0.1, points.max(axis=0) + 0.1
    shape = (max(2, int(np.ceil((high[0] - low[0]) / 0.15))), max(2, int(np.ceil((high[1] - low[1]) / 0.15))))
    grid = obstacle_grid(table_w, (low[0], high[0]), (low[1], high[1]), shape)
    index = np.round((points - low) / [grid.step_x_m, grid.step_y_m]).astype(np.int64)
    index = np.clip(index, 0, np.array(shape) - 1)
    need = models.drive.need_m(models.footprint)
    close = np.clip(
        (need + models.drive.comfort_m - grid.clearance_m[index[:, 0], index[:, 1]]) / models.drive.comfort_m, 0, 1
    )
    seen, rough = sample(memory.cells, points)
    rows = models.rows
    metre = 1.0 + rows.hill_cost * grid.hill[index[:, 0], index[:, 1]] + rows.near_cost * close**2
    metre += rows.rough_cost * rough + rows.unseen_cost * ~seen
    length = float(np.linalg.norm(np.diff(waypoints_w, axis=0), axis=1).sum())
    end = waypoints_w[-1]
    rest = float(np.linalg.norm(end - np.asarray(place.goal_w)) if to_go is None else to_go(end[None])[0])
    return length * float(metre.mean()) + rest + TURN_M * turn_price(place, turn_onto(waypoints_w, place))


def turn_prices(place: Place, turns_rad: FloatArray) -> FloatArray:
    """Prices (N,) of turns on the spot, in radians on level ground without rocks, which would cost the same."""
    steeper = DEARER_BY_DEG * max(place.slope_deg - SLOPE_DEG, 0.0)
    prices: FloatArray = np.abs(turns_rad) * (1.0 + steeper) + DEARER_BY_ROCK * place.turning.heights(turns_rad)
    return prices


def turn_price(place: Place, turn_rad: float) -> float:
    """The price of one turn, see `turn_prices`."""
    return float(turn_prices(place, np.array([turn_rad]))[0])


def turn_onto(way_w: FloatArray, place: Place) -> float:
    """Angle from the rover's heading to where a way (N, 2) leads in its first half metre, or half second more."""
    arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way_w, axis=0), axis=1))])
    ahead = [np.interp(0.5 + 0.5 * place.speed_m_s, arcs, way_w[:, axis]) - place.position_w[axis] for axis in (0, 1)]
    return wrap_angle(float(np.arctan2(ahead[1], ahead[0])) - place.heading_rad)


def dense(waypoints_w: FloatArray, spacing_m: float) -> FloatArray:
    """The polyline with points at most ``spacing_m`` apart."""
    pieces = []
    for start, end in pairwise(waypoints_w):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / spacing_m)))
        pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
    return np.concatenate([*pieces, waypoints_w[-1:]])


def score(
    candidates: tuple[Candidate, ...], table_w: FloatArray, place: Place, models: Models, need_m: float
) -> FloatArray:
    """Traversability (N,) of candidate ways."""
    straight = np.array([np.linalg.norm(c.waypoints_w[-1] - c.waypoints_w[0]) for c in candidates])
    clear = [segment_clearance(table_w, c.waypoints_w[1:]).min(initial=c.clearance_m) for c in candidates]
    features = PathFeatures(
        spare_m=np.maximum(np.array(clear) - need_m, 0.0),
        risk=np.array([c.hill for c in candidates]),
        roughness=np.array([c.roughness for c in candidates]),
        slope_deg=np.full(len(candidates), place.slope_deg),
        length_ratio=np.array([c.length_m for c in candidates]) / np.maximum(straight, 1e-6),
    )
    return traversability(features, models.rules)


def _direct(
    memory: TerrainMemory, table_w: FloatArray, place: Place, models: Models, *, squeeze: bool, end_cost: EndCost
) -> RowSearch:
    return _towards(memory, table_w, place, models, np.asarray(place.goal_w), squeeze=squeeze, end_cost=end_cost)


def _towards(
    memory: TerrainMemory,
    table_w: FloatArray,
    place: Place,
    models: Models,
    target_w: FloatArray,
    *,
    squeeze: bool,
    end_cost: EndCost,
) -> RowSearch:
    """Row search from the rover in the frame that points at a target."""
    position = np.asarray(place.position_w)
    offset = target_w - position
    distance = float(np.linalg.norm(offset))
    frame = Frame2(place.position_w, float(np.arctan2(offset[1], offset[0])))
    task = Task(
        frame,
        max(distance, 0.3),
        place.heading_rad,
        models.drive.need_m(models.footprint, squeeze=squeeze),
        end_cost,
        _room(memory, table_w, place, models),
        partial(turn_prices, place),
    )
    table = passed_by(table_w, models.drive, squeeze=squeeze)
    return search(table, memory.cells, task, models.drive, models.rows)


def _room(memory: TerrainMemory, table_w: FloatArray, place: Place, models: Models) -> tuple[float, float]:
    """How far the rover can turn on the spot where it stands."""
    cells = None if place.bold else memory.cells
    position = np.asarray(place.position_w)
    return turn_range(table_w, cells, position, place.heading_rad, models.footprint, place.downhill_w)


def _distance_to(place: Place) -> EndCost:
    goal = np.asarray(place.goal_w)

    def end_cost(points_w: FloatArray) -> FloatArray:
        distance: FloatArray = np.linalg.norm(points_w - goal, axis=1)
        # A last row beside the goal must end at it, not just near it.
        cost: FloatArray = distance * (1.0 + 2.0 * np.clip(1.5 - distance.min(), 0.0, 1.0))
        return cost

    return end_cost


def _field(memory: TerrainMemory, table_w: FloatArray, place: Place, models: Models, *, squeeze: bool) -> GoalField:
    need = models.drive.need_m(models.footprint, squeeze=squeeze)
    position, goal = np.asarray(place.position_w), np.asarray(place.goal_w)
    table = passed_by(table_w, models.drive, squeeze=squeeze)
    return goal_field(table, memory.cells, position, goal, place.goal_radius_m, need, models.drive)


def _round(
    memory: TerrainMemory,
    table_w: FloatArray,
    place: Place,
    models: Models,
    field: GoalField,
    here: float,
    way: FloatArray,
    *,
    squeeze: bool,
) -> Choice | None:
    """A way that ends nearer to the goal by the field: the straight one if as good, else by a sub-goal on ``way``."""
    direct = _direct(memory, table_w, place, models, squeeze=squeeze, end_cost=field.at)
    if direct.candidates and direct.blocked_row is None and direct.candidates[0].cost < 1.15 * here + 0.5:
        reason = "free rows to the goal again" if not squeeze else "a narrow way to the goal"
        return _chosen(direct, table_w, place, models, detour=False, squeeze=squeeze, reason=reason)
    if len(way) < 2:
        return None
    arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    for distance in SUB_GOALS_M:
        if distance > arcs[-1] + 0.5 and distance != SUB_GOALS_M[-1]:
            continue
        sub_goal = way[min(int(np.searchsorted(arcs, distance)), len(way) - 1)]
        found = _towards(memory, table_w, place, models, sub_goal, squeeze=squeeze, end_cost=field.at)
        ends = field.at(np.array([c.waypoints_w[-1] for c in found.candidates])) if found.candidates else np.zeros(0)
        if found.blocked_row is None and len(ends) and ends[0] < here - 0.4 * min(distance, arcs[-1]):
            reason = "round by a side" if not squeeze else "round through a narrow gap"
            return _chosen(found, table_w, place, models, detour=True, squeeze=squeeze, reason=reason)
    return None


def _setting_out(
    memory: TerrainMemory, table_w: FloatArray, place: Place, models: Models, field: GoalField, *, squeeze: bool
) -> tuple[FloatArray, float]:
    """The field's way (N, 2) from the rover on, empty if none leads on, and its cost with its first turns.

    The field does not know where the rover looks: a way that goes on ahead may cost less than the field's own with its
    turn. So straight first stretches in all directions are compared with that one, each with the turn at its end.
    """
    position, need = np.asarray(place.position_w), models.drive.need_m(models.footprint, squeeze=squeeze)
    own = field.way(position, max(SUB_GOALS_M))
    own_cost = np.inf
    if len(own) > 1:
        end = own[min(round(SET_OUT_M / STEP_M), len(own) - 1)]
        turn = wrap_angle(float(np.arctan2(*(end - position)[::-1])) - place.heading_rad)
        own_cost = float(field.at(end[None])[0]) + TURN_M * turn_price(place, turn)
    headings = place.heading_rad + np.linspace(-np.pi, np.pi, DIRECTIONS, endpoint=False)
    ends = position + SET_OUT_M * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    there_and_back = np.stack([np.broadcast_to(position, ends.shape), ends], axis=1).reshape(-1, 2)
    close = near(table_w, position, SET_OUT_M + MAX_CLEARANCE_M)
    around = let_leave(passed_by(close, models.drive, squeeze=squeeze), position, need)
    right, left = _room(memory, table_w, place, models)
    free = segment_clearance(around, there_and_back)[::2] >= need
    free &= room_for(headings - place.heading_rad, (right, left))
    cost = np.where(free, field.at(ends) + TURN_M * turn_prices(place, headings - place.heading_rad), np.inf)
    for n in np.flatnonzero(cost < own_cost):
        onward = field.way(ends[n], SET_OUT_M)
        if len(onward) > 1:
            turn = wrap_angle(float(np.arctan2(*(onward[-1] - ends[n])[::-1])) - headings[n])
            there = replace(place, turning=turning(memory.rocks, ends[n], headings[n], models.footprint))
            cost[n] += TURN_M * turn_price(there, turn)
    best = int(np.argmin(cost))
    if cost[best] >= own_cost or not np.isfinite(cost[best]):
        return own, own_cost
    return np.vstack([position, field.way(ends[best], max(SUB_GOALS_M) - SET_OUT_M)]), float(cost[best])


def _ahead(
    memory: TerrainMemory, table_w: FloatArray, place: Place, models: Models, field: GoalField, here: float
) -> Choice | None:
    """A short way about straight ahead, to where there is room to turn; not if it leads much farther from the goal."""
    position = np.asarray(place.position_w)
    way = field.way(position, 1.0)
    wanted = np.arctan2(*(way[-1] - position)[::-1]) - place.heading_rad
    right, left = _room(memory, table_w, place, models)
    heading = place.heading_rad + float(np.clip((wanted + np.pi) % (2 * np.pi) - np.pi, right, left))
    for distance in AHEAD_M:
        target = position + distance * np.array([np.cos(heading), np.sin(heading)])
        found = _towards(memory, table_w, place, models, target, squeeze=True, end_cost=field.at)
        if found.blocked_row is None and found.candidates and float(field.at(target[None])[0]) < here + 2.0:
            reason = "ahead to where there is room to turn"
            return _chosen(found, table_w, place, models, detour=True, squeeze=True, reason=reason)
    return None


def _chosen(
    found: RowSearch, table_w: FloatArray, place: Place, models: Models, *, detour: bool, squeeze: bool, reason: str
) -> Choice:
    """The candidate of highest traversability, where a metre of way counts too (step 10 of the paper's table 1)."""
    need = models.drive.need_m(models.footprint, squeeze=squeeze)
    table_w = passed_by(table_w, models.drive, squeeze=squeeze)
    scores = score(found.candidates, table_w, place, models, need)
    worth = WORTH_M * scores - np.array([c.cost for c in found.candidates])
    best = int(np.argmax(worth))
    return Choice(
        found.candidates[best],
        float(scores[best]),
        found.candidates,
        tuple(float(value) for value in scores),
        detour=detour,
        squeeze=squeeze,
        enclosed=False,
        reason=reason,
    )
