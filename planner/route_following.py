"""Driving a route: navigation is given the end of one leg after the other, and another route where one is refused.

Composition of `planner.route` above `planner.navigator`; pure, as both are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import ndimage

from planner import navigator
from planner.navigator_state import Decision, NavigatorState
from planner.risk_slopes import priced
from planner.route import CostMap, Place, Refusal, Route, RouteModel, cost_map, plan_route, way_cost
from planner.route_cost import SlopeCosts
from planner.route_ground import ElevationMap
from planner.route_limits import forbidden
from planner.route_marks import Landmark, Leg, LegModel, landmarks, legs
from planner.route_risk import RiskModel, RouteRisk, in_words, route_risk
from planner.terrain_store import TerrainStore, fused, with_cells
from worlds.types import BoolArray, FloatArray, HeightField, Observation, PoseEstimate, RangeScan

LEAVE_M = 4.0  # of forbidden ground that a rover which stands on it may cross to get away
BLOCK_M = 1.5  # radius of the discs by which a leg that cannot be driven is blocked
CLEAR_M = 2.5  # about the rover and about the goal, that are never blocked
MOST_REPLANS = 8
RISK_PRICES_M = (30.0, 100.0, 300.0, 1000.0)  # of a metre that surely fails, in the next routes
LEAST_GAIN = 0.05  # of cost, for which a route is changed that can be driven
CROWD_M = 2.0  # about which rocks are counted
LEG_POINTS = 50  # of a leg, among which the nearest to the rover is looked for
MOST_CROWDED = 0.8  # share of a cell that rocks may take as far as its cost goes


@dataclass(frozen=True, eq=False)
class Following:
    """A route being driven."""

    store: TerrainStore  # the map from above and what the rover saw of it
    costs: SlopeCosts
    goal_w: Place
    goal_radius_m: float
    route: Route
    legs: tuple[Leg, ...]
    marks: tuple[Landmark, ...]
    map_: CostMap  # over which the route was planned, or judged last
    model: RouteModel = RouteModel()  # noqa: RUF009 - frozen
    leg_model: LegModel = LegModel()  # noqa: RUF009 - frozen
    at: int = 0  # the leg being driven
    blocked_w: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))  # (N, 3) x, y, radius
    driven: tuple[Leg, ...] = ()  # legs that are over, of former routes too
    routes: tuple[Route, ...] = ()  # former ones
    reasons: tuple[str, ...] = ()  # why each of those was given up
    refusals: int = 0  # how many of them because a leg could not be driven
    rocks_w: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))  # (N, 3) x, y, radius of those to go round
    lifted_m: float = 0.0  # by which ground too fine for the map rises under the belly
    risk_model: RiskModel | None = None  # None: no forecasts
    risk: RouteRisk | None = None  # of the route
    risks: tuple[RouteRisk | None, ...] = ()  # of former ones

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
    risk_model: RiskModel | None = None,
) -> Following:
    """The first route, or another within the limit of risk; `Following.route` may be a refusal without legs."""
    model, leg_model = model or RouteModel(), leg_model or LegModel()
    map_ = cost_map(ground, costs, model)
    route, marks = plan_route(map_, start_w, goal_w, model), landmarks(ground)
    cut = legs(map_, route, marks, leg_model)
    first = Following(
        TerrainStore(ground),
        costs,
        goal_w,
        goal_radius_m,
        route,
        cut,
        marks,
        map_,
        model,
        leg_model,
        risk_model=risk_model,
    )
    return within_limit(forecast(first, map_, start_w), start_w)


def aimed(plan: NavigatorState, following: Following, place: Place) -> NavigatorState:
    """The navigator with the target of the route from ``place``, or with the refusal of it as its end."""
    if following.route.refusal is not None:
        return replace(plan, end=Decision("no_path", following.route.reason))
    end_w, radius_m = following.target
    steep = forbidden(following.map_, place, _left(following, place), end_w, plan.models.footprint)
    return navigator.retarget(plan, end_w, radius_m, steep)


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
            following = improved(passed, plan, place)
            plan = aimed(plan, following, place)
    plan, decision = navigator.step(plan, observation, estimate, time_s, scan)
    if decision.kind != "no_path" or not following.legs:
        return following, plan, decision
    following, plan = given_up(following, plan, place, decision.reason)
    if plan.end is not None:
        return following, plan, plan.end
    plan, decision = navigator.step(plan, None, estimate, time_s)
    return following, plan, decision


def given_up(following: Following, plan: NavigatorState, place: Place, reason: str) -> tuple[Following, NavigatorState]:
    """Both after the present leg turned out not to be drivable: on another route, or at the end if there is none."""
    if following.refusals >= MOST_REPLANS:
        return following, replace(plan, end=Decision("no_path", f"{reason}, after {following.refusals} other routes"))
    other = _passed(blocked(following, place, reason), place)
    if other.route.refusal is not None:
        return other, replace(plan, end=Decision("no_path", f"{reason}; and over the map: {other.route.reason}"))
    return other, aimed(plan, other, place)


def improved(following: Following, plan: NavigatorState, place: Place) -> Following:
    """The following with what the rover saw on the last leg, and another route if that has become cheaper by enough.

    Old and new are compared over the same map, so that news of an obstacle never makes the way that is left worse.
    """
    told = replace(following, store=with_cells(following.store, plan.memory.cells), rocks_w=_rocks(plan))
    map_ = driven_map(told)
    told = replace(told, map_=map_)
    straight, way = np.vstack([[place], *[[leg.end_w] for leg in told.legs[told.at :]]]), _left(told, place)
    # A rover that was let off a leg before its end need not be able to go on straight: then it goes back to the way.
    old = min(way_cost(map_, straight), float(np.linalg.norm(way[0] - place)) + way_cost(map_, way))
    new = plan_route(map_, place, told.goal_w, replace(told.model, leave_m=LEAVE_M))
    if new.refusal is not None or new.cost > (1.0 - LEAST_GAIN) * old:
        return told
    reason = f"what was seen makes another way cheaper: {new.cost:.0f} instead of {old:.0f}"
    other = _rerouted(told, map_, new, reason, place)
    if told.risk_model is not None and other.risk is not None and not other.risk.within(told.risk_model.limit):
        return told
    return _passed(other, place)


def blocked(following: Following, place: Place, reason: str) -> Following:
    """Another route from ``place``, on which the rest of the present leg is not driven."""
    discs = np.vstack([following.blocked_w, _discs(following, place)])
    following = replace(following, blocked_w=discs, refusals=following.refusals + 1)
    map_ = driven_map(following)
    route = plan_route(map_, place, following.goal_w, replace(following.model, leave_m=LEAVE_M))
    return within_limit(_rerouted(following, map_, route, reason, place), place)


def within_limit(following: Following, place: Place) -> Following:
    """The following on a route from ``place`` whose risk is within the limit; refused where none is found.

    Each next route is planned with a higher price on slopes that may be more than the soil bears.
    """
    model, risk = following.risk_model, following.risk
    if model is None or risk is None or risk.within(model.limit):
        return following
    hazard, plain, tried = model.hazard, following.costs, [risk]
    for price_m in RISK_PRICES_M:
        following = replace(following, costs=priced(plain, hazard, price_m))
        map_ = driven_map(following)
        route = plan_route(map_, place, following.goal_w, replace(following.model, leave_m=LEAVE_M))
        following = _rerouted(following, map_, route, f"{in_words(tried[-1])}; risk.limit = {model.limit:g}", place)
        if following.risk is None or following.risk.within(model.limit):
            return following
        tried.append(following.risk)
    least = min(tried, key=lambda one: one.whole.fails.probability)
    reason = f"the least risky of {len(tried)} routes {in_words(least)}; risk.limit = {model.limit:g}"
    route = Route(np.zeros((0, 2)), np.inf, Refusal.TOO_RISKY, reason)
    return _rerouted(following, map_, route, reason, place)


def least_risky(following: Following) -> RouteRisk | None:
    """The risk of the route, or of the least risky one tried where it is refused; None without a forecast."""
    if following.risk is not None:
        return following.risk
    tried = [risk for risk in following.risks if risk is not None]
    return min(tried, key=lambda risk: risk.whole.fails.probability, default=None)


def forecast(following: Following, map_: CostMap, place: Place) -> Following:
    """The following with the forecast of its route from ``place``, where one is wanted and there are legs."""
    model, risk = following.risk_model, None
    if model is not None and following.legs:
        risk = route_risk(model, map_.grid, place, following.legs, len(following.routes))
    return replace(following, risk=risk)


def driven_map(following: Following) -> CostMap:
    """The cost map by all that is known: legs that could not be driven are closed, places among rocks cost more."""
    ground = fused(following.store)
    closed = _share(ground.field, following.blocked_w) > 0.0
    seen = ground.variance_m2 < following.store.coarse.variance_m2
    room = 1.0 - np.minimum(_crowding(_share(ground.field, following.rocks_w), seen, ground.field), MOST_CROWDED)
    return cost_map(ground, following.costs, following.model, closed, 1.0 / room)


def _crowding(share: FloatArray, seen: BoolArray, grid: HeightField) -> FloatArray:
    """How much of the ground rocks take about each cell, where the rover has looked; elsewhere the mean of that.

    Single rocks are navigation's matter, and ground that was not seen yet is no better for it.
    """
    if not seen.any():
        return np.zeros(share.shape)
    sigma = CROWD_M / grid.resolution_m
    known = ndimage.gaussian_filter(seen.astype(np.float64), sigma)
    about = ndimage.gaussian_filter(np.where(seen, share, 0.0), sigma) / np.maximum(known, 1e-9)
    return np.where(seen, about, float(share[seen].mean()))


def _rerouted(following: Following, map_: CostMap, route: Route, reason: str, place: Place) -> Following:
    other = replace(
        following,
        route=route,
        map_=map_,
        legs=legs(map_, route, following.marks, following.leg_model),
        at=0,
        driven=following.driven + following.legs[: following.at],
        routes=(*following.routes, following.route),
        reasons=(*following.reasons, reason),
        risks=(*following.risks, following.risk),
    )
    return forecast(other, map_, place)


def _rocks(plan: NavigatorState) -> FloatArray:
    """Rocks (N, 3) that the rover remembers and goes round: x, y and radius with half its own width."""
    rocks, body = plan.memory.rocks, plan.models.footprint
    high = (rocks.height_m > body.climb_height_m) & (rocks.certainty > 0.5)
    radius = 0.5 * np.sqrt(rocks.length_m * rocks.width_m) + 0.5 * body.width_m
    return np.column_stack([rocks.centre_w, radius])[high]


def _share(grid: HeightField, discs_w: FloatArray) -> FloatArray:
    """About how much of each cell (ny, nx) discs (N, 3) cover; cells that only touch one count in part."""
    ny, nx = grid.heights_m.shape
    share, cell = np.zeros((ny, nx)), grid.resolution_m
    for x, y, radius in discs_w:
        column, row = (x - grid.origin_m[0]) / cell, (y - grid.origin_m[1]) / cell
        reach = radius / cell
        rows = np.arange(max(0, int(row - reach)), min(ny, int(np.ceil(row + reach)) + 1))
        columns = np.arange(max(0, int(column - reach)), min(nx, int(np.ceil(column + reach)) + 1))
        if not (len(rows) and len(columns)):
            continue
        apart = np.hypot(rows[:, None] - row, columns[None, :] - column)
        share[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += np.clip(reach + 0.5 - apart, 0.0, 1.0) * min(
            1.0, np.pi * reach**2
        )
    return share


def _left(following: Following, place: Place) -> FloatArray:
    """The planned way (N, 2), N >= 2, to the goal from the point of the present leg that is nearest to a place."""
    way = following.route.way_w
    arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    begun_m = sum(leg.length_m for leg in following.legs[: following.at])
    leg_m = begun_m + np.linspace(0.0, following.leg.length_m, LEG_POINTS)
    points = np.column_stack([np.interp(leg_m, arcs, way[:, axis]) for axis in (0, 1)])
    nearest = int(np.argmin(np.linalg.norm(points - np.asarray(place), axis=1)))
    return np.vstack([points[nearest], way[arcs > leg_m[nearest]][:-1], way[-1]])


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
