"""Ways among obstacles that a laser scanner has placed to centimetres: the least driving time over its map.

The speed that is safe at a place grows with the room beside the rover; a metre of way costs what it takes at that
speed, so the cheapest way is the quickest, and the same law slows the rover where it drives.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.choice import Choice, Place, dense
from planner.laser_kernels import cheapest_way, line_cost, pull_taut
from planner.laser_map import CELL_M, LaserMap, Layer
from planner.obstacle_map import MAX_CLEARANCE_M, DriveModel, obstacle_grid
from planner.row_search import Candidate
from worlds.types import FloatArray, Footprint


@dataclass(frozen=True)
class SpeedModel:
    """How fast the rover may drive beside obstacles."""

    most_m_s: float = 1.6
    least_m_s: float = 0.35
    tight_m: float = 0.05  # room beside the rover at which it creeps
    gain_per_s: float = 2.5  # speed a metre of room beyond that
    brake_m_s2: float = 0.9
    guard_m: float = 2.0  # so far straight ahead is looked for what would be hit
    reaction_s: float = 0.3  # from a look to slower wheels
    creep_m_s: float = 0.12
    unseen_m_s: float = 0.8  # into ground that no beam has crossed
    unseen_cost: float = 0.3  # of a metre over such ground, beside its time
    margin_m: float = 0.06  # beyond half the width, the least that is driven
    path_slack: float = 0.03  # of its cost, that a straight piece may cost more
    most_leg_m: float = 1.5
    depth_m: float = 9.0  # of a way that is handed on
    jump_s: float = 0.8  # a way replaces the one being driven if it is quicker by this ...
    jump_share: float = 0.10  # ... and this share
    turn_s_rad: float = 0.8  # time that turning onto a way takes


# By the camera alone: a look each half second, of a narrow field.
CAMERA_SPEED = SpeedModel(most_m_s=0.6, least_m_s=0.25, brake_m_s2=0.3, unseen_m_s=0.3, unseen_cost=1.5, margin_m=0.09)


@dataclass(frozen=True, eq=False)
class Corridor:
    """What one decision needs of the map: grids ``[ix, iy]``, the first cell's middle at ``first_w``."""

    first_w: FloatArray  # (2,)
    clearance_m: Layer
    cost: Layer  # of a metre in metres at full speed; inf where the rover must not be
    unseen: Layer  # 1 where no beam has been
    footprint: Footprint
    model: SpeedModel

    def cells(self, places_w: FloatArray) -> FloatArray:
        """Places (..., 2) in cells."""
        return np.asarray((places_w - self.first_w) / CELL_M)

    def way_cost(self, way_w: FloatArray, goal_w: FloatArray) -> float:
        """Cost of a polyline (N, 2) and of the straight rest to the goal; inf if it is blocked."""
        cells = self.cells(way_w)
        pieces = [line_cost(self.cost, a[0], a[1], b[0], b[1], CELL_M) for a, b in pairwise(cells)]
        return float(sum(pieces)) + float(np.linalg.norm(way_w[-1] - goal_w))

    def speed_m_s(self, way_w: FloatArray) -> float:
        """The speed at the beginning of a way from which the rover can brake to what each later place allows."""
        model = self.model
        points = dense(way_w, 2 * CELL_M)
        cells = np.clip(np.round(self.cells(points)).astype(int), 0, np.array(self.clearance_m.shape) - 1)
        at = cells[:, 0], cells[:, 1]
        allowed = room_speed(self.clearance_m[at], self.footprint, model)
        allowed = np.where(self.unseen[at] > 0, np.minimum(allowed, model.unseen_m_s), allowed)
        arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return float(np.sqrt(allowed**2 + 2.0 * model.brake_m_s2 * arcs).min())

    def guarded_m_s(self, place: Place) -> float:
        """The speed from which the rover can brake before what stands straight ahead, wherever its way leads."""
        model = self.model
        arcs = CELL_M * np.arange(round(model.guard_m / CELL_M))
        heading = np.array([np.cos(place.heading_rad), np.sin(place.heading_rad)])
        cells = np.round(self.cells(np.asarray(place.position_w) + arcs[:, None] * heading)).astype(int)
        cells = np.clip(cells, 0, np.array(self.clearance_m.shape) - 1)
        blocked = np.flatnonzero(self.clearance_m[cells[:, 0], cells[:, 1]] < self.footprint.width_m / 2.0 + 0.02)
        if not len(blocked):
            return model.most_m_s
        room = arcs[blocked[0]] - self.footprint.length_m / 2.0
        late = model.brake_m_s2 * model.reaction_s
        return max(float(np.sqrt(late**2 + 2.0 * model.brake_m_s2 * max(room, 0.0)) - late), model.creep_m_s)


def room_speed(clearance_m: Layer, footprint: Footprint, model: SpeedModel) -> FloatArray:
    """Safe speed where the nearest obstacle is so far from the middle of the rover."""
    room = clearance_m - footprint.width_m / 2.0 - model.tight_m
    most = min(model.most_m_s, footprint.max_speed_m_s)
    return np.asarray(np.clip(model.gain_per_s * room, model.least_m_s, most))


def corridor(
    laser_map: LaserMap, table_w: FloatArray, place: Place, footprint: Footprint, drive: DriveModel, model: SpeedModel
) -> Corridor:
    """The map as seen for one decision; ``table_w`` (N, 7) are obstacles that other eyes have seen."""
    clearance = laser_map.clearance_m(drive.sd_share)
    first = laser_map.origin_w + 0.5 * CELL_M
    hard = table_w[table_w[:, 6] > 0.5]
    if len(hard):
        last = first + CELL_M * (np.array(clearance.shape) - 1)
        grid = obstacle_grid(hard, (first[0], last[0]), (first[1], last[1]), clearance.shape)
        seen = np.where(grid.clearance_m < MAX_CLEARANCE_M, grid.clearance_m, np.inf)
        clearance = np.minimum(clearance, seen).astype(np.float32)
    unseen = (laser_map.log_odds == 0.0).astype(np.float32)
    most = min(model.most_m_s, footprint.max_speed_m_s)
    cost = most / room_speed(clearance, footprint, model) + model.unseen_cost * unseen
    cost[clearance < footprint.width_m / 2.0 + model.margin_m] = np.inf
    _let_leave(cost, clearance, (np.asarray(place.position_w) - first) / CELL_M)
    return Corridor(first, clearance, cost.astype(np.float32), unseen, footprint, model)


def _let_leave(cost: FloatArray, clearance: Layer, here: FloatArray) -> None:
    """Where the rover stands too near to something, it may go where that is no nearer, at a price."""
    i, j = (int(value) for value in np.round(here))
    if np.isfinite(cost[i, j]):
        return
    reach = round(0.5 / CELL_M)
    window = np.s_[max(i - reach, 0) : i + reach + 1, max(j - reach, 0) : j + reach + 1]
    part = cost[window]
    part[~np.isfinite(part) & (clearance[window] >= min(clearance[i, j], 0.25) - 1e-6)] = 20.0


def choose_way(found: Corridor, place: Place, *, detour: bool = False) -> Choice:
    """The quickest way to the goal, or as far as the map goes; no candidates but this one."""
    start = tuple(int(value) for value in np.round(found.cells(np.asarray(place.position_w))))
    goal = tuple(float(value) for value in found.cells(np.asarray(place.goal_w)))
    radius = 0.5 * place.goal_radius_m / CELL_M
    way, cost = cheapest_way(found.cost, (start[0], start[1]), (goal[0], goal[1]), radius, CELL_M)
    if len(way) < 2:
        return Choice(None, 0.0, (), (), detour=detour, squeeze=True, enclosed=True, reason="the scanner sees no gap")
    way = way[: round(found.model.depth_m / CELL_M)]
    model = found.model
    corners = way[pull_taut(found.cost, way, model.most_leg_m, model.path_slack, CELL_M)]
    points = found.first_w + CELL_M * corners
    points[0] = place.position_w
    at = way[:, 0], way[:, 1]
    clear = float(min(found.clearance_m[at].min(), MAX_CLEARANCE_M))
    share = float(np.mean(room_speed(found.clearance_m[at], found.footprint, model))) / model.most_m_s
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    candidate = Candidate(points, cost, length, clear, 0.0, 0.0, float(found.unseen[at].mean()), complete=True)
    return Choice(
        candidate,
        min(share, 1.0),
        (candidate,),
        (min(share, 1.0),),
        detour=detour,
        squeeze=False,
        enclosed=False,
        reason="the quickest way through what the scanner sees",
    )
