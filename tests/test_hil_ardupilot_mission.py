"""The whole chain under the doubled ArduPilot: pictures, planner, missions over MAVLink, servo packets, our physics."""

from __future__ import annotations

import pytest

from rover_sim.hil.session import Watchers
from rover_sim.mavlink.foreign_pursuit import Patience
from tests.ardupilot_checks import check_rest, check_stream
from tests.ardupilot_mission import mission
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
    """From a cold start: no wheel turns before the autopilot is ready, 42.6 s after its start."""
    shown: list[str] = []
    summary, vehicle = mission(SHORT, 3, Watchers(show=lambda status: shown.append(status.doing)))
    assert summary["reason"] == "goal", summary
    assert shown[20] == "waits for a position (estimator flags 167)"
    assert shown[-1] == "arrived"
    assert vehicle.rover.driven  # waypoints that came over MAVLink
    assert not vehicle.rover.started_torn
    states = vehicle.json.states
    assert len(states) == vehicle.json.count == round(240 * states[-1].time_s)
    moving = next(state.time_s for state in states if abs(state.vector("velocity")[1]) > 0.05)
    assert 42.6 < moving < 50.0
    check_rest(states[1 : 42 * 240])
    check_stream(states)


def test_an_autopilot_without_mavlink_is_a_lost_link_that_says_so() -> None:
    summary, _ = mission(SHORT, 3, patience=Patience(vehicle_s=3.0), mute=True)
    assert (summary["reason"], summary["detail"]) == ("link_lost", "no autopilot heard within 3 s")


def test_an_autopilot_that_does_not_get_ready_is_a_lost_link_that_says_what_it_lacks() -> None:
    summary, vehicle = mission(SHORT, 3, patience=Patience(ready_s=8.0))
    assert summary["reason"] == "link_lost"
    assert "not ready within 8 s: it waits for a position (estimator flags 167)" in summary["detail"]
    assert not vehicle.rover.armed


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_nine_of_ten_rock_fields_of_20_m_are_crossed() -> None:
    scenario = load_scenario("rock-field")
    reasons = [mission(scenario, seed)[0]["reason"] for seed in range(10)]
    assert reasons.count("goal") >= 9, reasons
