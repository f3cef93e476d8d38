"""The table of a scenario about the risk of its route: what may lie there, and how much risk is allowed."""

from __future__ import annotations

from worlds.errors import ScenarioError
from worlds.soil_file import load_soil
from worlds.strict_toml import Table


class RiskTable(Table, frozen=True):
    """What is believed of the ground of a route, and the limit."""

    limit: float | None = None  # probability of failure over which a route is not driven; None: any is
    soils: tuple[str, ...] = ()  # that may lie there, presets or files; none: the scenario's main one
    weights: tuple[float, ...] = ()  # how likely each of them is; none: all the same
    roughness_m: float | None = None  # rms of what is too fine for the map; None: by the map's own spectrum


LIMITS: dict[str, tuple[float, float]] = {
    "risk.limit": (0.0, 1.0),
    "risk.weights": (0.0, 1e6),
    "risk.roughness_m": (0.0, 1.0),
}


def check_risk(risk: RiskTable | None, source: str, *, routed: bool) -> None:
    """Raise a `ScenarioError` for a table without a route, for an unknown soil and for weights that fit no soils."""
    if risk is None:
        return
    if not routed:
        given = "risk" if risk.limit is None else f"risk.limit = {risk.limit:g}"
        raise ScenarioError(f"{source}: {given}: only a scenario with a table [route] has a route to forecast")
    for soil in risk.soils:
        try:
            load_soil(soil)
        except ScenarioError as error:
            raise ScenarioError(f"{source}: risk.soils: {error}") from error
    if len(set(risk.soils)) < len(risk.soils):
        raise ScenarioError(
            f"{source}: risk.soils = {list(risk.soils)}: each soil only once; weights say how likely it is"
        )
    if not risk.weights:
        return
    if len(risk.weights) != len(risk.soils):
        raise ScenarioError(
            f"{source}: risk.weights = {list(risk.weights)}: {len(risk.weights)} weights for {len(risk.soils)} "
            "risk.soils; one for each is wanted"
        )
    if sum(risk.weights) <= 0.0:
        raise ScenarioError(f"{source}: risk.weights = {list(risk.weights)}: at least one must be above 0")
