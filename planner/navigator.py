"""One decision: what is remembered, where the rover is, and what it does next. The planner's only composition."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from planner.choice import SLOPE_DEG, Choice, Models, Place, choose, dense, turn_onto, turn_price, way_cost
from planner.corridor import Corridor, SpeedModel, choose_way, corridor
from planner.first_bend import begin_with_bend
from planner.ground_cells import driven_view, sample
from planner.laser_map import LaserMap
from planner.monitor import tilt
from planner.obstacle_map import NO_OBSTACLES, Area, fence, judged, let_leave, obstacles, segment_clearance
from planner.recovery import Ladder, Manoeuvre, finished, next_manoeuvre
from planner.room import turn_range, turning
from planner.row_search import Candidate, EndCost
from planner.terrain_map import MemoryModel, TerrainMemory, empty_memory, remember, remember_scan
from planner.track import NO_TRACK, note
from worlds.geometry import euler_from_quaternion, rotation_from_quaternion, wrap_angle
from worlds.types import FloatArray, Footprint, Observation, PoseEstimate, RangeScan

LEAST_WAY_M = 0.3  # a shorter way ends where the rover stands, as path following sees it
TURN_ON_SPOT_RAD = float(np.deg2rad(55.0))  # path following does such turns on the spot
TURNING_RAD = float(np.deg2rad(35.0))  # off its way, the rover is turning onto it ...
TURNED_RAD, STANDS_M = float(np.deg2rad(8.0)), 0.1  # ... until so little is left; lately it has moved so far then
BESIDE_M, ROLLS_ON_M = 0.15, 0.7  # of its way a rover errs; and how far it looks straight ahead then
AROUND_M = 3.5  # of what the scanner saw, for manoeuvres
GOES_ON_M = 1.0  # of a way that is free ahead
STANDING_M = 0.4  # of ground around the rover that is known for it stands there
MOST_AVOIDED = 3  # places of trouble
MOST_DUG = 8  # places where turns were in vain
SWEPT_M = 1.5  # of a way that begins with a bend, on ground that was seen
LATELY_S = 1.5  # of looks, over which ...
GETS_ON_M_S = 0.17  # ... a rover so quick was not stopped by the place
UPRIGHT_RAD = float(np.deg2rad(25.0))
START_CLEAR_M = 1.0  # the rover is set down on ground where it has room to turn
Kind = Literal["drive", "look", "back_up", "arrived", "no_path", "lost"]


@dataclass(frozen=True)
class NavigatorModel:
    """How long a way is kept and when the navigator gives up."""

    memory: MemoryModel = MemoryModel()  # noqa: RUF009 - frozen
    keep_gain_m: float = 1.0  # a new way must be better by this
    keep_share: float = 0.06  # and by this share
    extend_below_m: float = 3.8  # a way that ends sooner, and not at the goal, is renewed
    off_way_m: float = 0.45
    blocked_m: float = 1.2  # a way that is blocked farther off is as good as what is free of it
    wobble_m: float = 0.05  # a rock that moves so much into a way does not break it
    arrival_share: tuple[float, float] = (0.8, 0.9)  # of the goal's radius, at least and at most ...
    arrival_sigmas: float = 2.0  # ... within which the rover is there although it errs by so many sigmas
    patience_m: float = 40.0  # driven without getting nearer, beside twice the first distance
    speed: SpeedModel = SpeedModel()  # noqa: RUF009 - frozen; where a laser scanner leads
    progress_m: float = 1.5  # away from the last recovery: the ladder starts anew


@dataclass(frozen=True, eq=False)
class Decision:
    """What to do until the next decision."""

    kind: Kind
    reason: str
    waypoints_w: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))  # (N, 2) from the rover on
    changed: bool = False  # the waypoints are not those of the decision before
    narrow: bool = False  # drive: with the smaller margin
    traversability: float = 0.0
    candidates: tuple[Candidate, ...] = ()
    scores: tuple[float, ...] = ()  # traversability of each candidate
    heading_rad: float = 0.0  # look: turn to it
    speed_m_s: float | None = None  # drive: at most so fast now; None: as the risk allows

    @property
    def risk(self) -> float:
        """0..1 for the speed of driving."""
        return float(np.clip(1.0 - self.traversability, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class NavigatorState:
    """All that the navigator knows and intends."""

    models: Models
    model: NavigatorModel
    goal_w: tuple[float, float]
    goal_radius_m: float
    memory: TerrainMemory
    avoid_w: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))  # (M, 3) x, y, radius of trouble met
    dug_w: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))  # (D, 2) where turns on the spot were in vain
    track_w: FloatArray = field(default_factory=lambda: NO_TRACK)  # (N, 3) poses driven, see `planner.track`
    fence: FloatArray = field(default_factory=lambda: NO_OBSTACLES)  # (K, 7) round the ground that may be driven on
    forbidden: FloatArray = field(default_factory=lambda: NO_OBSTACLES)  # (L, 7) of the map, see `retarget`
    way: Decision | None = None  # the way being driven
    detour: bool = False
    manoeuvre: Manoeuvre | None = None
    ladder: Ladder = Ladder()  # noqa: RUF009 - frozen
    end: Decision | None = None
    slope_rad: float = 0.0  # smoothed
    downhill_w: tuple[float, float] = (0.0, 0.0)  # rise over run, smoothed
    travelled_m: float = 0.0
    place_w: tuple[float, float] | None = None
    lately: tuple[tuple[float, float, float], ...] = ()  # time and place of the last looks
    best_m: float = np.inf  # nearest to the goal so far
    best_at_m: float = 0.0  # travelled then
    first_m: float = 0.0  # distance to the goal at the start


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
    place = _place(state, estimate)
    distance = float(np.hypot(place.goal_w[0] - place.position_w[0], place.goal_w[1] - place.position_w[1]))
    if distance < _arrival_m(state, estimate):
        return _ended(state, Decision("arrived", f"goal {distance:.2f} m away"))
    if state.travelled_m - state.best_at_m > state.model.patience_m + 2.0 * state.first_m:
        return _ended(state, Decision("no_path", f"{state.travelled_m - state.best_at_m:.0f} m without getting nearer"))
    seen = observation is not None or scan is not None
    if state.manoeuvre is not None and not finished(state.manoeuvre, place, time_s, seen=seen):
        return state, _as_decision(state.manoeuvre)
    return _decide(replace(state, manoeuvre=None), place, time_s)


def _arrival_m(state: NavigatorState, estimate: PoseEstimate) -> float:
    """How near to the goal the rover must believe to be, metres: the nearer the less sure it is of its place."""
    sure = state.goal_radius_m - state.model.arrival_sigmas * estimate.position_sd_m
    least, most = (share * state.goal_radius_m for share in state.model.arrival_share)
    return min(most, max(least, sure))


def _decide(state: NavigatorState, place: Place, time_s: float) -> tuple[NavigatorState, Decision]:
    """A way if there is one, else a rung of the ladder."""
    table = _table(state)
    if state.ladder.back_first:
        return _recover(state, None, table, place, time_s)
    if state.memory.laser is not None:
        return _by_laser(state, state.memory.laser, table, place, time_s)
    choice = choose(state.memory, table, place, state.models, detour=state.detour)
    if choice.way is not None and choice.way.length_m > LEAST_WAY_M:
        return _drive(state, choice, table, place)
    if state.way is not None and _goes_on(state, table, place):
        return state, replace(state.way, changed=False)
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
        old = _rest(state.way.waypoints_w, np.asarray(place.position_w))
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
    if not near_goal and _length(rest) < model.extend_below_m:
        return False
    most = model.speed.most_m_s
    turn_s_rad = model.speed.turn_s_rad * (1.0 + place.speed_m_s)  # at speed it must brake first
    old, new = (
        found.way_cost(way, goal) + most * turn_s_rad * abs(turn_onto(way, place)) for way in (rest, fresh.waypoints_w)
    )
    return old < new * (1.0 + model.speed.jump_share) + model.speed.jump_s * most


def note_trouble(state: NavigatorState, estimate: PoseEstimate, radius_m: float = 0.35) -> NavigatorState:
    """The state after the rover met what it had not seen (stuck, slipping): it backs out.

    If it was driving, and not turning onto its way, the place ahead is avoided from now on; only the last few such
    places are, as each may have been soft ground or a bend, and together they would wall the rover in. Where it was
    turning on the spot turns are dear from now on: its wheels stand in the pits that they dug. A rover that
    was getting on, on a slope and upright, goes on: up steep sand wheels slip by 40 % all the way.
    """
    if _gets_on(state, estimate):
        return replace(state, way=None)
    avoid, dug, here = state.avoid_w, state.dug_w, estimate.pose.position_w[:2]
    if _turning(state, estimate):
        dug = np.vstack([dug, here])[-MOST_DUG:]
    elif state.manoeuvre is None:
        forward = rotation_from_quaternion(estimate.pose.quaternion_w)[:2, 0]
        ahead = here + (state.models.footprint.length_m / 2 + radius_m) * forward
        avoid = np.vstack([avoid, [*ahead, radius_m]])[-MOST_AVOIDED:]
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
    return since_s > 0.5 * LATELY_S and moved_m > GETS_ON_M_S * since_s


def _turning(state: NavigatorState, estimate: PoseEstimate) -> bool:
    """Whether the rover turns on the spot: it points far off where it is to go, or somewhat and stands."""
    if state.manoeuvre is not None and state.manoeuvre.kind == "look":
        return True
    way_w = (
        state.manoeuvre.way_w if state.manoeuvre is not None else None if state.way is None else state.way.waypoints_w
    )
    if way_w is None:
        return False
    off = turn_onto(_rest(way_w, estimate.pose.position_w[:2]), _place(state, estimate))
    if state.manoeuvre is not None and state.manoeuvre.kind == "back_up":
        off = wrap_angle(off + np.pi)
    stands = bool(state.lately) and float(np.hypot(*(estimate.pose.position_w[:2] - state.lately[0][1:]))) < STANDS_M
    return abs(off) > (TURNED_RAD if stands else TURNING_RAD)


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


def _place(state: NavigatorState, estimate: PoseEstimate) -> Place:
    x, y = (float(value) for value in estimate.pose.position_w[:2])
    yaw = euler_from_quaternion(estimate.pose.quaternion_w)[2]
    slope_deg, speed = float(np.rad2deg(state.slope_rad)), float(np.linalg.norm(estimate.velocity_w[:2]))
    bold, downhill = state.ladder.bold, state.downhill_w
    held = turning(state.memory.rocks, estimate.pose.position_w[:2], yaw, state.models.footprint, state.dug_w)
    return Place((x, y), yaw, state.goal_w, state.goal_radius_m, slope_deg, bold, speed, downhill, held)


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
    rest = None if state.way is None else _rest(state.way.waypoints_w, np.asarray(place.position_w))
    if state.way is not None and rest is not None and _still_good(state, rest, fresh, table, place, choice):
        kept = replace(state.way, changed=False, candidates=choice.candidates, scores=choice.scores)
        return state, kept
    return replace(state, way=fresh), fresh


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
    around = let_leave(table, np.asarray(place.position_w), need)

    def free(way_w: FloatArray) -> bool:
        points = dense(way_w, 0.2)
        beginning = points[np.hypot(*(points - place.position_w).T) < SWEPT_M]
        return segment_clearance(around, way_w).min() >= need and bool(sample(cells, beginning)[0].all())

    def cost(way_w: FloatArray) -> float:
        return way_cost(way_w, state.memory, table, place, models, choice.to_go)

    return replace(fresh, waypoints_w=begin_with_bend(fresh.waypoints_w, place, free, cost))


def _still_good(
    state: NavigatorState, rest: FloatArray, fresh: Decision, table: FloatArray, place: Place, choice: Choice
) -> bool:
    """Whether the rest (N, 2) of the present way is free, long enough and not much worse than the fresh one."""
    model, models = state.model, state.models
    whole = 0.0 if state.way is None else _length(state.way.waypoints_w)
    ends_at_goal = np.hypot(*(rest[-1] - state.goal_w)) < 0.1
    if not ends_at_goal and _length(rest) < min(model.extend_below_m, 0.5 * whole):
        return False
    free = _free_part(state, rest, table, place, choice.to_go, squeeze=choice.squeeze)
    if not len(free):
        return False
    old, new = (way_cost(way, state.memory, table, place, models, choice.to_go) for way in (free, fresh.waypoints_w))
    return old < new + model.keep_gain_m + model.keep_share * new


def _goes_on(state: NavigatorState, table: FloatArray, place: Place) -> bool:
    """Whether the present way leads on although the search finds none: narrow gaps may fall between its cells."""
    if state.way is None:
        return False
    rest = _rest(state.way.waypoints_w, np.asarray(place.position_w))
    free = _free_part(state, rest, table, place, None, squeeze=True)
    return len(free) > 0 and _length(free) > GOES_ON_M and abs(turn_onto(rest, place)) < TURNING_RAD


def _free_part(
    state: NavigatorState, rest: FloatArray, table: FloatArray, place: Place, to_go: EndCost | None, *, squeeze: bool
) -> FloatArray:
    """The rest of a way (N, 2) as far as it is free and something leads on from there, (M, 2).

    What closes far off may open again. None of it where the rover is beside the way, or it is blocked near by.
    """
    model, drive = state.model, state.models.drive
    narrow = squeeze or (state.way is not None and state.way.narrow)
    need = drive.need_m(state.models.footprint, squeeze=narrow) - model.wobble_m
    points = dense(rest, 0.25)
    away = np.hypot(*(points - place.position_w).T)
    shut = np.flatnonzero(segment_clearance(table, points) + drive.doubt_m(away[1:]) < need)
    free = points if not len(shut) else points[: shut[0] + 1]
    if to_go is not None:
        leads = np.flatnonzero(np.isfinite(to_go(free)))
        free = free[: leads[-1] + 1] if len(leads) else free[:0]
    blocked = len(free) < len(points) and (not len(free) or _length(free) < model.blocked_m)
    return free[:0] if blocked or away[0] > model.off_way_m or _strays(state, away[0], table, place) else free


def _strays(state: NavigatorState, beside_m: float, table: FloatArray, place: Place) -> bool:
    """Whether a rover that is ``beside_m`` from its way will meet a rock as it points: wheels can be held in a bend."""
    if beside_m < BESIDE_M:
        return False
    here = np.asarray(place.position_w)
    ahead = here + ROLLS_ON_M * np.array([np.cos(place.heading_rad), np.sin(place.heading_rad)])
    half = state.models.footprint.width_m / 2.0
    return float(segment_clearance(let_leave(table, here, half), np.stack([here, ahead])).min()) < half


def _length(way_w: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(way_w, axis=0), axis=1).sum())


def _rest(way_w: FloatArray, place: FloatArray) -> FloatArray:
    """The way from its point nearest to ``place`` on, (N, 2), N >= 2."""
    start, along = way_w[:-1], np.diff(way_w, axis=0)
    share = ((place - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = start + np.clip(share, 0.0, 1.0)[:, None] * along
    leg = int(np.argmin(np.linalg.norm(nearest - place, axis=1)))
    return np.vstack([nearest[leg], way_w[leg + 1 :]])


def _recover(
    state: NavigatorState, choice: Choice | None, table: FloatArray, place: Place, time_s: float
) -> tuple[NavigatorState, Decision]:
    """The next rung of the ladder: look to a side, back out, and at its end give up."""
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
    return Decision(manoeuvre.kind, manoeuvre.reason, manoeuvre.way_w, heading_rad=manoeuvre.heading_rad)


def _ended(state: NavigatorState, decision: Decision) -> tuple[NavigatorState, Decision]:
    return replace(state, end=decision, way=None), decision
