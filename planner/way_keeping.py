"""Whether the way that is being driven is still the one to drive."""

from __future__ import annotations

import numpy as np

from planner.choice import Choice, Place, dense, turn_onto, way_cost
from planner.navigator_state import Decision, NavigatorState
from planner.obstacle_map import let_leave, passed_by, segment_clearance
from planner.row_search import EndCost
from worlds.types import FloatArray

TURNING_RAD = float(np.deg2rad(35.0))  # off its way, the rover is turning onto it
BESIDE_M, ROLLS_ON_M = 0.15, 0.7  # of its way a rover errs; and how far it looks straight ahead then
GOES_ON_M = 1.0  # of a way that is free ahead


def still_good(
    state: NavigatorState, rest: FloatArray, fresh: Decision, table: FloatArray, place: Place, choice: Choice
) -> bool:
    """Whether the rest (N, 2) of the present way is free, long enough and not much worse than the fresh one."""
    model, models = state.model, state.models
    whole = 0.0 if state.way is None else length_of(state.way.waypoints_w)
    ends_at_goal = np.hypot(*(rest[-1] - state.goal_w)) < 0.1
    if not ends_at_goal and length_of(rest) < min(model.extend_below_m, 0.5 * whole):
        return False
    free = _free_part(state, rest, table, place, choice.to_go, squeeze=choice.squeeze)
    if not len(free):
        return False
    old, new = (way_cost(way, state.memory, table, place, models, choice.to_go) for way in (free, fresh.waypoints_w))
    return old < new + model.keep_gain_m + model.keep_share * new


def goes_on(state: NavigatorState, table: FloatArray, place: Place) -> bool:
    """Whether the present way leads on although the search finds none: narrow gaps may fall between its cells."""
    if state.way is None:
        return False
    rest = rest_of(state.way.waypoints_w, np.asarray(place.position_w))
    free = _free_part(state, rest, table, place, None, squeeze=True)
    return len(free) > 0 and length_of(free) > GOES_ON_M and abs(turn_onto(rest, place)) < TURNING_RAD


def _free_part(
    state: NavigatorState, rest: FloatArray, table: FloatArray, place: Place, to_go: EndCost | None, *, squeeze: bool
) -> FloatArray:
    """The rest of a way (N, 2) as far as it is free and something leads on from there, (M, 2).

    What closes far off may open again. None of it where the rover is beside the way, or it is blocked near by.
    """
    model, drive = state.model, state.models.drive
    narrow = squeeze or (state.way is not None and state.way.narrow)
    need = drive.need_m(state.models.footprint, squeeze=narrow) - model.wobble_m
    table = passed_by(table, drive, squeeze=narrow)
    points = dense(rest, 0.25)
    away = np.hypot(*(points - place.position_w).T)
    shut = np.flatnonzero(segment_clearance(table, points) + drive.doubt_m(away[1:]) < need)
    free = points if not len(shut) else points[: shut[0] + 1]
    if to_go is not None:
        leads = np.flatnonzero(np.isfinite(to_go(free)))
        free = free[: leads[-1] + 1] if len(leads) else free[:0]
    blocked = len(free) < len(points) and (not len(free) or length_of(free) < model.blocked_m)
    return free[:0] if blocked or away[0] > model.off_way_m or _strays(state, away[0], table, place) else free


def _strays(state: NavigatorState, beside_m: float, table: FloatArray, place: Place) -> bool:
    """Whether a rover that is ``beside_m`` from its way will meet a rock as it points: wheels can be held in a bend."""
    if beside_m < BESIDE_M:
        return False
    here = np.asarray(place.position_w)
    ahead = here + ROLLS_ON_M * np.array([np.cos(place.heading_rad), np.sin(place.heading_rad)])
    half = state.models.footprint.width_m / 2.0
    return float(segment_clearance(let_leave(table, here, half), np.stack([here, ahead])).min()) < half


def length_of(way_w: FloatArray) -> float:
    """Length of a polyline (N, 2), metres."""
    return float(np.linalg.norm(np.diff(way_w, axis=0), axis=1).sum())


def rest_of(way_w: FloatArray, place: FloatArray) -> FloatArray:
    """The way from its point nearest to ``place`` on, (N, 2), N >= 2."""
    start, along = way_w[:-1], np.diff(way_w, axis=0)
    share = ((place - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = start + np.clip(share, 0.0, 1.0)[:, None] * along
    leg = int(np.argmin(np.linalg.norm(nearest - place, axis=1)))
    return np.vstack([nearest[leg], way_w[leg + 1 :]])
