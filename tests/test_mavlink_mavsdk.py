"""The MAVSDK client against the vehicle, over UDP on the loopback: the one test in wall-clock time."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.geodesy import GeoPoint
from rover_sim.mavlink.mission_file import write_plan, write_waypoints
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.stack import MavlinkStack
from rover_sim.mavlink.transport import parse_url
from rover_sim.mavlink.udp import UdpIn
from tests.mavlink_rig import FOOTPRINT, KinematicRover
from worlds.scenario import Origin

HOME = (0.0, 0.0, 0.0)
STEP_S = 1.0 / 48.0


def mavsdk_library() -> Any:
    try:
        import mavsdk
    except (ImportError, OSError) as error:  # the wheel brings a compiled library
        pytest.skip(f"the MAVSDK library cannot be loaded here: {error}")
    return mavsdk


class LiveRover:
    """Rover, autopilot and MAVLink stack, ticked by a thread of its own at wall-clock speed."""

    def __init__(self, url: str) -> None:
        self.rover = KinematicRover()
        self.autopilot = Autopilot(FOOTPRINT, HOME)
        self.stack = MavlinkStack(Origin(), self.autopilot, [url])
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def _run(self) -> None:
        start = time.perf_counter()
        while not self._stop.is_set():
            with self._lock:
                wheels = self.autopilot.update(self.rover.time_s, self.rover.estimate(), self.rover.readings())
                self.stack.tick(self.rover.time_s, self.rover.estimate(), self.rover.readings())
                self.rover.move(wheels, STEP_S)
            self._stop.wait(max(start + self.rover.time_s - time.perf_counter(), 0.0))

    def locked(self, action: Callable[[], Any]) -> Any:
        with self._lock:
            return action()

    def until(self, done: Callable[[], bool], limit_s: float = 8.0) -> None:
        end = time.perf_counter() + limit_s
        while not self.locked(done):
            assert time.perf_counter() < end, "time limit"
            self._stop.wait(0.01)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.stack.close()


@pytest.fixture(scope="module")
def pair() -> Iterator[tuple[LiveRover, Any]]:
    """A live rover and MAVSDK's view of it."""
    library = mavsdk_library()
    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    port = free.port
    free.close()
    live = LiveRover(f"udpout:127.0.0.1:{port}")
    kind = library.ComponentType.GROUND_STATION
    client = library.Mavsdk(library.Configuration.create_with_component_type(kind))
    assert client.add_any_connection(f"udpin://127.0.0.1:{port}") == library.ConnectionResult.SUCCESS
    live.start()
    system = client.first_autopilot(5.0)
    assert system is not None, "MAVSDK found no autopilot"
    yield live, system
    client.destroy()
    live.close()


def place(live: LiveRover, x_m: float, y_m: float) -> GeoPoint:
    return live.stack.frame.to_geo((x_m, y_m, 0.0))


def test_the_companions_mission_is_downloaded_by_mavsdk(pair: tuple[LiveRover, Any]) -> None:
    from mavsdk.plugins.mission_raw import MissionRaw

    live, system = pair
    items = mission_items([(3.0, 0.0, 0.0), (4.0, 1.0, 0.0)], live.stack.frame, HOME)
    upload = live.locked(lambda: live.stack.companion.upload(items, live.rover.time_s))
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
    items = mission_items([(3.0, 0.0, 0.0)], live.stack.frame, HOME)
    upload = live.locked(lambda: live.stack.companion.upload(items, live.rover.time_s))
    live.until(lambda: upload.state == "done")
    raw.clear_mission()
    live.until(lambda: live.autopilot.auto.state is MissionState.NO_MISSION)
    assert raw.download_mission() == []
    for plugin in (param, raw, action):
        plugin.destroy()


def test_our_files_are_read_by_mavsdks_importers(pair: tuple[LiveRover, Any], tmp_path: Path) -> None:
    from mavsdk.plugins.mission_raw import MissionRaw

    live, system = pair
    items = mission_items([(3.0, 0.0, 0.0), (4.0, 1.0, 0.0)], live.stack.frame, HOME, speed_m_s=0.5)
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
    heading = telemetry.attitude_euler().yaw_deg
    assert heading == pytest.approx(90.0 - math.degrees(live.rover.yaw_rad), abs=2.0)
    telemetry.destroy()
