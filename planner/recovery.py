"""The recovery ladder: look to the sides, back out over known ground, look behind, and in the end give up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planner.choice import Place
from planner.ground_cells import GroundCells
from planner.room import backing_room, turn_range
from planner.terrain_map import TerrainMemory
from worlds.geometry import wrap_angle
from worlds.types import FloatArray, Footprint

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
)
MOST_BACK_M = 2.0
ROOM_TO_TURN_RAD = float(np.deg2rad(70.0))
LEAST_LOOK_RAD = float(np.deg2rad(20.0))
LEAST_BACK_M = 0.25


@dataclass(frozen=True)
class Manoeuvre:
    """A look or a backing that is under way."""

    kind: Literal["look", "back_up"]
    reason: str
    start_w: tuple[float, float]
    start_s: float
    heading_rad: float = 0.0  # look: where to
    distance_m: float = 0.0  # back_up: how far


@dataclass(frozen=True)
class Ladder:
    """How far up the ladder the rover is."""

    rung: int = 0
    place_w: tuple[float, float] | None = None  # of the first rung
    heading_rad: float = 0.0  # then
    back_first: bool = False  # trouble was met: back out before anything else
    bold: bool = False  # the second time round: turns may sweep ground that was never seen

    def after_move(self, place_w: FloatArray, progress_m: float) -> Ladder:
        """The ladder from its foot once the rover has got away from where it was stuck."""
        if self.place_w is None or float(np.hypot(*(place_w - self.place_w))) < progress_m:
            return self
        return Ladder(back_first=self.back_first)


def next_manoeuvre(
    ladder: Ladder, memory: TerrainMemory, table_w: FloatArray, place: Place, footprint: Footprint, time_s: float
) -> tuple[Manoeuvre | None, Ladder]:
    """The next rung that there is room for, None at the end of the ladder, and the ladder after it."""
    if ladder.place_w is None:
        ladder = replace(ladder, place_w=place.position_w, heading_rad=place.heading_rad)
    position = np.asarray(place.position_w)
    room = backing_room(table_w, memory.cells, position, place.heading_rad, footprint, MOST_BACK_M)
    if ladder.back_first:
        ladder = replace(ladder, back_first=False)
        if room >= LEAST_BACK_M:
            return _back(0.8, room, "back out of trouble", table_w, memory.cells, place, footprint, time_s), ladder
    while ladder.rung < len(RUNGS):
        kind, amount = RUNGS[ladder.rung]
        ladder = replace(ladder, rung=ladder.rung + 1)
        if kind == "back_up" and room >= LEAST_BACK_M:
            return _back(amount, room, "back out", table_w, memory.cells, place, footprint, time_s), ladder
        if kind == "look":
            turn = _possible_turn(ladder.heading_rad + np.deg2rad(amount), table_w, memory.cells, place, footprint)
            if abs(turn) >= LEAST_LOOK_RAD:
                side = "left" if turn > 0 else "right"
                heading = wrap_angle(place.heading_rad + turn)
                return Manoeuvre("look", f"look {side}", place.position_w, time_s, heading_rad=heading), ladder
    return None, ladder


def _back(
    least_m: float,
    room_m: float,
    reason: str,
    table_w: FloatArray,
    cells: GroundCells,
    place: Place,
    footprint: Footprint,
    time_s: float,
) -> Manoeuvre:
    """Back out by ``least_m``, or farther to where the body has room to turn to either side, as far as ``room_m``."""
    position = np.asarray(place.position_w)
    back = -np.array([np.cos(place.heading_rad), np.sin(place.heading_rad)])
    distance = min(least_m, room_m)
    while distance < room_m:
        right, left = turn_range(
            table_w, None if place.bold else cells, position + distance * back, place.heading_rad, footprint
        )
        if min(-right, left) >= ROOM_TO_TURN_RAD:
            break
        distance = min(distance + 0.2, room_m)
    return Manoeuvre("back_up", reason, place.position_w, time_s, distance_m=distance)


def finished(manoeuvre: Manoeuvre, place: Place, time_s: float, *, seen: bool) -> bool:
    """Whether a manoeuvre is done: turned there and ``seen`` anew, backed so far, or tried too long."""
    if time_s - manoeuvre.start_s > 15.0:
        return True
    if manoeuvre.kind == "look":
        there = abs(wrap_angle(manoeuvre.heading_rad - place.heading_rad)) < np.deg2rad(12.0)
        return there and seen
    moved = np.hypot(place.position_w[0] - manoeuvre.start_w[0], place.position_w[1] - manoeuvre.start_w[1])
    return bool(moved > 0.6 * manoeuvre.distance_m)  # path following ends before the very end


def _possible_turn(
    heading_rad: float, table_w: FloatArray, cells: GroundCells, place: Place, footprint: Footprint
) -> float:
    """Turn towards a heading, as far as there is room for the body."""
    wanted = wrap_angle(heading_rad - place.heading_rad)
    right, left = turn_range(
        table_w, None if place.bold else cells, np.asarray(place.position_w), place.heading_rad, footprint
    )
    return float(np.clip(wanted, right, left))
