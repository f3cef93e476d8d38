"""The whole chain under the doubled PX4: pictures, planner, missions over MAVLink, sensors, controls, our physics."""

from __future__ import annotations

import numpy as np
import pytest

from rover_sim.hil.session import Watchers
from tests.px4_mavlink_double import READY_S
from tests.px4_mission import mission
from worlds.scenario import Camera, Goal, Rocks, Scenario, SoilChoice, Terrain, load_scenario

SHORT = Scenario(
    name="short",
    terrain=Terrain(kind="flat", size_m=(12.0, 10.0), resolution_m=0.1),
    rocks=Rocks(cfa=0.02, min_diameter_m=0.1, max_diameter_m=0.4, clear_radius_m=1.0),
    soil=SoilChoice(preset="firm"),
    camera=Camera(rate_hz=1.0),
    goal=Goal(position_m=(3.0, 0.5), time_limit_s=90.0),
)


def test_a_short_mission_reaches_its_goal() -> None:
    """From a cold start, steered by what its own sensors say; every HIL message is checked by the double."""
    summary, vehicle = mission(SHORT, 3)
    assert summary["reason"] == "goal", summary
    assert vehicle.rover.driven  # waypoints that came over MAVLink
    assert summary["sim_time_s"] > READY_S
    assert vehicle.px4.checks.believed.sensors == summary["hil"]["steps"]
    assert summary["hil"]["lockstep"]["most_steps"] <= 1
    assert summary["hil"]["lockstep"]["given_up"] == 0
    assert np.percentile(vehicle.errors_m, 95) < 0.25


def test_px4_restarts_on_its_way_and_the_goal_is_reached_all_the_same() -> None:
    """The new one knows of no mission and is not ready: it is waited for again."""
    said: list[str] = []
    summary, vehicle = mission(SHORT, 3, Watchers(say=said.append), restart_s=READY_S + 1.0)
    assert said == ["PX4 began anew, and the traverse with it"]
    assert summary["reason"] == "goal", summary
    assert summary["hil"]["restarts"] == 1
    assert vehicle.px4.checks.believed.sensors == summary["hil"]["steps"]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_nine_of_ten_rock_fields_of_20_m_are_crossed() -> None:
    scenario = load_scenario("rock-field")
    reasons = [mission(scenario, seed)[0]["reason"] for seed in range(10)]
    assert reasons.count("goal") >= 9, reasons
