"""Watches a route being driven: tells stations its risk when it is planned, and keeps which leg was driven when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from planner.risk import Forecast
from planner.route import Refusal, Route
from planner.route_following import Following, least_risky
from planner.route_marks import Leg
from planner.route_risk import RouteRisk
from rover_sim.autopilot.modes import Severity
from worlds.types import FloatArray

RiskyWay = tuple[FloatArray, Forecast]  # a way (2, 2) and what was forecast of it
Say = Callable[[Severity, str], None]
NEAR_LIMIT = 0.5  # of the limit: from there on a risk is worth a warning


@dataclass(eq=False)
class Visit:
    """A leg while it was driven."""

    leg: Leg
    way_w: FloatArray  # (2, 2) of its forecast
    forecast: Forecast
    begun_s: float
    over_s: float | None = None
    arrived: bool = False


@dataclass(eq=False)
class RiskWatch:
    """Is shown the route at each tick."""

    say: Say
    visits: list[Visit] = field(default_factory=list)
    stops_s: list[float] = field(default_factory=list)  # times of fail-safe stops
    first: Following | None = None  # the route before the drive
    _told: Route | None = None

    def look(self, time_s: float, route: Following, stops: int) -> None:
        """The route as it stands, and how many fail-safe stops there were so far."""
        if route.risk_model is None:
            return
        self.first = self.first or route
        if route.route is not self._told:
            self._told = route.route
            self._tell(route)
        self.stops_s += [time_s] * (stops - len(self.stops_s))
        last = self.visits[-1] if self.visits else None
        if route.risk is None or (last is not None and route.leg is last.leg):
            return
        self._close(route, time_s)
        at = route.at
        self.visits.append(Visit(route.leg, route.risk.ways_w[at], route.risk.legs[at], time_s))

    def risky_ways(self, route: Following) -> list[RiskyWay]:
        """Legs with their forecasts: those that were begun, then the rest of the route as it stands."""
        begun = [(visit.way_w, visit.forecast) for visit in self.visits]
        risk = route.risk if self.visits else least_risky(route)
        if risk is None:
            return begun
        after = route.at + 1 if self.visits else 0
        return begun + list(zip(risk.ways_w[after:], risk.legs[after:], strict=True))

    def _close(self, route: Following, time_s: float) -> None:
        """The leg before is over; it was driven to its end if the route counts it among those behind the rover."""
        if self.visits:
            behind = (*route.driven, *route.legs[: route.at])
            self.visits[-1].over_s = time_s
            self.visits[-1].arrived = any(leg is self.visits[-1].leg for leg in behind)

    def _tell(self, route: Following) -> None:
        limit = None if route.risk_model is None else route.risk_model.limit
        if route.route.refusal is Refusal.TOO_RISKY and (tried := least_risky(route)) is not None:
            self.say(Severity.CRITICAL, f"Route refused: {in_short(tried)}, limit {100 * (limit or 0.0):.0f} %")
        elif route.risk is not None:
            high = limit is not None and route.risk.whole.fails.probability > NEAR_LIMIT * limit
            self.say(Severity.WARNING if high else Severity.INFO, f"Route: {in_short(route.risk)}")


def in_short(risk: RouteRisk) -> str:
    """For a STATUSTEXT of 50 characters."""
    whole, worst = risk.whole.fails.probability, risk.legs[risk.riskiest].fails.probability
    text = f"risk {100 * whole:.0f} %"
    return f"{text}, leg {risk.riskiest + 1} of {len(risk.legs)} {100 * worst:.0f} %" if worst > 0.0 else text
