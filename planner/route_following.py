"""Driving a route: navigation is given the end of one leg after the other, and another route where one is refused.

Composition of `planner.route` above `planner.navigator`; pure, as both are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from planner import navigator
from planner.navigator import Decision, NavigatorState
from planner.route import CostMap, Place, Route, RouteModel, cost_map, plan_route
from planner.route_cost import SlopeCosts
from planner.route_ground import ElevationMap
from planner.route_marks import Landmark, Leg, LegModel, landmarks, legs
from worlds.types import BoolArray, FloatArray, Observation, PoseEstimate, RangeScan

LEAVE_M = 4.0  # of forbidden ground that a rover which stands on it may cross to get away
BLOCK_M = 1.5  # radius of the discs by which a leg that cannot be driven is blocked
CLEAR_M = 2.5  # about the rover and about the goal, that are never blocked
MOST_REPLANS = 8


@dataclass(frozen=True, eq=False)
class Following:
    """A route being driven."""

    ground: ElevationMap
    costs: SlopeCosts
    goal_w: Place
    goal_radius_m: float
    route: Route
    legs: tuple[Leg, ...]
    marks: tuple[Landmark, ...]
    model: RouteModel = RouteModel()  # noqa: RUF009 - frozen
    leg_model: LegModel = LegModel()  # noqa: RUF009 - frozen
    at: int = 0  # the leg being driven
    blocked_w: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))  # (N, 3) x, y, radius
    driven: tuple[Leg, ...] = ()  # legs that are over, of former routes too
    routes: tuple[Route, ...] = ()  # former ones
    reasons: tuple[str, ...] = ()  # why each of those was given up

    @property
    def leg(self) -> Leg:
        """The leg being driven."""
        return self.legs[self.at]

    @property
    def target(self) -> tuple[Place, float]:
        """Where navigation is to go now, and how near to it."""
        last = self.at == len(self.legs) - 1
        return (self.goal_w, self.goal_radius_m) if last else (self.leg.end_w, self.leg_model.pass_m)


def begin(
    ground: ElevationMap,
    costs: SlopeCosts,
    start_w: Place,
    goal_w: Place,
    goal_radius_m: float,
    model: RouteModel | None = None,
    leg_model: LegModel | None = None,
) -> Following:
    """The first route; `Following.route` may be a refusal, and has no legs then."""
    model, leg_model = model or RouteModel(), leg_model or LegModel()
    map_ = cost_map(ground, costs, model)
    route, marks = plan_route(map_, start_w, goal_w, model), landmarks(ground)
    cut = legs(map_, route, marks, leg_model)
    return Following(ground, costs, goal_w, goal_radius_m, route, cut, marks, model, leg_model)


def aimed(plan: NavigatorState, following: Following) -> NavigatorState:
    """The navigator with the target of the route, or with the refusal of it as its end."""
    if following.route.refusal is not None:
        return replace(plan, end=Decision("no_path", following.route.reason))
    return navigator.retarget(plan, *following.target)


def step(
    following: Following,
    plan: NavigatorState,
    observation: Observation | None,
    estimate: PoseEstimate,
    time_s: float,
    scan: RangeScan | None = None,
) -> tuple[Following, NavigatorState, Decision]:
    """One step of the navigator on the present leg; the next leg, or another route, where that one is over."""
    place = (float(estimate.pose.position_w[0]), float(estimate.pose.position_w[1]))
    if plan.end is None and following.legs:
        passed = _passed(following, place)
        if passed.at != following.at:
            following, plan = passed, aimed(plan, passed)
    plan, decision = navigator.step(plan, observation, estimate, time_s, scan)
    if decision.kind != "no_path" or not following.legs or len(following.routes) >= MOST_REPLANS:
        return following, plan, decision
    other = _passed(blocked(following, place, decision.reason), place)
    if other.route.refusal is not None:
        ended = Decision("no_path", f"{decision.reason}; and over the map: {other.route.reason}")
        return other, replace(plan, end=ended), ended
    plan, decision = navigator.step(aimed(plan, other), None, estimate, time_s)
    return other, plan, decision


def blocked(following: Following, place: Place, reason: str) -> Following:
    """Another route from ``place``, on which the rest of the present leg is not driven."""
    discs = np.vstack([following.blocked_w, _discs(following, place)])
    return replanned(replace(following, blocked_w=discs), place, reason)


def replanned(following: Following, place: Place, reason: str) -> Following:
    """Another route from ``place`` over what the map says now; the goal's surroundings are never blocked."""
    map_ = blocked_map(following)
    model = replace(following.model, leave_m=LEAVE_M)
    route = plan_route(map_, place, following.goal_w, model)
    return replace(
        following,
        route=route,
        legs=legs(map_, route, following.marks, following.leg_model),
        at=0,
        driven=following.driven + following.legs[: following.at],
        routes=(*following.routes, following.route),
        reasons=(*following.reasons, reason),
    )


def blocked_map(following: Following) -> CostMap:
    """The cost map with what cannot be driven left out."""
    field_ = following.ground.field
    ny, nx = field_.heights_m.shape
    closed: BoolArray = np.zeros((ny, nx), dtype=bool)
    x = field_.origin_m[0] + field_.resolution_m * np.arange(nx)
    y = field_.origin_m[1] + field_.resolution_m * np.arange(ny)
    for left, up, radius in following.blocked_w:
        closed |= np.hypot(x[None, :] - left, y[:, None] - up) <= radius
    return cost_map(following.ground, following.costs, following.model, closed)


def _discs(following: Following, place: Place) -> FloatArray:
    """Discs (N, 3) along the straight rest of the present leg, but not about the rover and the goal."""
    here, end = np.asarray(place), np.asarray(following.target[0])
    count = max(2, int(np.ceil(np.linalg.norm(end - here) / BLOCK_M)) + 1)
    points = here + (end - here) * np.linspace(0.0, 1.0, count)[:, None]
    apart = [np.linalg.norm(points - np.asarray(other), axis=1) for other in (place, following.goal_w)]
    points = points[(apart[0] > CLEAR_M) & (apart[1] > CLEAR_M)]
    return np.column_stack([points, np.full(len(points), BLOCK_M)])


def _passed(following: Following, place: Place) -> Following:
    """The following with the legs behind it over, of which the rover is near the end or past it."""
    at = following.at
    while at < len(following.legs) - 1 and _behind(following, at, place):
        at += 1
    return replace(following, at=at)


def _behind(following: Following, at: int, place: Place) -> bool:
    """Whether the end of a leg is reached, or the rover is as near to the end of the next leg as that one is long."""
    here, end = np.asarray(place), np.asarray(following.legs[at].end_w)
    if np.linalg.norm(here - end) < following.leg_model.pass_m:
        return True
    after = np.asarray(following.legs[at + 1].end_w)
    length = min(float(np.linalg.norm(end - after)), following.legs[at + 1].length_m)
    return bool(np.linalg.norm(here - after) < length)
