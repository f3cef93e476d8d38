"""The risk of a route in a run: scenario keys, what is told over the link, and what the summary says of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from planner.risk_prior import MapError
from planner.route import Route
from planner.route_following import Following
from planner.route_risk import RiskModel
from rover_sim.autopilot.modes import Severity
from rover_sim.cli import main
from rover_sim.driven_rover import CAMERA_STREAM, LASER_STREAM, LINK_STREAM, SENSOR_STREAM, SURVEY_STREAM
from rover_sim.errors import InputError
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.outcome import Reason
from rover_sim.risk_belief import STREAM as RISK_STREAM
from rover_sim.risk_belief import risk_vehicle
from rover_sim.risk_figures import risk_figures
from rover_sim.risk_watch import RiskWatch
from rover_sim.route_map import ORBIT_STREAM, first_route
from rover_sim.sim.rover import load_rover
from tests.foreign_rig import ForeignPair
from tests.test_planner_route_risk import GOAL, START, begun, ridge
from worlds.build import build_world
from worlds.errors import ScenarioError
from worlds.risk_table import RiskTable
from worlds.route_table import RouteTable
from worlds.scenario import Goal, Rocks, RoverChoice, Scenario, SoilChoice, Terrain, check_scenario, load_scenario

SLOPE = Scenario(
    name="slope",
    terrain=Terrain(kind="slope", slope_deg=12.0, size_m=(30.0, 20.0), resolution_m=0.25),
    rocks=Rocks(cfa=0.0),
    goal=Goal(position_m=(12.0, 0.0)),
    route=RouteTable(error_m=0.02, leg_m=(4.0, 8.0)),
)


def test_what_is_believed_is_drawn_apart_from_what_is_true() -> None:
    true = SENSOR_STREAM, CAMERA_STREAM, LASER_STREAM, LINK_STREAM, SURVEY_STREAM, ORBIT_STREAM
    # Zeros at the end of a seed change nothing: only the number of the stream tells draws apart.
    assert len({*true, RISK_STREAM}) == len(true) + 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[risk]\nlimit = 0.2", "risk.limit = 0.2: only a scenario with a table [route]"),
        ("[risk]", "risk: only a scenario with a table [route]"),
        ("[route]\n[risk]\nlimit = 1.5", "risk.limit = 1.5: allowed are 0 to 1"),
        ("[route]\n[risk]\nlimit = -0.1", "risk.limit = -0.1: allowed are 0 to 1"),
        ("[route]\n[risk]\nlimit = nan", "risk.limit = nan: must be a finite number"),
        ('[route]\n[risk]\nsoils = ["mud"]', "risk.soils: "),
        (
            "[route]\n[risk]\nweights = [1.0]",
            "risk.weights = [1.0]: 1 weights for 0 risk.soils; one for each is wanted",
        ),
        ('[route]\n[risk]\nsoils = ["firm"]\nweights = [0.0]', "risk.weights = [0.0]: at least one must be above 0"),
        ('[route]\n[risk]\nsoils = ["firm"]\nweights = [-1.0]', "risk.weights[0] = -1: allowed are 0 to 1e+06"),
    ],
)
def test_a_table_at_odds_is_one_line_and_exit_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, says: str
) -> None:
    scenario = tmp_path / "odd.toml"
    scenario.write_text(f'name = "odd"\n{text}\n', encoding="utf-8")
    assert main(["run", str(scenario), "--out", str(tmp_path / "run")]) == 2
    told = capsys.readouterr().err.strip()
    assert says in told
    assert "\n" not in told


def test_a_limit_for_a_rover_with_arms_is_refused() -> None:
    arms = load_rover("rocker_bogie")
    plain = Scenario(name="arms", rover=RoverChoice(model="rocker_bogie"), route=RouteTable())
    assert risk_vehicle(arms, plain) is None
    limited = Scenario(name="arms", rover=plain.rover, route=RouteTable(), risk=RiskTable(limit=0.5))
    with pytest.raises(
        InputError, match=r'arms: risk.limit = 0.5: there is no forecast for rover.model = "rocker_bogie"'
    ):
        risk_vehicle(arms, limited)


def begun_on(scenario: Scenario) -> Following:
    check_scenario(scenario, "test")
    rover = load_rover("husky")
    route = first_route(build_world(scenario, 4), rover.footprint(), risk_vehicle(rover, scenario))
    assert route is not None
    return route


def with_risk(risk: RiskTable | None, soil: str = "mars_sand") -> Scenario:
    base = SLOPE
    return Scenario(
        name=base.name,
        terrain=base.terrain,
        rocks=base.rocks,
        goal=base.goal,
        route=base.route,
        soil=SoilChoice(preset=soil),
        risk=risk,
    )


def test_the_forecast_is_made_of_the_soils_that_may_lie_there_and_of_the_map_error_left() -> None:
    route = begun_on(with_risk(None))
    assert route.risk_model is not None
    assert [soil.name for soil in route.risk_model.prior.soils] == ["mars_sand"]
    assert 0.0 < route.risk_model.error.sd_m < 0.02  # less than the orbiter's
    assert (route.risk_model.error.roughness_m, route.risk_model.error.relief_m) == (0.01, 0.0)  # a plane
    table = RiskTable(soils=("firm", "loose_sand"), weights=(3.0, 1.0), roughness_m=0.03, limit=0.9)
    mixed = begun_on(with_risk(table)).risk_model
    assert mixed is not None
    assert [soil.name for soil in mixed.prior.soils] == ["firm", "loose_sand"]
    assert (mixed.prior.weights, mixed.error.roughness_m, mixed.limit) == ((3.0, 1.0), 0.03, 0.9)


@pytest.mark.parametrize(("given", "told"), [(None, 0.01), (0.03, 0.03)])
def test_relief_below_the_cells_is_told_by_the_map_unless_a_number_is_given(given: float | None, told: float) -> None:
    terrain = Terrain(kind="fractal", roughness_m=0.15, size_m=(60.0, 40.0), resolution_m=0.25)
    hills = msgspec.structs.replace(SLOPE, terrain=terrain, risk=RiskTable(roughness_m=given))
    found = begun_on(hills)
    watch = RiskWatch(Heard().say)
    watch.look(0.0, found, 0)
    figures = risk_figures(watch, trace((0.0, 0.0, 0.0, 0.0)), Reason.TIMEOUT)
    assert figures is not None
    assert figures["roughness_m"] == told
    assert (figures["map_relief_m"] > 0.02) == (given is None)
    assert figures["map_relief_m"] < 0.05
    assert figures["map_sd_m"] > figures["map_relief_m"]


def test_the_true_soil_does_not_reach_the_forecast() -> None:
    table = RiskTable(soils=("firm",))
    one, other = (begun_on(with_risk(table, soil)).risk_model for soil in ("mars_sand", "firm"))
    assert one is not None
    assert other is not None
    assert (one.prior, one.error) == (other.prior, other.error)


def test_risk_grows_with_worse_soil_and_a_limit_refuses() -> None:
    firm, sand = (begun_on(with_risk(RiskTable(soils=(name,)))).risk for name in ("firm", "mars_sand"))
    assert firm is not None
    assert sand is not None
    assert firm.whole.fails.probability < sand.whole.fails.probability
    refused = begun_on(with_risk(RiskTable(limit=0.0)))
    assert refused.route.refusal == "too_risky"
    assert refused.route.reason.startswith("the least risky of ")


@dataclass
class Heard:
    """Who is told what."""

    texts: list[tuple[Severity, str]] = field(default_factory=list)

    def say(self, severity: Severity, text: str) -> None:
        self.texts.append((severity, text))


def model(limit: float | None) -> RiskModel:
    found = begun(ridge(1.75)).risk_model
    assert found is not None
    return replace(found, limit=limit, error=MapError(0.03, 1.2, 0.01))


@pytest.mark.parametrize(("limit", "severity"), [(None, Severity.INFO), (0.9, Severity.INFO), (0.5, Severity.WARNING)])
def test_a_station_is_told_the_risk_when_it_is_planned_and_once(limit: float | None, severity: Severity) -> None:
    heard, route = Heard(), begun(ridge(1.62), limit)
    watch = RiskWatch(heard.say)
    for time_s in (0.0, 0.1, 0.2):
        watch.look(time_s, route, 0)
    assert route.risk is not None
    share = f"{100 * route.risk.whole.fails.probability:.0f} %"
    assert len(heard.texts) == 1
    assert heard.texts[0][0] is severity
    assert heard.texts[0][1].startswith(f"Route: risk {share}, leg {route.risk.riskiest + 1} of {len(route.legs)}")
    assert len(heard.texts[0][1]) <= 50


def test_a_refusal_is_critical() -> None:
    heard = Heard()
    watch = RiskWatch(heard.say)
    watch.look(0.0, begun(ridge(1.75, low_end_m=1e3), 0.1), 0)
    ((severity, text),) = heard.texts
    assert severity is Severity.CRITICAL
    assert text.startswith("Route refused: risk ")
    assert text.endswith("limit 10 %")


def trace(*rows: tuple[float, float, float, float]) -> dict[str, Any]:
    """Of time, x, y and roll in degrees."""
    table = np.array(rows)
    half = 0.5 * np.radians(table[:, 3])
    zero = np.zeros(len(rows))
    return {
        "time_s": table[:, 0],
        "position_w": np.column_stack([table[:, 1:3], zero]),
        "quaternion_w": np.column_stack([np.sin(half), zero, zero, np.cos(half)]),
    }


def driven(route: Following, stops: int = 0) -> RiskWatch:
    """The first leg from 0 to 10 s, the next one from then on; stops at 12 s."""
    watch = RiskWatch(Heard().say)
    watch.look(0.0, route, 0)
    watch.look(10.0, replace(route, at=1), 0)
    watch.look(12.0, replace(route, at=1), stops)
    return watch


def test_what_happened_is_told_by_leg() -> None:
    route = begun(ridge(1.75, low_end_m=26.0))
    assert len(route.legs) >= 3
    second = np.asarray(route.legs[0].end_w)
    rows = trace((0.0, *START, 0.0), (9.0, *second, 12.0), (12.0, *(second + 0.5), 3.0), (20.0, *GOAL, 2.0))
    figures = risk_figures(driven(route), rows, Reason.TIMEOUT)
    assert figures is not None
    first, last = (leg["happened"] for leg in figures["legs"])
    assert (first["fails"], first["arrived"], first["stops"], first["lateral_m"]) == (False, True, 0, 0.0)
    assert first["max_tilt_deg"] == pytest.approx(12.0)
    assert (last["fails"], last["arrived"]) == (None, False)  # time ran out: neither
    assert figures["route"]["happened"]["fails"] is None
    assert len(figures["plan"]) == figures["route"]["legs"] == len(route.legs)
    assert figures["limit"] is None
    assert risk_figures(driven(route), rows, Reason.GOAL)["route"]["happened"]["fails"] is False  # type: ignore[index]


def test_a_stop_and_a_rollover_are_failures_of_their_leg() -> None:
    route = begun(ridge(1.75))
    end = np.asarray(route.legs[0].end_w)
    on_second = end + 0.5 * (np.asarray(route.legs[1].end_w) - end)
    rows = trace((0.0, *START, 0.0), (9.0, *end, 0.0), (12.0, *on_second, 50.0))
    figures = risk_figures(driven(route, stops=1), rows, Reason.GOAL)
    assert figures is not None
    assert [leg["happened"]["stops"] for leg in figures["legs"]] == [0, 1]
    assert [leg["happened"]["rollover"] for leg in figures["legs"]] == [False, True]
    assert figures["route"]["happened"]["fails"] is True
    # A leg is begun before the end of the one before: a stop still on that one's line is that one's.
    on_first = end - 0.1 * (end - np.asarray(START))
    early = trace((0.0, *START, 0.0), (9.0, *on_first, 0.0), (12.0, *on_first, 5.0))
    figures = risk_figures(driven(route, stops=1), early, Reason.GOAL)
    assert figures is not None
    assert [leg["happened"]["stops"] for leg in figures["legs"]] == [1, 0]
    assert [leg["happened"]["immobilised"] for leg in figures["legs"]] == [True, False]


def test_a_leg_that_was_given_up_neither_failed_nor_arrived() -> None:
    route = begun(ridge(1.75))
    watch = RiskWatch(Heard().say)
    watch.look(0.0, route, 0)
    other = begun(ridge(1.7))
    watch.look(5.0, replace(other, routes=(route.route,)), 0)
    figures = risk_figures(watch, trace((0.0, *START, 0.0), (5.0, 6.0, 20.0, 0.0), (9.0, *GOAL, 0.0)), Reason.GOAL)
    assert figures is not None
    assert figures["legs"][0]["happened"]["fails"] is None
    assert figures["legs"][1]["happened"]["fails"] is False


def test_the_picture_has_legs_as_they_were_begun_and_then_those_that_are_left() -> None:
    route = begun(ridge(1.75))
    watch, other = driven(route), begun(ridge(1.7))
    second = replace(other, routes=(route.route,))
    watch.look(15.0, second, 0)
    ways = watch.risky_ways(second)
    assert other.risk is not None
    assert route.risk is not None
    assert [forecast for _, forecast in ways] == [*route.risk.legs[:2], *other.risk.legs]
    refused = begun(ridge(1.75, low_end_m=1e3), 0.1)
    assert len(RiskWatch(Heard().say).risky_ways(refused)) > 1


def test_a_refused_route_has_a_forecast_and_nothing_happened() -> None:
    route = begun(ridge(1.75, low_end_m=1e3), 0.1)
    watch = RiskWatch(Heard().say)
    watch.look(0.0, route, 0)
    figures = risk_figures(watch, trace((0.0, *START, 0.0)), Reason.NO_PATH)
    assert figures is not None
    assert figures["refused"] is True
    assert figures["legs"] == []
    assert figures["route"]["happened"] is None
    assert figures["route"]["fails"] == min(figures["routes_rejected"]) > 0.1


def test_without_a_forecast_there_are_no_figures() -> None:
    route = replace(begun(ridge(1.0)), risk_model=None, risk=None)
    watch = RiskWatch(Heard().say)
    watch.look(0.0, route, 0)
    assert risk_figures(watch, trace((0.0, *START, 0.0)), Reason.GOAL) is None
    assert isinstance(route.route, Route)


def test_a_foreign_autopilot_hears_the_companion_once_it_is_found() -> None:
    pair = ForeignPair()
    pair.companion.say(Severity.WARNING, "Route: risk 31 %, leg 2 of 6 28 %")
    heard: list[Message] = []
    pair.double._handlers["STATUSTEXT"] = heard.append
    pair.run(2.0)
    assert pair.companion.found is not None
    assert [(text.severity, text.text) for text in heard] == [
        (mavlink.MAV_SEVERITY_WARNING, "Route: risk 31 %, leg 2 of 6 28 %")
    ]
    assert heard[0].get_srcComponent() == mavlink.MAV_COMP_ID_ONBOARD_COMPUTER


def test_the_example_loads() -> None:
    scenario = load_scenario(str(Path(__file__).parents[1] / "examples" / "risk.toml"))
    assert scenario.risk is not None
    assert scenario.risk.limit == 0.4


def test_unknown_soils_of_a_prior_are_scenario_errors() -> None:
    with pytest.raises(ScenarioError, match=r"test: risk.soils: "):
        check_scenario(with_risk(RiskTable(soils=("mud",))), "test")
