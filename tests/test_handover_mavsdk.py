"""A handover to MAVSDK's server plugins: a vehicle that shares no code with ours, over UDP on the loopback."""

from __future__ import annotations

import ctypes
import json
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rover_sim.cli import main
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.mission_file import read_plan, write_plan
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.transport import parse_url
from rover_sim.mavlink.udp import UdpIn
from tests.mavlink_live import mavsdk_library
from worlds.scenario import Origin


class MavsdkVehicle:
    """A ground rover of no known autopilot; it reaches an item as often as `live` comes round in mode Mission."""

    def __init__(self, port: int) -> None:
        library = mavsdk_library()
        from mavsdk.plugins.action_server import ActionServer, AllowableFlightModes, FlightMode
        from mavsdk.plugins.mission_raw_server import MissionRawServer
        from mavsdk.plugins.telemetry_server import Heading, Position, TelemetryServer, VelocityNed

        kind = library.ComponentType.AUTOPILOT
        configuration = library.Configuration.create_with_component_type(kind)
        # The Python binding leaves this one out.
        handle, rover = ctypes.c_void_p(configuration._handle), ctypes.c_uint8(mavlink.MAV_TYPE_GROUND_ROVER)
        configuration._lib.mavsdk_configuration_set_mav_type(handle, rover)
        self._library = library.Mavsdk(configuration)
        component = self._library.server_component()
        self.action = ActionServer(component)
        self.telemetry = TelemetryServer(component)
        self.mission = MissionRawServer(component)
        self.missions: queue.Queue[Any] = queue.Queue()
        self.mission.subscribe_incoming_mission(lambda _result, plan, *_: self.missions.put(plan))
        self.armed = self.driving = False
        self._flight_mode = FlightMode
        self.action.subscribe_arm_disarm(self._on_arm)
        self.action.subscribe_flight_mode_change(self._on_mode)
        self.action.set_armable(armable=True, force_armable=True)
        self.action.set_allowable_flight_modes(AllowableFlightModes(True, True, True, True, True, True, True))
        self.action.set_flight_mode(FlightMode.HOLD)
        place = Origin()
        self._position = Position(place.latitude_deg, place.longitude_deg, place.altitude_m, 0.0)
        self._still, self._heading = VelocityNed(0.0, 0.0, 0.0), Heading(0.0)
        assert self._library.add_any_connection(f"udpin://127.0.0.1:{port}") == library.ConnectionResult.SUCCESS
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()

    def _on_arm(self, _result: Any, wish: Any, *_: Any) -> None:
        self.armed = bool(wish.arm)

    def _on_mode(self, _result: Any, mode: Any, *_: Any) -> None:
        self.driving = int(mode) == self._flight_mode.MISSION

    def _live(self) -> None:
        while not self._stop.wait(0.3):
            self.telemetry.publish_position(self._position, self._still, self._heading)
            if self.driving:
                self.mission.set_current_item_complete()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._library.destroy()


@contextmanager
def vehicle() -> Iterator[tuple[MavsdkVehicle, str]]:
    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    port = free.port
    free.close()
    served = MavsdkVehicle(port)
    try:
        yield served, f"udpout:127.0.0.1:{port}"
    finally:
        served.close()


@pytest.mark.parametrize("start", [False, True])
def test_a_mission_goes_up_is_read_back_and_started_where_that_is_asked(start: bool, tmp_path: Path) -> None:
    plan, out = tmp_path / "mission.plan", tmp_path / "out"
    items = mission_items([(2.0, 0.0, 0.0), (4.0, 1.0, 0.0)], LocalFrame(Origin()), (0.0, 0.0, 0.0), 0.6)
    write_plan(plan, items, 0.6)
    with vehicle() as (served, url):
        command = ["handover", "--mission", str(plan), "--autopilot", url, "--out", str(out), "--limit", "20"]
        code = main([*command, "--arm-and-start"] if start else command)
        stored = served.missions.get(timeout=5.0).mission_items
        sent = read_plan(plan)[1:]
        assert [(item.command, item.x, item.y) for item in stored] == [(item.command, item.x, item.y) for item in sent]
        assert served.armed is start
    table = json.loads((out / "summary.json").read_text())
    assert (code, table["reason"]) == (0, "complete" if start else "uploaded"), table
