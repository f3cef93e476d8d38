"""The summary of a traverse: the keys that scripts rely on, computed from the trace."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.route_following import Following
from rover_sim import __version__
from rover_sim.outcome import Reason
from rover_sim.sim.mobility_events import Kind, MobilityEvent

EVENTS_LISTED = 200  # the counts go on
ROLLING_M_S = 0.05  # below this rim speed a slip ratio says nothing


@dataclass(frozen=True)
class Counts:
    """What happened how often during a traverse."""

    collisions: int = 0
    frames: int = 0
    plans: int = 0
    missions_sent: int = 0
    waypoints_sent: int = 0
    failsafe_stops: int = 0


@dataclass(frozen=True)
class Identity:
    """What was run."""

    scenario: str
    seed: int
    start_w: tuple[float, float]
    goal_w: tuple[float, float]
    wheel_radius_m: float


def _rolling_slip(trace: dict[str, NDArray[np.float64]], wheel_radius_m: float) -> NDArray[np.float64]:
    """Absolute slip ratios (n,) of all wheels while their rims moved."""
    rolling = np.abs(trace["wheel_speed"]) * wheel_radius_m > ROLLING_M_S
    return np.abs(trace["slip"][rolling])


def tilt_deg(quaternion_w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle (n,) between the body's z axis and the vertical, degrees."""
    x, y = quaternion_w[:, 0], quaternion_w[:, 1]
    up = np.asarray(1 - 2 * (x * x + y * y))
    return np.asarray(np.degrees(np.arccos(np.clip(up, -1.0, 1.0))))


def _rounded(value: float, digits: int = 4) -> float:
    """A plain float for JSON."""
    return round(float(value), digits)


def motion_figures(trace: dict[str, NDArray[np.float64]], identity: Identity) -> dict[str, Any]:
    """Distances, slip, sinkage, tilt and energy of the trace."""
    position = trace["position_w"]
    distance = float(np.linalg.norm(np.diff(position, axis=0), axis=1).sum())
    straight = float(np.hypot(*(np.subtract(identity.goal_w, identity.start_w))))
    slip = _rolling_slip(trace, identity.wheel_radius_m)
    return {
        "distance_m": _rounded(distance),
        "straight_line_m": _rounded(straight),
        "path_inefficiency": _rounded(distance / straight - 1) if straight > 0 else None,
        "goal_distance_m": _rounded(np.hypot(*(position[-1, :2] - np.asarray(identity.goal_w)))),
        **belief_figures(trace),
        "max_tilt_deg": _rounded(tilt_deg(trace["quaternion_w"]).max(), 2),
        "min_stability_margin": _rounded(trace["stability_margin"].min()),
        "mean_slip": _rounded(slip.mean() if slip.size else 0.0),
        "max_slip": _rounded(slip.max(initial=0.0)),
        "max_sinkage_m": _rounded(trace["sinkage"].max()),
        "energy_J": _rounded(trace["energy_J"][-1], 1),
    }


def belief_figures(trace: dict[str, NDArray[np.float64]]) -> dict[str, float]:
    """How far the believed place was off, at most and at the end, and the one sigma that the rover gave then."""
    off = np.hypot(*(trace["estimate_position_w"] - trace["position_w"])[:, :2].T)
    return {
        "place_error_m": _rounded(off[-1]),
        "max_place_error_m": _rounded(off.max()),
        "place_sd_m": _rounded(np.sqrt(np.trace(trace["estimate_covariance_m2"][-1].reshape(2, 2)))),
    }


def event_figures(events: Sequence[MobilityEvent]) -> dict[str, Any]:
    """How many mobility events of each kind there were, and the first of them one by one."""
    counts = Counter(event.kind for event in events)
    return {
        "event_counts": {kind.value: counts[kind] for kind in Kind},
        "events": [
            {
                "kind": event.kind.value,
                "time_s": _rounded(event.time_s),
                "position_m": [_rounded(value, 3) for value in event.position_m],
                "wheel": event.wheel,
            }
            for event in events[:EVENTS_LISTED]
        ],
    }


def route_figures(route: Following) -> dict[str, Any]:
    """The route: what it was to cost, its legs, driven ones first, and why it was replanned."""
    first = route.routes[0] if route.routes else route.route
    return {
        "refusal": None if route.route.refusal is None else route.route.refusal.value,
        "length_m": _rounded(first.length_m),
        "cost": _rounded(first.cost) if np.isfinite(first.cost) else None,
        "replans": len(route.routes),
        "replan_reasons": list(route.reasons),
        "legs_driven": len(route.driven) + route.at,
        "legs": [
            {
                "end_m": [_rounded(value, 2) for value in leg.end_w],
                "length_m": _rounded(leg.length_m, 2),
                "cost": _rounded(leg.cost, 2) if np.isfinite(leg.cost) else None,
                "landmark_m": None
                if leg.landmark is None
                else [_rounded(value, 2) for value in leg.landmark.position_w],
            }
            for leg in (*route.driven, *route.legs)
        ],
    }


def summarize(
    trace: dict[str, NDArray[np.float64]],
    identity: Identity,
    counts: Counts,
    reason: Reason,
    *,
    wall_time_s: float,
    ttam: float | None,
    detail: str,
    events: Sequence[MobilityEvent],
    faults: Mapping[str, Any],
    route: Following | None = None,
    risk: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """All keys of ``summary.json``; ``detail`` is the sentence for a person behind ``reason``."""
    sim_time_s = float(trace["time_s"][-1])
    return {
        "scenario": identity.scenario,
        "seed": identity.seed,
        "success": reason is Reason.GOAL,
        "reason": reason.value,
        "detail": detail,
        "sim_time_s": _rounded(sim_time_s),
        "wall_time_s": _rounded(wall_time_s, 3),
        "real_time_factor": _rounded(sim_time_s / wall_time_s, 2) if wall_time_s > 0 else None,
        **motion_figures(trace, identity),
        **asdict(counts),
        **event_figures(events),
        "faults": dict(faults),
        "route": None if route is None else route_figures(route),
        "risk": risk,
        "ttam": None if ttam is None else _rounded(ttam, 2),
        "version": __version__,
    }
