"""The MAVSDK client against each persona, over UDP on the loopback, in wall-clock time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.persona import PERSONAS
from tests.mavlink_live import LiveRover, connected_pair, place


@pytest.fixture(scope="module", params=PERSONAS)
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[LiveRover, Any, str]]:
    """A live rover of each persona, and MAVSDK's view of it."""
    with connected_pair(PERSONAS[request.param]) as (live, system):
        yield live, system, request.param


def test_it_is_known_for_what_it_is(pair: tuple[LiveRover, Any, str]) -> None:
    from mavsdk.plugins.info import Info
    from mavsdk.plugins.telemetry import Telemetry

    live, system, persona = pair
    info, telemetry = Info(system), Telemetry(system)
    live.until(telemetry.health_all_ok, 5.0)
    version = info.get_version()
    assert (version.flight_sw_major, version.flight_sw_minor) == ((1, 15) if persona == "px4" else (0, 1))
    assert abs(telemetry.position().latitude_deg - place(live, live.rover.x_m, live.rover.y_m).latitude_deg) < 1e-6
    info.destroy()
    telemetry.destroy()


def test_a_mission_goes_up_and_down_and_is_driven(pair: tuple[LiveRover, Any, str]) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan

    live, system, _ = pair
    action, mission = Action(system), Mission(system)
    points = [place(live, live.rover.x_m + ahead, live.rover.y_m) for ahead in (0.6, 1.2)]
    items = [
        MissionItem(
            point.latitude_deg,
            point.longitude_deg,
            0.0,
            speed_m_s=0.9,
            is_fly_through=True,
            acceptance_radius_m=0.3,
        )
        for point in points
    ]
    mission.upload_mission(MissionPlan(items))
    back = mission.download_mission().mission_items
    assert [item.latitude_deg for item in back] == pytest.approx([item.latitude_deg for item in items], abs=1e-7)
    action.arm()
    mission.start_mission()
    live.until(lambda: live.autopilot.auto.state is MissionState.ACTIVE)
    mission.pause_mission()
    live.until(lambda: live.autopilot.mode is Mode.HOLD and live.autopilot.auto.state is MissionState.PAUSED)
    mission.start_mission()
    live.until(mission.is_mission_finished)
    progress = mission.mission_progress()
    assert (progress.current, progress.total) == (2, 2)
    mission.start_mission()  # a finished one begins anew
    live.until(lambda: live.autopilot.auto.state is MissionState.ACTIVE)
    mission.clear_mission()
    live.until(lambda: live.autopilot.auto.state is MissionState.NO_MISSION)
    mission.destroy()
    action.destroy()


def test_goto_hold_return_and_disarm(pair: tuple[LiveRover, Any, str]) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.telemetry import FlightMode, Telemetry

    live, system, persona = pair
    action, telemetry = Action(system), Telemetry(system)
    action.arm()
    target = place(live, live.rover.x_m + 5.0, live.rover.y_m)
    action.goto_location(target.latitude_deg, target.longitude_deg, target.altitude_m, math.nan)
    live.until(lambda: live.autopilot.mode is Mode.GUIDED and live.autopilot.motion.linear_m_s > 0.1)
    live.until(lambda: telemetry.flight_mode() == (FlightMode.HOLD if persona != "ardupilot" else FlightMode.OFFBOARD))
    action.hold()
    live.until(lambda: live.autopilot.mode is Mode.HOLD)
    action.return_to_launch()
    live.until(lambda: live.autopilot.mode is Mode.RETURN)
    live.until(lambda: telemetry.flight_mode() == FlightMode.RETURN_TO_LAUNCH)
    action.hold()
    action.disarm()
    live.until(lambda: not live.autopilot.armed)
    action.destroy()
    telemetry.destroy()


def test_parameters_keep_their_types(pair: tuple[LiveRover, Any, str]) -> None:
    from mavsdk.plugins.param import Param

    live, system, _ = pair
    param = Param(system)
    assert param.get_param_float("WP_RADIUS") == pytest.approx(0.25)
    param.set_param_float("WP_RADIUS", 0.4)
    assert live.autopilot.parameters["WP_RADIUS"] == pytest.approx(0.4)
    param.set_param_float("WP_RADIUS", 0.25)
    for value in (0, 1):
        param.set_param_int("FS_SLIP_ENABLE", value)
        assert live.autopilot.parameters["FS_SLIP_ENABLE"] == value
        assert param.get_param_int("FS_SLIP_ENABLE") == value
    param.destroy()
