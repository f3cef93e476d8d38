"""The recovery ladder: look to the sides, back out the way that was driven in, look behind, and in the end give up."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal

import numpy as np

from planner.choice import SLOPE_DEG, Place
from planner.ground_cells import GroundCells
from planner.guard import free_turn
from planner.obstacle_map import Frame2, in_frame, let_leave, near, segment_clearance
from planner.room import GAP_M, turn_range, turning
from planner.terrain_map import TerrainMemory
from planner.track import way_back
from worlds.geometry import wrap_angle
from worlds.types import FloatArray, Footprint

Moves = tuple[tuple[float, tuple[Literal["back_up", "drive"], float]], ...]  # metres, and which way
# Degrees from the heading at which the rover got stuck, or metres to the rear.
RUNGS: tuple[tuple[Literal["look", "back_up"], float], ...] = (
    ("look", 55.0),
    ("look", -55.0),
    ("back_up", 0.8),
    ("look", 60.0),
    ("look", -60.0),
    ("back_up", 1.6),
    ("look", 120.0),
    ("look", -120.0),
    ("back_up", 2.0),
    ("look", 180.0),
    ("back_up", 5.0),
)
MOST_BACK_M = 5.0
ROOM_TO_TURN_RAD = float(np.deg2rad(70.0))
MOST_MET = 1.2  # heights of rocks that wheels meet in a look to a side, in climb heights
LEAST_LOOK_RAD = float(np.deg2rad(20.0))
LEAST_BACK_M = 0.25
# The longest that there is room for, to the rear if it can be: out of all pits.
NUDGES: Moves = tuple(product((1.2, 0.5, 0.25, 0.12), (("back_up", -1.0), ("drive", 1.0))))
BRAKING_M = 0.1  # from the look that ends a nudge to a standing rover
NUDGE_M_S, STRAIGHT_ON_M = 0.25, 0.6  # path following turns on the spot towards an end that is near and aside
STEPS_BACK: Moves = ((0.5, ("back_up", -1.0)), (0.25, ("back_up", -1.0)))
SHORT_RAD = float(np.deg2rad(8.0))  # of its heading a turn on the spot may end
STRAIGHT_BACK: Moves = ((0.8, ("back_up", -1.0)),)
SLID_RAD = float(np.deg2rad(15.0))  # off its track: on a slope a held rover slides round, and turning back digs
IN_VAIN_M = 0.1  # as near to the last place of trouble, backing out did nothing
MOST_TURN_RAD = float(np.deg2rad(35.0))  # with which backing out of trouble may begin
FARTHER_M = 1.5  # beyond what was asked, to where there is room to turn
HEAVY = 1.5  # weight of a low rock that had better not lie under the belly in a turn: it might be too high
BESET = 0.5  # of its ease, what is left of a place behind a tight passage or over such a rock
LATEST_S, LATEST_S_M = 15.0, 8.0  # for a manoeuvre, and more for each metre


@dataclass(frozen=True, eq=False)
class Manoeuvre:
    """A look or a backing that is under way."""

    kind: Literal["look", "back_up", "drive"]
    reason: str
    start_w: tuple[float, float]
    start_s: float
    heading_rad: float = 0.0  # look: where to
    way_w: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))  # back_up, drive: (N, 2) from the rover on
    nudge_m: float = 0.0  # so far along the way is enough; 0: to its end
    within_rad: float = float(np.deg2rad(12.0))  # look: so near to its heading is enough

    @property
    def distance_m(self) -> float:
        """How far it leads."""
        steps = np.diff(self.way_w, axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


@dataclass(frozen=True)
class Ladder:
    """How far up the ladder the rover is."""

    rung: int = 0
    place_w: tuple[float, float] | None = None  # of the first rung
    heading_rad: float = 0.0  # then
    back_first: bool = False  # trouble was met: back out before anything else
    tried_w: tuple[float, float] | None = None  # where it last did so
    nudged: str = ""  # and the kind of the straight move there
    bold: bool = False  # the second time round: turns may sweep ground that was never seen

    def after_move(self, place_w: FloatArray, progress_m: float) -> Ladder:
        """The ladder from its foot once the rover has got away from where it was stuck."""
        if self.place_w is None or float(np.hypot(*(place_w - self.place_w))) < progress_m:
            return self
        return Ladder(back_first=self.back_first, tried_w=self.tried_w)


def next_manoeuvre(
    ladder: Ladder,
    memory: TerrainMemory,
    table_w: FloatArray,
    track: FloatArray,
    place: Place,
    footprint: Footprint,
    time_s: float,
) -> tuple[Manoeuvre | None, Ladder]:
    """The next rung that there is room for, None at the end of the ladder, and the ladder after it.

    ``track`` (N, 3): poses driven, see `planner.track`.
    """
    if ladder.place_w is None:
        ladder = replace(ladder, place_w=place.position_w, heading_rad=place.heading_rad)
    if ladder.back_first:
        tried, ladder = ladder.tried_w, replace(ladder, back_first=False, tried_w=place.position_w)
        in_vain = tried is not None and float(np.hypot(*np.subtract(tried, place.position_w))) < IN_VAIN_M
        away = _back(0.8, "back out of trouble", memory, table_w, track, place, footprint, time_s)
        if in_vain or away is None or not _easy(_turn_to_back(away, place), place):
            # What did nothing once would do nothing again: without room for a nudge the ladder goes on.
            moves = _other_first(NUDGES, ladder.nudged) if in_vain else NUDGES
            away = _straight(moves, table_w, place, footprint, time_s) or (None if in_vain else away)
        elif place.slope_deg > SLOPE_DEG and abs(_turn_to_back(away, place)) > SLID_RAD:
            away = _straight(STRAIGHT_BACK, table_w, place, footprint, time_s) or away
        if away is not None:
            return away, replace(ladder, nudged=away.kind if away.nudge_m > 0.0 else "")
    while ladder.rung < len(RUNGS):
        kind, amount = RUNGS[ladder.rung]
        ladder = replace(ladder, rung=ladder.rung + 1)
        if kind == "back_up":
            backing = _back(amount, "back out", memory, table_w, track, place, footprint, time_s)
            if backing is not None and (place.bold or _easy(_turn_to_back(backing, place), place)):
                return backing, ladder
        else:
            turn = _possible_turn(ladder.heading_rad + np.deg2rad(amount), table_w, memory.cells, place, footprint)
            if abs(turn) >= LEAST_LOOK_RAD:
                side = "left" if turn > 0 else "right"
                heading = wrap_angle(place.heading_rad + turn)
                return Manoeuvre("look", f"look {side}", place.position_w, time_s, heading_rad=heading), ladder
    return None, ladder


def turn_away(
    hard_w: FloatArray,
    table_w: FloatArray,
    memory: TerrainMemory,
    place: Place,
    footprint: Footprint,
    wanted_rad: float,
    time_s: float,
) -> Manoeuvre | None:
    """The least turn after which no hard obstacle (N, 7) lies before the body, ``wanted_rad``'s side first."""
    position, known = np.asarray(place.position_w), None if place.bold else memory.cells
    right, left = turn_range(table_w, known, position, place.heading_rad, footprint, place.downhill_w)
    easy = place.turning.reach(MOST_MET)
    room = max(right, easy[0]), min(left, easy[1])
    turn = free_turn(hard_w, position, place.heading_rad, wanted_rad, room, footprint)
    if turn is None:
        return None
    further = float(np.clip(turn + np.copysign(SHORT_RAD, turn), *room))
    heading = wrap_angle(place.heading_rad + further)
    return Manoeuvre("look", "turn from a rock ahead", place.position_w, time_s, heading, within_rad=1.1 * SHORT_RAD)


def step_back(table_w: FloatArray, place: Place, footprint: Footprint, time_s: float) -> Manoeuvre | None:
    """Straight back a little, from a rock ahead; None where there is no room."""
    away = _straight(STEPS_BACK, table_w, place, footprint, time_s)
    return away if away is None else replace(away, reason="back from a rock ahead")


def _back(
    least_m: float,
    reason: str,
    memory: TerrainMemory,
    table_w: FloatArray,
    track: FloatArray,
    place: Place,
    footprint: Footprint,
    time_s: float,
) -> Manoeuvre | None:
    """Back out along the track by ``least_m``, or farther to where the rover turns most easily to either side.

    None where the track is too short.
    """
    poses = way_back(track, place.position_w, min(least_m + FARTHER_M, MOST_BACK_M))
    # Turning to and fro on a spot makes a long track that leads nowhere: what counts is how far away it gets.
    apart = np.hypot(*(poses[:, :2] - place.position_w).T)
    if not len(poses) or apart.max() < LEAST_BACK_M:
        return None
    last = int(np.argmax(apart >= min(least_m, apart.max())))
    tight = _first_tight(poses, table_w, place, footprint)
    room = {
        end: _ease(poses[end], memory, table_w, place, footprint) * (BESET if end >= tight else 1.0)
        for end in range(last, len(poses), 2)
    }
    last = next((end for end, eases in room.items() if eases >= 1.0), max(room, key=lambda end: room[end]))
    way = np.vstack([place.position_w, poses[: last + 1 : 3, :2], poses[last, :2]])
    return Manoeuvre("back_up", reason, place.position_w, time_s, way_w=way)


def _ease(pose: FloatArray, memory: TerrainMemory, table_w: FloatArray, place: Place, footprint: Footprint) -> float:
    """How easily the rover turns to either side at a pose (3,): 1 as far as it needs, less where something holds it."""
    position, heading = pose[:2], float(pose[2])
    known = None if place.bold else memory.cells
    right, left = turn_range(table_w, known, position, heading, footprint, place.downhill_w)
    if min(-right, left) < ROOM_TO_TURN_RAD:
        return 0.0
    easy = turning(memory.rocks, position, heading, footprint).reach(MOST_MET)
    share = BESET if _over_rock(pose, table_w, footprint) else 1.0
    return share * min(1.0, min(-easy[0], easy[1]) / ROOM_TO_TURN_RAD)


def _over_rock(pose: FloatArray, table_w: FloatArray, footprint: Footprint) -> bool:
    """Whether the body at a pose (3,) would stand over a rock that is too high for it, or might be."""
    high = table_w[(table_w[:, 6] > 0.5) | (table_w[:, 5] > HEAVY)]
    local = in_frame(near(high, pose[:2], 1.0), Frame2((float(pose[0]), float(pose[1])), float(pose[2])))
    middle = 0.5 * np.abs(local[:, 0:2] + local[:, 2:4])
    return bool(((middle[:, 0] < footprint.length_m / 2) & (middle[:, 1] < footprint.width_m / 2)).any())


def _first_tight(poses: FloatArray, table_w: FloatArray, place: Place, footprint: Footprint) -> int:
    """The first of the poses (N, 3) of a way back from which a hard rock was passed by less than the body's half.

    The rover got by looking ahead; backwards it is blind, and a wheel that climbs the rock's flank brings it onto it.
    """
    need = footprint.width_m / 2
    around = let_leave(
        near(table_w, np.asarray(place.position_w), MOST_BACK_M + 1.0), np.asarray(place.position_w), need
    )
    tight = np.flatnonzero(segment_clearance(around, poses[:, :2]) < need) + 1
    return int(tight[0]) if len(tight) else len(poses)


def _easy(turn_rad: float, place: Place) -> bool:
    """Whether rocks and pits hardly hold the wheels in a turn."""
    right, left = place.turning.reach(MOST_MET)
    return abs(turn_rad) < MOST_TURN_RAD or right <= turn_rad <= left


def _turn_to_back(backing: Manoeuvre, place: Place) -> float:
    """Turn on the spot with which a backing would begin."""
    leg = place.position_w - backing.way_w[min(2, len(backing.way_w) - 1)]
    return wrap_angle(float(np.arctan2(leg[1], leg[0])) - place.heading_rad)


def _straight(moves: Moves, table_w: FloatArray, place: Place, footprint: Footprint, time_s: float) -> Manoeuvre | None:
    """The first of ``moves``, short and straight, that there is room for: no turn digs the wheels in deeper."""
    position = np.asarray(place.position_w)
    ahead = np.array([np.cos(place.heading_rad), np.sin(place.heading_rad)])
    need = footprint.width_m / 2 + GAP_M
    reach = footprint.length_m / 2 - float(np.sqrt(need**2 - (footprint.width_m / 2) ** 2))  # the corners touch its rim
    free = let_leave(near(table_w, position, 2.0), position, need)
    for distance, (kind, sign) in moves:
        end = position + sign * distance * ahead
        tip = end + sign * reach * ahead
        if segment_clearance(free, np.stack([position, tip])).min() >= need:
            way = np.stack([position, end + sign * STRAIGHT_ON_M * ahead])
            return Manoeuvre(kind, "straight, no turn", place.position_w, time_s, way_w=way, nudge_m=distance)
    return None


def _other_first(moves: Moves, kind: str) -> Moves:
    """The moves, those of ``kind`` last: it did nothing."""
    return tuple(sorted(moves, key=lambda move: move[1][0] == kind))


def finished(manoeuvre: Manoeuvre, place: Place, time_s: float, *, seen: bool) -> bool:
    """Whether a manoeuvre is done: turned there and ``seen`` anew, backed so far, or tried too long."""
    if time_s - manoeuvre.start_s > LATEST_S + LATEST_S_M * manoeuvre.distance_m:
        return True
    if manoeuvre.kind == "look":
        there = abs(wrap_angle(manoeuvre.heading_rad - place.heading_rad)) < manoeuvre.within_rad
        return there and seen
    moved = float(np.hypot(*np.subtract(place.position_w, manoeuvre.start_w)))
    if manoeuvre.nudge_m > 0.0:
        return moved > max(manoeuvre.nudge_m - BRAKING_M, 0.5 * manoeuvre.nudge_m)
    end = manoeuvre.way_w[-1]
    left = float(np.hypot(place.position_w[0] - end[0], place.position_w[1] - end[1]))
    whole = float(np.hypot(manoeuvre.start_w[0] - end[0], manoeuvre.start_w[1] - end[1]))
    return left < min(0.3, 0.4 * whole)  # path following ends before the very end


def _possible_turn(
    heading_rad: float, table_w: FloatArray, cells: GroundCells, place: Place, footprint: Footprint
) -> float:
    """Turn towards a heading, as far as there is room for the body and rocks hardly hold the wheels."""
    wanted = wrap_angle(heading_rad - place.heading_rad)
    known, position = None if place.bold else cells, np.asarray(place.position_w)
    right, left = turn_range(table_w, known, position, place.heading_rad, footprint, place.downhill_w)
    if not place.bold:
        easy = place.turning.reach(MOST_MET)
        right, left = max(right, easy[0]), min(left, easy[1])
    return float(np.clip(wanted, right, left))
