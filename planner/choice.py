"""Choosing a way: straight to the goal if the row search allows, else round, else through a narrower gap.

A row search that ends at a blocked row is the sign of a dead end. Then the goal field, over all that is remembered,
names a sub-goal on the way out and the row search is made towards that one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.goal_field import STEP_M, FieldGround, GoalField, field_ground, goal_field
from planner.ground_cells import sample
from planner.map_kernels import at_places, densely
from planner.obstacle_map import (
    MAX_CLEARANCE_M,
    DriveModel,
    Frame2,
    let_leave,
    near,
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
SET_OUT_COST_M = 4.0  # more than the first stretch can cost or spare
AS_GOOD_SHARE, AS_GOOD_M = 1.15, 0.5  # of the least cost of a way round, so good the straight way may be
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
    nose_down_deg: float = 0.0  # as it stands, rocks under its wheels included


@dataclass(frozen=True)
class Models:
    """All that planning is tuned by."""

    footprint: Footprint
    drive: DriveModel = DriveModel()  # noqa: RUF009 - frozen
    rows: RowModel = RowModel()  # noqa: RUF009 - frozen
    rules: TraversabilityRules | None = None  # None: the shipped ones


@dataclass(frozen=True, eq=False)
class Scene:
    """What one choice is made from."""

    memory: TerrainMemory
    table_w: FloatArray  # (N, 7) obstacles
    place: Place
    models: Models
    room_rad: tuple[float, float]  # how far it can turn on the spot here, right (<= 0) and left

    def need_m(self, *, squeeze: bool) -> float:
        """Centre line to hard rock."""
        return self.models.drive.need_m(self.models.footprint, squeeze=squeeze)

    def passed(self, *, squeeze: bool) -> FloatArray:
        """Obstacles (N, 7) as a way takes them."""
        return passed_by(self.table_w, self.models.drive, squeeze=squeeze)


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
    scene = Scene(memory, table_w, place, models, _room(memory, table_w, place, models))
    straight = None
    if not detour:
        straight = _direct(scene, squeeze=False, end_cost=_distance_to(place))
        if straight.blocked_row is None and straight.candidates:
            return _chosen(straight, scene, detour=False, squeeze=False, reason="free rows to the goal")
    ground = field_ground(memory.cells, np.asarray(place.position_w))
    narrow = _setting_out(scene, _field(scene, ground, squeeze=True), squeeze=True)
    most = narrow.cost * SQUEEZE_SHARE + SQUEEZE_M  # a longer way round is no better than a narrow gap
    wide = _setting_out(scene, _field(scene, ground, squeeze=False, most=most + SET_OUT_COST_M), squeeze=False)
    through = most < wide.cost
    for squeeze in (True, False) if through else (False, True):
        if through and not squeeze:  # now the whole of it is asked for
            wide = _setting_out(scene, _field(scene, ground, squeeze=False), squeeze=False)
        choice = _round(scene, narrow if squeeze else wide, squeeze=squeeze)
        if choice is not None:
            return replace(choice, to_go=narrow.field.at)
    enclosed = not np.isfinite(narrow.here)
    if not enclosed:
        ahead = _ahead(scene, narrow)
        if ahead is not None:
            return replace(ahead, to_go=narrow.field.at)
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
    count = np.maximum(np.ceil((high - low) / STEP_M), 2.0)  # places are told apart as finely as in the goal field
    step = (high - low) / (count - 1.0)
    nodes = low + step * np.clip(np.round((points - low) / step), 0.0, count - 1.0)
    clearance, hill = at_places(table_w, nodes, MAX_CLEARANCE_M)
    need = models.drive.need_m(models.footprint)
    close = np.clip((need + models.drive.comfort_m - clearance) / models.drive.comfort_m, 0, 1)
    seen, rough = sample(memory.cells, points)
    rows = models.rows
    metre = 1.0 + rows.hill_cost * hill + rows.near_cost * close**2
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
    points: FloatArray = densely(np.ascontiguousarray(waypoints_w, dtype=np.float64), spacing_m)
    return points


def score(candidates: tuple[Candidate, ...], scene: Scene, *, squeeze: bool) -> FloatArray:
    """Traversability (N,) of candidate ways."""
    table_w, need_m = scene.passed(squeeze=squeeze), scene.need_m(squeeze=squeeze)
    straight = np.array([np.linalg.norm(c.waypoints_w[-1] - c.waypoints_w[0]) for c in candidates])
    clear = [segment_clearance(table_w, c.waypoints_w[1:]).min(initial=c.clearance_m) for c in candidates]
    features = PathFeatures(
        spare_m=np.maximum(np.array(clear) - need_m, 0.0),
        risk=np.array([c.hill for c in candidates]),
        roughness=np.array([c.roughness for c in candidates]),
        slope_deg=np.full(len(candidates), scene.place.slope_deg),
        length_ratio=np.array([c.length_m for c in candidates]) / np.maximum(straight, 1e-6),
    )
    return traversability(features, scene.models.rules)


def _direct(scene: Scene, *, squeeze: bool, end_cost: EndCost) -> RowSearch:
    return _towards(scene, np.asarray(scene.place.goal_w), squeeze=squeeze, end_cost=end_cost)


def _towards(scene: Scene, target_w: FloatArray, *, squeeze: bool, end_cost: EndCost) -> RowSearch:
    """Row search from the rover in the frame that points at a target."""
    place, models = scene.place, scene.models
    offset = target_w - place.position_w
    distance = float(np.linalg.norm(offset))
    frame = Frame2(place.position_w, float(np.arctan2(offset[1], offset[0])))
    need_m, prices = scene.need_m(squeeze=squeeze), partial(turn_prices, place)
    task = Task(frame, max(distance, 0.3), place.heading_rad, need_m, end_cost, scene.room_rad, prices)
    return search(scene.passed(squeeze=squeeze), scene.memory.cells, task, models.drive, models.rows)


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


def _field(scene: Scene, ground: FieldGround, *, squeeze: bool, most: float = np.inf) -> GoalField:
    """The goal field, as far as any choice asks: ways that are longer than the least and all turns are not taken."""
    place, need = scene.place, scene.need_m(squeeze=squeeze)
    slack = AS_GOOD_M + SET_OUT_COST_M + float(TURN_M * turn_prices(place, np.array([-np.pi, np.pi])).max())
    table, position, goal = scene.passed(squeeze=squeeze), np.asarray(place.position_w), np.asarray(place.goal_w)
    bounds = slack, AS_GOOD_SHARE - 1.0, most
    return goal_field(table, ground, position, goal, place.goal_radius_m, need, scene.models.drive, bounds)


def _round(scene: Scene, out: SettingOut, *, squeeze: bool) -> Choice | None:
    """A way that ends nearer to the goal by the field: the straight one if as good, else by a sub-goal on its way."""
    field, here, way = out.field, out.here, out.way_w
    if not np.isfinite(here):
        return None
    direct = _direct(scene, squeeze=squeeze, end_cost=field.at)
    as_good = AS_GOOD_SHARE * here + AS_GOOD_M
    if direct.candidates and direct.blocked_row is None and direct.candidates[0].cost < as_good:
        reason = "free rows to the goal again" if not squeeze else "a narrow way to the goal"
        return _chosen(direct, scene, detour=False, squeeze=squeeze, reason=reason)
    if len(way) < 2:
        return None
    arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    for distance in SUB_GOALS_M:
        if distance > arcs[-1] + 0.5 and distance != SUB_GOALS_M[-1]:
            continue
        sub_goal = way[min(int(np.searchsorted(arcs, distance)), len(way) - 1)]
        found = _towards(scene, sub_goal, squeeze=squeeze, end_cost=field.at)
        ends = field.at(np.array([c.waypoints_w[-1] for c in found.candidates])) if found.candidates else np.zeros(0)
        if found.blocked_row is None and len(ends) and ends[0] < here - 0.4 * min(distance, arcs[-1]):
            reason = "round by a side" if not squeeze else "round through a narrow gap"
            return _chosen(found, scene, detour=True, squeeze=squeeze, reason=reason)
    return None


@dataclass(frozen=True, eq=False)
class SettingOut:
    """How a way round begins."""

    field: GoalField
    here: float  # cost to the goal from the rover by the field
    way_w: FloatArray  # (N, 2) from the rover on, empty if none leads on
    cost: float  # of it, with its first turns


def _setting_out(scene: Scene, field: GoalField, *, squeeze: bool) -> SettingOut:
    """The field's way from the rover on and its cost with its first turns.

    The field does not know where the rover looks: a way that goes on ahead may cost less than the field's own with its
    turn. So straight first stretches in all directions are compared with that one, each with the turn at its end.
    """
    place, models, position = scene.place, scene.models, np.asarray(scene.place.position_w)
    here, need = float(field.at(position[None])[0]), scene.need_m(squeeze=squeeze)
    own = field.way(position, max(SUB_GOALS_M))
    own_cost = np.inf
    if len(own) > 1:
        end = own[min(round(SET_OUT_M / STEP_M), len(own) - 1)]
        turn = wrap_angle(float(np.arctan2(*(end - position)[::-1])) - place.heading_rad)
        own_cost = float(field.at(end[None])[0]) + TURN_M * turn_price(place, turn)
    headings = place.heading_rad + np.linspace(-np.pi, np.pi, DIRECTIONS, endpoint=False)
    ends = position + SET_OUT_M * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    there_and_back = np.stack([np.broadcast_to(position, ends.shape), ends], axis=1).reshape(-1, 2)
    close = near(scene.table_w, position, SET_OUT_M + MAX_CLEARANCE_M)
    around = let_leave(passed_by(close, models.drive, squeeze=squeeze), position, need)
    free = segment_clearance(around, there_and_back)[::2] >= need
    free &= room_for(headings - place.heading_rad, scene.room_rad)
    cost = np.where(free, field.at(ends) + TURN_M * turn_prices(place, headings - place.heading_rad), np.inf)
    best, least = None, own_cost
    for n in np.argsort(cost, kind="stable"):
        if cost[n] >= least:  # and so are all others: a second turn only adds to it
            break
        onward = field.way(ends[n], SET_OUT_M)
        if len(onward) > 1:
            turn = wrap_angle(float(np.arctan2(*(onward[-1] - ends[n])[::-1])) - headings[n])
            there = replace(place, turning=turning(scene.memory.rocks, ends[n], headings[n], models.footprint))
            cost[n] += TURN_M * turn_price(there, turn)
        if cost[n] < least:
            best, least = int(n), float(cost[n])
    if best is None:
        return SettingOut(field, here, own, own_cost)
    return SettingOut(field, here, np.vstack([position, field.way(ends[best], max(SUB_GOALS_M) - SET_OUT_M)]), least)


def _ahead(scene: Scene, out: SettingOut) -> Choice | None:
    """A short way about straight ahead, to where there is room to turn; not if it leads much farther from the goal."""
    place, field = scene.place, out.field
    position = np.asarray(place.position_w)
    way = field.way(position, 1.0)
    wanted = np.arctan2(*(way[-1] - position)[::-1]) - place.heading_rad
    heading = place.heading_rad + float(np.clip((wanted + np.pi) % (2 * np.pi) - np.pi, *scene.room_rad))
    for distance in AHEAD_M:
        target = position + distance * np.array([np.cos(heading), np.sin(heading)])
        found = _towards(scene, target, squeeze=True, end_cost=field.at)
        if found.blocked_row is None and found.candidates and float(field.at(target[None])[0]) < out.here + 2.0:
            reason = "ahead to where there is room to turn"
            return _chosen(found, scene, detour=True, squeeze=True, reason=reason)
    return None


def _chosen(found: RowSearch, scene: Scene, *, detour: bool, squeeze: bool, reason: str) -> Choice:
    """The candidate of highest traversability, where a metre of way counts too (step 10 of the paper's table 1)."""
    scores = score(found.candidates, scene, squeeze=squeeze)
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
