"""QGroundControl's connection and guided actions replayed against each persona: answered, in time, without a pop-up."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.persona import ARDUPILOT, PERSONAS, PX4, Persona
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_live import LiveRover
from tests.mavlink_rig import Station, Yard
from tests.qgc_connect import needs_setup
from tests.qgc_replay import Qgc
from tests.qgc_station import Script

READY_S = 1.0
STEPS_A_TICK = 5  # links are served at 240 Hz, as `serve` does; the autopilot at 48


class Seat(Station):
    """A link whose frames go to the replayed station."""

    station: Qgc

    def listen(self, time_s: float) -> None:
        for _, data in self.end.receive(time_s):
            self.station.hear(data)


class Desk:
    """QGroundControl and the yard on one clock."""

    def __init__(self, persona: Persona) -> None:
        self.seat = Seat()
        self.seat.station = self.qgc = Qgc(persona, lambda frame: self.seat.send_bytes(frame, self.qgc.time_s))
        self.yard = Yard(self.seat, persona=persona)

    def run(self, script: Script, limit_s: float = 120.0) -> object:
        """The result of an action."""
        end_s = self.yard.time_s + limit_s
        for _ in self._moments():
            try:
                next(script)
            except StopIteration as done:
                return done.value
            assert self.yard.time_s < end_s
        raise AssertionError

    def pass_time(self, seconds: float) -> None:
        end_s = self.yard.time_s + seconds
        for time_s in self._moments():
            if time_s >= end_s:
                return

    def _moments(self) -> Iterator[float]:
        while True:
            start_s = self.yard.time_s
            self.yard.step()
            for part in range(STEPS_A_TICK):
                time_s = start_s + part / (STEPS_A_TICK * 48.0)
                if part:
                    self.yard.vehicle.answer(time_s)
                    self.seat.listen(time_s)
                self.qgc.look(time_s)
                yield time_s


def desk_with_mission(persona: Persona) -> Desk:
    desk = Desk(persona)
    desk.run(desk.qgc.connect())
    items = [WireItem(3, 16, (0.0, 0.3, 0.0, 0.0), *_place(desk, x_m), 0.0) for x_m in (2.0, 4.0)]
    station = Station()
    missions = desk.yard.vehicle.store
    missions.replace([WireItem(0, 16, (0.0,) * 4, *_place(desk, 0.0), 0.0), *items] if persona.home_first else items)
    assert station.heard == []
    return desk


def _place(desk: Desk, x_m: float) -> tuple[int, int]:
    place = desk.yard.frame.to_geo((x_m, 0.0, 0.0))
    return place.latitude_e7, place.longitude_e7


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_it_is_ready_within_a_second_without_a_retry_or_a_pop_up(persona: Persona) -> None:
    desk = Desk(persona)
    start_s = desk.yard.time_s
    desk.run(desk.qgc.connect())
    assert desk.yard.time_s - start_s <= READY_S
    assert (desk.qgc.retries, desk.qgc.complaints) == ([], [])
    names = [step.name for step in desk.qgc.steps]
    assert names[:6] == ["streams", "version", "modes", "component information", "parameters", "mission"]
    assert {name: desk.yard.autopilot.parameters[name] for name in desk.qgc.parameters} == pytest.approx(
        desk.qgc.parameters
    )
    assert len(desk.qgc.parameters) == len(desk.yard.autopilot.parameters.names)
    if persona is ARDUPILOT:
        assert needs_setup(desk.qgc.parameters) == []


def test_a_checksum_that_the_station_knows_is_taken_as_the_end_of_the_parameters() -> None:
    desk = Desk(PX4)
    desk.qgc.send(mavlink.MAVLink_param_set_message(1, 1, b"_HASH_CHECK", 1.0, mavlink.MAV_PARAM_TYPE_UINT32))
    desk.pass_time(0.5)
    assert "PARAM_ERROR" not in {message.get_type() for message in desk.qgc._heard}


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_it_connects_while_the_rover_drives(persona: Persona) -> None:
    desk = desk_with_mission(persona)
    desk.yard.autopilot.arm()
    desk.yard.autopilot.start_mission()
    desk.qgc.steps.clear()
    start_s = desk.yard.time_s
    desk.run(desk.qgc.connect())
    assert desk.yard.time_s - start_s <= READY_S
    assert (desk.qgc.retries, desk.qgc.complaints) == ([], [])


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_start_pause_return_emergency_stop(persona: Persona) -> None:
    desk = desk_with_mission(persona)
    qgc, autopilot = desk.qgc, desk.yard.autopilot
    desk.run(qgc.start_mission())
    desk.pass_time(0.5)
    assert (autopilot.mode, autopilot.auto.state) == (Mode.AUTO, MissionState.ACTIVE)
    assert qgc.flying
    if persona is PX4:  # its pause is "go to nowhere"; an ArduRover's users choose Hold
        nowhere = (-1.0, 1.0, *(float("nan"),) * 5)
        assert desk.run(qgc.command(mavlink.MAV_CMD_DO_REPOSITION, *nowhere)) == 0
    else:
        desk.run(qgc.set_mode(persona.numbers[Mode.HOLD]))
    assert (autopilot.mode, autopilot.auto.state) == (Mode.HOLD, MissionState.PAUSED)
    desk.run(qgc.set_mode(persona.numbers[Mode.AUTO]))  # continue
    desk.run(qgc.command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 1.0))
    assert autopilot.auto.current == 1
    desk.run(qgc.set_mode(persona.numbers[Mode.RETURN]))
    assert autopilot.mode is Mode.RETURN
    desk.run(qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, 21196.0))
    desk.pass_time(0.1)
    assert not qgc.armed
    assert (qgc.retries, qgc.complaints) == ([], [])


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_go_to_the_first_time_and_again(persona: Persona) -> None:
    """The first one reaches an ArduPilot as a command, a mode and a mission item at once (trap 3)."""
    desk = desk_with_mission(persona)
    qgc, autopilot = desk.qgc, desk.yard.autopilot
    desk.run(qgc.arm())
    for x_m, first in ((1.5, True), (-1.0, False)):
        desk.run(qgc.go_to(*_place(desk, x_m), first=first))
        assert autopilot.has_guided_task
        desk.pass_time(14.0)
        assert desk.yard.rover.x_m == pytest.approx(x_m, abs=0.26)
    assert (qgc.retries, qgc.complaints) == ([], [])


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_flying_changes_once_a_drive_and_never_flickers(persona: Persona) -> None:
    """Its buttons follow it: two sources that disagree would make them flicker (trap 1)."""
    desk = desk_with_mission(persona)
    desk.yard.autopilot.arm()
    desk.yard.autopilot.start_mission()
    desk.qgc.flying_changes = 0
    desk.pass_time(5.0)
    assert (desk.qgc.flying, desk.qgc.flying_changes) == (True, 1)
    desk.yard.autopilot.disarm()
    desk.pass_time(3.0)
    assert (desk.qgc.flying, desk.qgc.flying_changes) == (False, 2)


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_modes_and_arming_are_proved_long_before_its_time_outs(persona: Persona) -> None:
    """It believes a heartbeat only, and waits 1.3 s for one: a change is told at once (trap 2)."""
    desk = desk_with_mission(persona)
    qgc = desk.qgc
    for mode in (Mode.MANUAL, Mode.HOLD):
        start_s = desk.yard.time_s
        assert desk.run(qgc.set_mode(persona.numbers[mode]))
        assert desk.yard.time_s - start_s <= 0.05
    start_s = desk.yard.time_s
    desk.run(qgc.arm())
    assert desk.yard.time_s - start_s <= 0.05
    assert (qgc.retries, qgc.complaints) == ([], [])


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_home_and_clearing(persona: Persona) -> None:
    """Set Home needs its terrain server, so offline it sends nothing (trap 5); a station that knows the height does."""
    desk = desk_with_mission(persona)
    place = desk.yard.frame.to_geo((1.0, 2.0, 0.0))
    home = (0.0, 0.0, 0.0, 0.0, place.latitude_deg, place.longitude_deg, place.altitude_m)
    assert desk.run(desk.qgc.command(mavlink.MAV_CMD_DO_SET_HOME, *home)) == 0
    assert desk.yard.autopilot.home_w[:2] == pytest.approx((1.0, 2.0), abs=0.7)  # a float of degrees is 0.4 m coarse
    for kind in (0, 1, 2):
        desk.qgc.send(mavlink.MAVLink_mission_clear_all_message(1, 1, kind))
        desk.pass_time(0.1)
    assert desk.yard.autopilot.auto.state is MissionState.NO_MISSION
    desk.run(desk.qgc.download(0))
    assert (desk.qgc.retries, desk.qgc.complaints) == ([], [])


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_over_the_loopback(persona: Persona) -> None:
    """In wall-clock time, with the station's own patience; the figure is that of `benchmarks/link_latency.py`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(0.005)
        live = LiveRover(f"udpout:127.0.0.1:{station.getsockname()[1]}", persona)
        live.start()
        assert select.select([station], [], [], 20.0)[0]
        station.connect(station.recvfrom(65536)[1])
        qgc = Qgc(persona, station.sendall)
        script = qgc.connect()
        while True:
            with suppress(TimeoutError):
                qgc.hear(station.recv(65536))
            qgc.look(time.perf_counter())
            try:
                next(script)
            except StopIteration:
                break
        live.close()
    assert (qgc.retries, qgc.complaints) == ([], [])
    assert len(qgc.parameters) == len(live.autopilot.parameters.names)
