"""The MAVSDK client against the vehicle and its companion, over UDP on the loopback, in wall-clock time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.mission_file import write_plan, write_waypoints
from rover_sim.mavlink.persona import ARDUPILOT
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.tlog import SIMULATED_EPOCH_S
from tests.mavlink_live import HOME, LiveRover, connected_pair, place


@pytest.fixture(scope="module")
def pair() -> Iterator[tuple[LiveRover, Any]]:
    """A live rover and MAVSDK's view of it."""
    with connected_pair(ARDUPILOT) as both:
        yield both


def test_the_companions_mission_is_downloaded_by_mavsdk(pair: tuple[LiveRover, Any]) -> None:
    from mavsdk.plugins.mission_raw import MissionRaw

    live, system = pair
    items = mission_items([(3.0, 0.0, 0.0), (4.0, 1.0, 0.0)], live.frame, HOME)
    upload = live.locked(lambda: live.companion.upload(items, live.rover.time_s))
    live.until(lambda: upload.state == "done")
    raw = MissionRaw(system)
    back = raw.download_mission()
    assert [(item.command, item.frame, item.x, item.y) for item in back] == [
        (item.command, item.frame, item.x, item.y) for item in items
    ]
    raw.destroy()


def test_mavsdk_uploads_arms_starts_and_follows_to_the_end(pair: tuple[LiveRover, Any]) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan

    live, system = pair
    action, mission = Action(system), Mission(system)
    points = [place(live, 0.8, 0.0), place(live, 1.5, 0.2)]
    plan = MissionPlan(
        [
            MissionItem(
                point.latitude_deg,
                point.longitude_deg,
                0.0,
                speed_m_s=0.9,
                is_fly_through=True,
                acceptance_radius_m=0.3,  # MAVSDK's own is 3 m
            )
            for point in points
        ]
    )
    mission.upload_mission(plan)
    assert len(mission.download_mission().mission_items) == 2
    action.arm()
    mission.start_mission()
    live.until(lambda: live.autopilot.mode is Mode.AUTO and live.autopilot.auto.state is MissionState.ACTIVE)
    mission.pause_mission()
    live.until(lambda: live.autopilot.auto.state is MissionState.PAUSED)
    mission.start_mission()
    live.until(lambda: live.autopilot.auto.state is MissionState.COMPLETE)
    assert math.hypot(live.rover.x_m - 1.5, live.rover.y_m - 0.2) < 0.4
    live.until(mission.is_mission_finished, 3.0)
    progress = mission.mission_progress()
    assert (progress.current, progress.total) == (2, 2)
    mission.clear_mission()
    live.until(lambda: live.autopilot.auto.state is MissionState.NO_MISSION)
    mission.destroy()
    action.destroy()


def test_goto_hold_disarm_parameters_and_clearing(pair: tuple[LiveRover, Any]) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.mission_raw import MissionRaw
    from mavsdk.plugins.param import Param

    live, system = pair
    action, raw, param = Action(system), MissionRaw(system), Param(system)
    assert param.get_param_float("WP_RADIUS") == pytest.approx(0.25)
    param.set_param_float("WP_RADIUS", 0.4)
    assert live.autopilot.parameters["WP_RADIUS"] == pytest.approx(0.4)
    param.set_param_int("FS_SLIP_ENABLE", 0)
    assert live.autopilot.parameters["FS_SLIP_ENABLE"] == 0.0
    action.arm()
    target = place(live, live.rover.x_m + 5.0, live.rover.y_m)
    action.goto_location(target.latitude_deg, target.longitude_deg, target.altitude_m, math.nan)
    live.until(lambda: live.autopilot.mode is Mode.GUIDED and live.autopilot.motion.linear_m_s > 0.1)
    action.hold()
    live.until(lambda: live.autopilot.mode is Mode.HOLD)
    action.disarm()
    live.until(lambda: not live.autopilot.armed)
    items = mission_items([(3.0, 0.0, 0.0)], live.frame, HOME)
    upload = live.locked(lambda: live.companion.upload(items, live.rover.time_s))
    live.until(lambda: upload.state == "done")
    raw.clear_mission()
    live.until(lambda: live.autopilot.auto.state is MissionState.NO_MISSION)
    assert raw.download_mission() == []
    for plugin in (param, raw, action):
        plugin.destroy()


def test_our_files_are_read_by_mavsdks_importers(pair: tuple[LiveRover, Any], tmp_path: Path) -> None:
    from mavsdk.plugins.mission_raw import MissionRaw

    live, system = pair
    items = mission_items([(3.0, 0.0, 0.0), (4.0, 1.0, 0.0)], live.frame, HOME, speed_m_s=0.5)
    write_plan(tmp_path / "mission.plan", items, 0.6)
    write_waypoints(tmp_path / "mission.waypoints", items)
    raw = MissionRaw(system)
    plan = raw.import_qgroundcontrol_mission(str(tmp_path / "mission.plan")).mission_items
    waypoints = raw.import_mission_planner_mission(str(tmp_path / "mission.waypoints")).mission_items
    # This importer puts another home before that of the file, for files of Mission Planner too.
    for back in (plan, waypoints[1:]):
        assert [(item.command, item.x, item.y) for item in back] == [(item.command, item.x, item.y) for item in items]
    raw.destroy()


def test_telemetry_arrives(pair: tuple[LiveRover, Any]) -> None:
    from mavsdk.plugins.telemetry import Telemetry

    live, system = pair
    telemetry = Telemetry(system)
    here = place(live, live.rover.x_m, live.rover.y_m)
    live.until(lambda: abs(telemetry.position().latitude_deg - here.latitude_deg) < 1e-6, 3.0)
    live.until(lambda: abs(telemetry.home().latitude_deg - 38.4064) < 1e-6, 3.0)
    live.until(lambda: telemetry.unix_epoch_time() >= SIMULATED_EPOCH_S * 1e6, 3.0)
    heading = telemetry.attitude_euler().yaw_deg
    assert heading == pytest.approx(90.0 - math.degrees(live.rover.yaw_rad), abs=2.0)
    telemetry.destroy()
