"""What a navigator learns where the rover was stopped: places to avoid, and pits to keep from turning in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner.choice import SLOPE_DEG, turn_onto
from planner.monitor import tilt
from planner.navigator_state import NavigatorState, place_of
from planner.recovery import Manoeuvre
from planner.room import DUG_M
from planner.way_keeping import TURNING_RAD, rest_of
from worlds.geometry import rotation_from_quaternion, wrap_angle
from worlds.types import PoseEstimate

TURNED_RAD, STANDS_M = float(np.deg2rad(8.0)), 0.1  # a turn goes on until so little is left; the rover moves so far
MOST_AVOIDED = 3  # places of trouble
MOST_DUG = 8  # places where turns were in vain
LATELY_S = 1.5  # of looks, over which ...
GETS_ON_M_S = 0.115, 0.17  # ... a rover so quick was not stopped by the place; by a bank
UPRIGHT_RAD = float(np.deg2rad(25.0))
BANK_RAD = float(np.deg2rad(19.0))  # nose up on soft ground, at which wheels hardly get on
BANK_M = 0.8  # to either side of it, as far as banks mostly reach


def note_trouble(state: NavigatorState, estimate: PoseEstimate, radius_m: float = 0.35) -> NavigatorState:
    """The state after the rover met what it had not seen (stuck, slipping): it backs out.

    If it was driving, and not turning onto its way, the place ahead is avoided from now on; only the last few such
    places are, as each may have been soft ground or a bend, and together they would wall the rover in. Where it was
    turning on the spot turns are dear from now on: its wheels stand in the pits that they dug; where that happened
    before, the place is avoided too, as ways that lead to it turn there again. A rover that was getting on, on a slope
    and upright, goes on: up steep sand wheels slip by 40 % all the way.
    """
    if _gets_on(state, estimate):
        return replace(state, way=None)
    avoid, dug, here = state.avoid_w, state.dug_w, estimate.pose.position_w[:2]
    if _turning(state, estimate):
        if (np.hypot(*(dug - here).T) < DUG_M).any():
            avoid = np.vstack([avoid, [*here, radius_m]])[-MOST_AVOIDED:]
        dug = np.vstack([dug, here])[-MOST_DUG:]
    elif state.manoeuvre is None:
        forward = rotation_from_quaternion(estimate.pose.quaternion_w)[:2, 0]
        ahead = here + (state.models.footprint.length_m / 2 + radius_m) * forward
        avoid = np.vstack([avoid, [*ahead, BANK_M if _on_bank(estimate) else radius_m]])[-MOST_AVOIDED:]
    return replace(
        state, avoid_w=avoid, dug_w=dug, way=None, ladder=replace(state.ladder, back_first=True), manoeuvre=None
    )


def _gets_on(state: NavigatorState, estimate: PoseEstimate) -> bool:
    """Whether the rover was driving a way on a slope, moved on to the end, and does not lean much more."""
    if state.way is None or state.manoeuvre is not None or tilt(estimate) > UPRIGHT_RAD or not state.lately:
        return False
    if state.slope_rad < np.deg2rad(SLOPE_DEG):
        return False
    then_s, *before = state.lately[0]
    moved_m, since_s = float(np.hypot(*(estimate.pose.position_w[:2] - before))), estimate.time_s - then_s
    return since_s > 0.5 * LATELY_S and moved_m > GETS_ON_M_S[_on_bank(estimate)] * since_s


def _turning(state: NavigatorState, estimate: PoseEstimate) -> bool:
    """Whether the rover turns on the spot: it points far off where it is to go, or somewhat and stands."""
    doing, here = state.manoeuvre or state.way, estimate.pose.position_w[:2]
    if doing is None or doing.kind == "look":
        return doing is not None
    way_w = doing.way_w if isinstance(doing, Manoeuvre) else doing.waypoints_w
    off = turn_onto(rest_of(way_w, here), place_of(state, estimate))
    if doing.kind == "back_up":
        off = wrap_angle(off + np.pi)
    # On a bank wheels stand for its steepness, however the rover slid round meanwhile.
    held = bool(state.lately) and float(np.hypot(*(here - state.lately[0][1:]))) < STANDS_M
    stands = held and not _on_bank(estimate)
    return abs(off) > (TURNED_RAD if stands else TURNING_RAD)


def _on_bank(estimate: PoseEstimate) -> bool:
    """Whether the rover stands nose up on ground that is too steep for it."""
    return bool(rotation_from_quaternion(estimate.pose.quaternion_w)[2, 0] > np.sin(BANK_RAD))
