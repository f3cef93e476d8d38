"""Off a slope that wheels get down but not up: where the nose points down it, to back out would only dig them in."""

from __future__ import annotations

from functools import partial

import numpy as np

from planner.choice import Models, Place
from planner.obstacle_map import Frame2
from planner.recovery import IN_VAIN_M, STRAIGHT_ON_M, Ladder, Manoeuvre
from planner.room import turn_range
from planner.row_search import Task, search
from planner.terrain_map import TerrainMemory
from worlds.types import FloatArray

NOSE_DOWN_DEG = 15.0  # about what soft sand bears upwards (`knowledge/slopes`) ...
GENERAL_DEG = 10.0  # ... where it is the slope and not a rock under a wheel
LENGTHS_M = (3.0, 2.0, 1.2)


def way_down(
    memory: TerrainMemory, table_w: FloatArray, place: Place, models: Models, ladder: Ladder, time_s: float
) -> Manoeuvre | None:
    """A short drive down the slope that the rover stands on, among the obstacles (N, 7).

    None on ground that it could back up, where no way leads down, or where it tried so in vain.
    """
    if place.nose_down_deg < NOSE_DOWN_DEG or place.slope_deg < GENERAL_DEG:
        return None
    here = np.asarray(place.position_w)
    if ladder.tried_w is not None and float(np.hypot(*(here - ladder.tried_w))) < IN_VAIN_M:
        return None
    down_rad = float(np.arctan2(place.downhill_w[1], place.downhill_w[0]))
    room = turn_range(table_w, None, here, place.heading_rad, models.footprint, place.downhill_w)
    need_m = models.drive.need_m(models.footprint, squeeze=True)
    for length_m in LENGTHS_M:
        end_w = here + length_m * np.array([np.cos(down_rad), np.sin(down_rad)])
        task = Task(
            Frame2(place.position_w, down_rad),
            length_m,
            place.heading_rad,
            need_m,
            partial(_distances, end_w),
            room,
        )
        found = search(table_w, memory.cells, task, models.drive, models.rows)
        if found.blocked_row is None and found.candidates:
            way = found.candidates[0].waypoints_w
            leg = way[-1] - way[-2]
            way = np.vstack([way[:-1], way[-1] + STRAIGHT_ON_M * leg / np.linalg.norm(leg)])
            return Manoeuvre("drive", "down the slope", place.position_w, time_s, way_w=way, nudge_m=length_m)
    return None


def _distances(end_w: FloatArray, points_w: FloatArray) -> FloatArray:
    distances: FloatArray = np.linalg.norm(points_w - end_w, axis=1)
    return distances
