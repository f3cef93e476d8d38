"""``risk`` of ``summary.json``: what was forecast of the route before the drive, the limit, and what then happened."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from planner.risk import Forecast
from planner.route_following import least_risky
from planner.route_risk import RouteRisk
from rover_sim.outcome import Reason
from rover_sim.risk_watch import RiskWatch, Visit
from rover_sim.summary import tilt_deg
from worlds.types import FloatArray

TIPPED_DEG = 45.0  # no route is half as steep: only the end of the run keeps such a rover from going over
STUCK = (Reason.SLIP_STOP, Reason.EMBEDDED)


def risk_figures(watch: RiskWatch, trace: Mapping[str, FloatArray], reason: Reason) -> dict[str, Any] | None:
    """Forecast of the first route and of each leg as it was begun, with what happened on it; None without forecasts."""
    route = watch.first
    if route is None or route.risk_model is None or (risk := least_risky(route)) is None:
        return None
    model = route.risk_model
    visits = [] if route.risk is None else watch.visits
    stops = stops_on(visits, watch.stops_s, trace)
    driven = [
        happened(visit, count, trace, reason, last=visit is visits[-1])
        for visit, count in zip(visits, stops, strict=True)
    ]
    return {
        "limit": model.limit,
        "rollouts": model.rollouts,
        "soils": {soil.name: weight for soil, weight in zip(model.prior.soils, model.prior.weights, strict=True)},
        "map_sd_m": round(model.error.sd_m, 4),
        "map_correlation_m": round(model.error.correlation_m, 3),
        "map_relief_m": round(model.error.relief_m, 4),
        "roughness_m": round(model.error.roughness_m, 4),
        "refused": route.risk is None,
        "routes_rejected": [round(tried.whole.fails.probability, 4) for tried in route.risks if tried is not None],
        "route": {**chances(risk.whole), "legs": len(risk.legs), "happened": _whole(driven, reason)},
        "plan": [_leg(risk, number) for number in range(len(risk.legs))],
        "legs": [
            {"to_m": _place(visit.way_w[1]), **chances(visit.forecast), "happened": what}
            for visit, what in zip(visits, driven, strict=True)
        ],
    }


def chances(forecast: Forecast) -> dict[str, Any]:
    """The figures of a forecast."""
    return {
        "fails": round(forecast.fails.probability, 4),
        "fails_95": [round(forecast.fails.low, 4), round(forecast.fails.high, 4)],
        "rollover": round(forecast.rollover.probability, 4),
        "immobilised": round(forecast.immobilised.probability, 4),
        "lateral_mean_m": round(forecast.lateral_mean_m, 3),
        "lateral_p95_m": round(forecast.lateral_p95_m, 3),
    }


def stops_on(visits: list[Visit], stops_s: list[float], trace: Mapping[str, FloatArray]) -> list[int]:
    """How many fail-safe stops there were on each leg.

    A leg is begun some way before the end of the one before, so of these two the nearer one to the rover counts.
    """
    counts = [0] * len(visits)
    for time_s in stops_s:
        at = sum(visit.begun_s <= time_s for visit in visits) - 1
        row = min(int(np.searchsorted(trace["time_s"], time_s)), len(trace["time_s"]) - 1)
        place = trace["position_w"][row, :2]
        apart = [(_apart(place, visits[leg].way_w), leg) for leg in (at, at - 1) if leg >= 0]
        if apart:
            counts[min(apart)[1]] += 1
    return counts


def happened(
    visit: Visit, stops: int, trace: Mapping[str, FloatArray], reason: Reason, *, last: bool
) -> dict[str, Any]:
    """What came of a leg, by the true state; ``fails`` is None where neither its end nor a failure came.

    A fail-safe stop is a failure as it was forecast, even where the rover freed itself afterwards.
    """
    time_s, end_s = trace["time_s"], np.inf if visit.over_s is None else visit.over_s
    during = (time_s >= visit.begun_s) & (time_s <= end_s)
    tilt = float(tilt_deg(trace["quaternion_w"][during]).max(initial=0.0))
    tipped = tilt > TIPPED_DEG or (last and reason is Reason.TIPPED)
    stuck = not tipped and (stops > 0 or (last and reason in STUCK))
    arrived = visit.arrived or (last and reason is Reason.GOAL)
    return {
        "fails": True if tipped or stuck else False if arrived else None,
        "rollover": tipped,
        "immobilised": stuck,
        "arrived": arrived,
        "stops": stops,
        "max_tilt_deg": round(tilt, 2),
        "lateral_m": _astray(trace["position_w"][during, :2], visit.way_w[1]),
    }


def _whole(driven: list[dict[str, Any]], reason: Reason) -> dict[str, Any] | None:
    """What came of all legs together; None where nothing was driven."""
    if not driven:
        return None
    failed = {name: any(leg[name] for leg in driven) for name in ("rollover", "immobilised")}
    fails = True if any(failed.values()) else False if reason is Reason.GOAL else None
    astray = [leg["lateral_m"] for leg in driven if leg["lateral_m"] is not None]
    return {"fails": fails, **failed, "lateral_m": max(astray, default=None)}


def _astray(track_w: FloatArray, end_w: FloatArray) -> float | None:
    """Largest distance (m) of a track (N, 2) from the straight line between its first point and a leg's end."""
    if not len(track_w) or not (length := float(np.linalg.norm(end_w - track_w[0]))):
        return None
    ahead = (end_w - track_w[0]) / length
    off = track_w - track_w[0]
    return round(float(np.abs(ahead[0] * off[:, 1] - ahead[1] * off[:, 0]).max()), 3)


def _apart(place: FloatArray, way_w: FloatArray) -> float:
    """Distance of a place (2,) from a straight way (2, 2)."""
    along = way_w[1] - way_w[0]
    share = float(np.clip(along @ (place - way_w[0]) / max(float(along @ along), 1e-9), 0.0, 1.0))
    return float(np.linalg.norm(place - way_w[0] - share * along))


def _leg(risk: RouteRisk, number: int) -> dict[str, Any]:
    start, end = risk.ways_w[number]
    return {"from_m": _place(start), "to_m": _place(end), **chances(risk.legs[number])}


def _place(point: FloatArray) -> list[float]:
    return [round(float(value), 2) for value in point]
