"""One decision: what is remembered, where the rover is, and what it does next. The planner's only composition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner.choice import Choice, Models, Place, choose, dense, turn_onto, turn_price, way_cost
from planner.corridor import Corridor, choose_way, corridor
from planner.downhill import way_down
from planner.first_bend import begin_with_bend
from planner.ground_cells import driven_view, sample
from planner.guard import runs_onto
from planner.laser_map import LaserMap
from planner.monitor import tilt
from planner.navigator_state import Decision, NavigatorModel, NavigatorState, place_of
from planner.obstacle_map import NO_OBSTACLES, Area, fence, judged, let_leave, obstacles, passed_by, segment_clearance
from planner.recovery import NUDGE_M_S, Ladder, Manoeuvre, finished, next_manoeuvre, step_back, turn_away
from planner.room import turn_range
from planner.row_search import Candidate
from planner.terrain_map import empty_memory, remember, remember_scan
from planner.track import note
from planner.trouble import LATELY_S
from planner.way_keeping import TURNING_RAD, goes_on, length_of, rest_of, still_good
from worlds.geometry import euler_from_quaternion, rotation_from_quaternion, wrap_angle
from worlds.types import FloatArray, Footprint, Observation, PoseEstimate, RangeScan

WARNED_AGAIN_M, MOST_WARNED = 0.2, 2  # so near it is the same place; what is done there
LEAST_WAY_M = 0.3  # a shorter way ends where the rover stands, as path following sees it
TURN_ON_SPOT_RAD = float(np.deg2rad(55.0))  # path following does such turns on the spot
AROUND_M = 3.5  # of what the scanner saw, for manoeuvres
STANDING_M = 0.4  # of ground around the rover that is known for it stands there
SWEPT_M = 1.5  # of a way that begins with a bend, on ground that was seen
START_CLEAR_M = 1.0  # the rover is set down on ground where it has room to turn


def begin(
    goal_w: tuple[float, float],
    goal_radius_m: float,
    footprint: Footprint,
    start_w: tuple[float, float],
    *,
    models: Models | None = None,
    model: NavigatorModel | None = None,
    area: Area | None = None,
) -> NavigatorState:
    """State of a navigator that has seen nothing; ``area`` is where the mission allows it to drive, None anywhere."""
    start = np.asarray(start_w, dtype=float)
    memory = empty_memory(start)
    memory = remember(memory, None, start, standing=driven_view(np.array([*start, 0.0]), START_CLEAR_M, 0.0))
    return NavigatorState(
        models or Models(footprint),
        model or NavigatorModel(),
        (float(goal_w[0]), float(goal_w[1])),
        goal_radius_m,
        memory,
        fence=NO_OBSTACLES if area is None else fence(area),
        first_m=float(np.hypot(goal_w[0] - start_w[0], goal_w[1] - start_w[1])),
    )


def retarget(
    state: NavigatorState, goal_w: tuple[float, float], goal_radius_m: float, forbidden: FloatArray = NO_OBSTACLES
) -> NavigatorState:
    """The state with another goal: what it knows stays, what it intended and gave up is forgotten.

    ``forbidden`` (L, 7): obstacles on the way there that are none to the eye, as slopes of a map.
    """
    first_m = state.first_m if state.place_w is None else float(np.hypot(*np.subtract(goal_w, state.place_w)))
    return replace(
        state,
        goal_w=(float(goal_w[0]), float(goal_w[1])),
        goal_radius_m=goal_radius_m,
        forbidden=forbidden,
        way=None,
        detour=False,
        manoeuvre=None,
        ladder=Ladder(),
        end=None,
        best_m=np.inf,
        best_at_m=state.travelled_m,
        first_m=first_m,
    )


def step(
    state: NavigatorState,
    observation: Observation | None,
    estimate: PoseEstimate,
    time_s: float,
    scan: RangeScan | None = None,
) -> tuple[NavigatorState, Decision]:
    """Takes in what was seen and decides; once `arrived` or `no_path`, always the same."""
    state = _take_in(state, observation, scan, estimate)
    if state.end is not None:
        return state, state.end
    place = place_of(state, estimate)
    distance = float(np.hypot(place.goal_w[0] - place.position_w[0], place.goal_w[1] - place.position_w[1]))
    if distance < _arrival_m(state, estimate):
        return _ended(state, Decision("arrived", f"goal {distance:.2f} m away"))
    if state.travelled_m - state.best_at_m > state.model.patience_m + 2.0 * state.first_m:
        return _ended(state, Decision("no_path", f"{state.travelled_m - state.best_at_m:.0f} m without getting nearer"))
    seen = observation is not None or scan is not None
    if state.manoeuvre is not None and not (
        finished(state.manoeuvre, place, time_s, seen=seen) or _backs_onto(state, state.manoeuvre, place)
    ):
        return state, _as_decision(state.manoeuvre)
    return _decide(replace(state, manoeuvre=None), place, time_s)


def _backs_onto(state: NavigatorState, manoeuvre: Manoeuvre, place: Place) -> bool:
    """Whether a rover that backs out, as it points, would run onto a rock: beside its track one may lie anywhere."""
    here = np.asarray(place.position_w)
    if manoeuvre.kind != "back_up":
        return False
    if abs(wrap_angle(turn_onto(rest_of(manoeuvre.way_w, here), place) + np.pi)) > TURNING_RAD:
        return False  # it turns on the spot first
    hard = passed_by(_table(state), state.models.drive, squeeze=True)
    rear = wrap_angle(place.heading_rad + np.pi)
    return runs_onto(hard[hard[:, 6] > 0.5], here, rear, state.models.footprint)


def _arrival_m(state: NavigatorState, estimate: PoseEstimate) -> float:
    """How near to the goal the rover must believe to be, metres: the nearer the less sure it is of its place."""
    sure = state.goal_radius_m - state.model.arrival_sigmas * estimate.position_sd_m
    least, most = (share * state.goal_radius_m for share in state.model.arrival_share)
    return min(most, max(least, sure))


def _decide(state: NavigatorState, place: Place, time_s: float) -> tuple[NavigatorState, Decision]:
    """A way if there is one, else a rung of the ladder."""
    table = _table(state)
    if state.ladder.back_first:
        freed, decision = _recover(state, None, table, place, time_s)
        if freed.end is None:
            return freed, decision
        state = replace(state, ladder=freed.ladder)  # nothing is left that frees it but the way that there may be
    if state.memory.laser is not None:
        return _by_laser(state, state.memory.laser, table, place, time_s)
    choice = choose(state.memory, table, place, state.models, detour=state.detour)
    if choice.way is not None and choice.way.length_m > LEAST_WAY_M:
        return _guarded(*_drive(state, choice, table, place), table, place, time_s)
    if state.way is not None and goes_on(state, table, place):
        return _guarded(state, replace(state.way, changed=False), table, place, time_s)
    return _recover(state, choice, table, place, time_s)


def _by_laser(
    state: NavigatorState, laser: LaserMap, table: FloatArray, place: Place, time_s: float
) -> tuple[NavigatorState, Decision]:
    """The quickest way through what the scanner and the other eyes have seen, at the speed that it allows now."""
    models, speed = state.models, state.model.speed
    found = corridor(laser, table, place, models.footprint, models.drive, speed)
    choice = choose_way(found, place)
    if choice.way is None:
        around = laser.obstacles(np.asarray(place.position_w), AROUND_M, models.drive.sd_share)
        return _recover(state, choice, np.vstack([table, around]), place, time_s)
    fresh = _fresh(choice)
    way, rest = fresh, choice.way.waypoints_w
    if state.way is not None:
        old = rest_of(state.way.waypoints_w, np.asarray(place.position_w))
        if _as_quick(state, found, old, choice.way, place):
            way, rest = replace(state.way, changed=False), old
    turn = turn_onto(rest, place)
    if abs(turn) > TURN_ON_SPOT_RAD and state.ladder.place_w is None:  # once a place: the second time it must do
        around = np.vstack([table, laser.obstacles(np.asarray(place.position_w), AROUND_M, models.drive.sd_share)])
        position, heading = np.asarray(place.position_w), place.heading_rad
        right, left = turn_range(around, None, position, heading, models.footprint, place.downhill_w)
        if not right <= turn <= left:
            backing = replace(state, ladder=replace(state.ladder, back_first=True))
            return _recover(backing, choice, around, place, time_s)
    decision = replace(way, speed_m_s=min(found.speed_m_s(rest), found.guarded_m_s(place)))
    return replace(state, way=decision, detour=False), decision


def _as_quick(state: NavigatorState, found: Corridor, rest: FloatArray, fresh: Candidate, place: Place) -> bool:
    """Whether the rest (N, 2) of the present way is free, long enough and hardly slower than the fresh one."""
    model, goal = state.model, np.asarray(state.goal_w)
    if np.hypot(*(rest[0] - fresh.waypoints_w[0])) > model.off_way_m:
        return False
    near_goal = np.hypot(*(rest[-1] - goal)) < state.goal_radius_m
    if not near_goal and length_of(rest) < model.extend_below_m:
        return False
    most = model.speed.most_m_s
    turn_s_rad = model.speed.turn_s_rad * (1.0 + place.speed_m_s)  # at speed it must brake first
    old, new = (
        found.way_cost(way, goal) + most * turn_s_rad * abs(turn_onto(way, place)) for way in (rest, fresh.waypoints_w)
    )
    return old < new * (1.0 + model.speed.jump_share) + model.speed.jump_s * most


def _take_in(
    state: NavigatorState, observation: Observation | None, scan: RangeScan | None, estimate: PoseEstimate
) -> NavigatorState:
    """Memory, odometer, slope and ladder after a look and a move."""
    place = estimate.pose.position_w[:2]
    wheels = estimate.pose.position_w - np.array([0.0, 0.0, state.models.footprint.wheel_radius_m])
    standing = driven_view(wheels, STANDING_M, estimate.time_s)
    memory = remember(state.memory, observation, place, state.model.memory, standing=standing)
    memory = replace(memory, rocks=judged(memory.rocks, state.models.drive, state.models.footprint.climb_height_m))
    if scan is not None:
        memory = remember_scan(memory, scan, estimate)
    moved = 0.0 if state.place_w is None else float(np.hypot(*(place - state.place_w)))
    travelled = state.travelled_m + moved
    distance = float(np.hypot(*(place - state.goal_w)))
    up = rotation_from_quaternion(estimate.pose.quaternion_w)[:, 2]
    share = 1.0 - float(np.exp(-moved / 1.0))
    downhill = np.asarray(state.downhill_w) + share * (up[:2] / max(up[2], 0.5) - state.downhill_w)
    better = distance < state.best_m - 0.25
    yaw = euler_from_quaternion(estimate.pose.quaternion_w)[2]
    return replace(
        state,
        memory=memory,
        track_w=note(state.track_w, (float(place[0]), float(place[1]), yaw)),
        travelled_m=travelled,
        place_w=(float(place[0]), float(place[1])),
        lately=(*(look for look in state.lately if look[0] > estimate.time_s - LATELY_S), (estimate.time_s, *place)),
        slope_rad=state.slope_rad + share * (tilt(estimate) - state.slope_rad),
        downhill_w=(float(downhill[0]), float(downhill[1])),
        best_m=distance if better else state.best_m,
        best_at_m=travelled if better else state.best_at_m,
        # Backing out is part of the ladder: only driving on gets the rover away from it.
        ladder=state.ladder if state.way is None else state.ladder.after_move(place, state.model.progress_m),
    )


def _table(state: NavigatorState) -> FloatArray:
    """Obstacles (N, 7) in the world: remembered rocks, places of trouble, the area's limits, forbidden ground."""
    models = state.models
    here = None if state.place_w is None else np.asarray(state.place_w)
    body = models.footprint
    table = obstacles(
        state.memory.rocks, models.drive, body.climb_height_m, wheel_width_m=body.wheel_width_m, place_w=here
    )
    xy, radius = state.avoid_w[:, :2], state.avoid_w[:, 2:]
    trouble = np.hstack([xy, xy, radius, np.ones_like(radius), np.ones_like(radius)])
    return np.vstack([table, trouble, state.fence, state.forbidden])


def _drive(state: NavigatorState, choice: Choice, table: FloatArray, place: Place) -> tuple[NavigatorState, Decision]:
    """Keeps the present way if it is still good, else takes the new one."""
    fresh = _bent(state, _fresh(choice), table, place, choice)
    state = replace(state, detour=choice.detour)
    rest = None if state.way is None else rest_of(state.way.waypoints_w, np.asarray(place.position_w))
    if state.way is not None and rest is not None and still_good(state, rest, fresh, table, place, choice):
        kept = replace(state.way, changed=False, candidates=choice.candidates, scores=choice.scores)
        return state, kept
    return replace(state, way=fresh), fresh


def _guarded(
    state: NavigatorState, way: Decision, table: FloatArray, place: Place, time_s: float
) -> tuple[NavigatorState, Decision]:
    """The way, or first a turn, else a straight step back, where the rover as it points would run onto a rock.

    Each once at a place: what was in vain is not done again.
    """
    models, here = state.models, np.asarray(place.position_w)
    hard = passed_by(table, models.drive, squeeze=way.narrow)
    hard = hard[hard[:, 6] > 0.5]
    warned = runs_onto(hard, here, place.heading_rad, models.footprint)
    turn = turn_onto(rest_of(way.waypoints_w, here), place)
    if not warned or abs(turn) > TURNING_RAD:  # then it turns on the spot anyway
        return state, way
    tried = state.warned if np.hypot(*np.subtract(state.warned[:2], here)) < WARNED_AGAIN_M else (*place.position_w, 0)
    state = replace(state, warned=(*tried[:2], tried[2] + 1))
    manoeuvre = None
    if tried[2] == 0:
        manoeuvre = turn_away(hard, table, state.memory, place, models.footprint, turn, time_s)
    if tried[2] < MOST_WARNED and manoeuvre is None:
        manoeuvre = step_back(table, place, models.footprint, time_s)
    if manoeuvre is None:
        return state, way
    return replace(state, way=None, manoeuvre=manoeuvre), _as_decision(manoeuvre)


def _fresh(choice: Choice) -> Decision:
    assert choice.way is not None
    return Decision(
        "drive",
        choice.reason,
        choice.way.waypoints_w,
        changed=True,
        narrow=choice.squeeze,
        traversability=choice.traversability,
        candidates=choice.candidates,
        scores=choice.scores,
    )


def _bent(state: NavigatorState, fresh: Decision, table: FloatArray, place: Place, choice: Choice) -> Decision:
    """The same way, begun by a bend where turns on the spot are dear, if there is room and it costs less."""
    turn = turn_onto(fresh.waypoints_w, place)
    if abs(turn) < TURNING_RAD or turn_price(place, turn) <= abs(turn):
        return fresh
    models, cells = state.models, state.memory.cells
    need = models.drive.need_m(models.footprint, squeeze=choice.squeeze)
    passed = passed_by(table, models.drive, squeeze=choice.squeeze)
    around = let_leave(passed, np.asarray(place.position_w), need)

    def free(way_w: FloatArray) -> bool:
        points = dense(way_w, 0.2)
        beginning = points[np.hypot(*(points - place.position_w).T) < SWEPT_M]
        return segment_clearance(around, way_w).min() >= need and bool(sample(cells, beginning)[0].all())

    def cost(way_w: FloatArray) -> float:
        return way_cost(way_w, state.memory, table, place, models, choice.to_go)

    return replace(fresh, waypoints_w=begin_with_bend(fresh.waypoints_w, place, free, cost))


def _recover(
    state: NavigatorState, choice: Choice | None, table: FloatArray, place: Place, time_s: float
) -> tuple[NavigatorState, Decision]:
    """Down a slope that it could not back up; else the next rung of the ladder, and at its end give up."""
    rocks = _table(replace(state, forbidden=NO_OBSTACLES, avoid_w=state.avoid_w[:0]))  # it stands on what is too steep
    down = way_down(state.memory, rocks, place, state.models, state.ladder, time_s)
    if down is not None:
        ladder = replace(state.ladder, back_first=False, tried_w=place.position_w)
        return replace(state, way=None, ladder=ladder, detour=True, manoeuvre=down), _as_decision(down)
    manoeuvre, ladder = next_manoeuvre(
        state.ladder, state.memory, table, state.track_w, place, state.models.footprint, time_s
    )
    state = replace(state, way=None, ladder=ladder, detour=True, manoeuvre=manoeuvre)
    if manoeuvre is None and choice is not None and not choice.enclosed and not ladder.bold:
        state = replace(state, ladder=replace(ladder, rung=0, bold=True))
        return _decide(state, replace(place, bold=True), time_s)
    if manoeuvre is None:
        enclosed = choice is not None and choice.enclosed
        why = "rocks enclose the goal or the rover" if enclosed else "no free row in any direction"
        return _ended(state, Decision("no_path", f"{why}; looked around and backed out in vain"))
    reason = manoeuvre.reason if choice is None else f"{choice.reason}: {manoeuvre.reason}"
    return state, _as_decision(replace(manoeuvre, reason=reason))


def _as_decision(manoeuvre: Manoeuvre) -> Decision:
    speed = NUDGE_M_S if manoeuvre.nudge_m > 0.0 else None
    return Decision(
        manoeuvre.kind, manoeuvre.reason, manoeuvre.way_w, heading_rad=manoeuvre.heading_rad, speed_m_s=speed
    )


def _ended(state: NavigatorState, decision: Decision) -> tuple[NavigatorState, Decision]:
    return replace(state, end=decision, way=None), decision
