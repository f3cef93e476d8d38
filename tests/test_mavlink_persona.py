"""What differs between the personas on the wire."""

from __future__ import annotations

import math

import pytest

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.persona import ARDUPILOT, GENERIC, PERSONAS, PX4, Persona
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_rig import Station, Yard

PX4_HOLD, PX4_MISSION, PX4_RETURN, PX4_OFFBOARD, PX4_MANUAL = 0x03040000, 0x04040000, 0x05040000, 0x60000, 0x10000


def yard_of(persona: Persona) -> tuple[Yard, Station]:
    station = Station()
    return Yard(station, persona=persona), station


def command(number: int, *parameters: float) -> Message:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *parameters, *(0.0,) * (7 - len(parameters)))


def result(yard: Yard, station: Station, message: Message) -> int:
    (answer,) = yard.ask(station, message, "COMMAND_ACK")
    return int(answer.result)


@pytest.mark.parametrize(
    ("persona", "autopilot", "bits"), [(ARDUPILOT, 3, 0x2E1AC), (PX4, 12, 0xE1BC), (GENERIC, 0, 0xE1BC)]
)
def test_identity(persona: Persona, autopilot: int, bits: int) -> None:
    yard, station = yard_of(persona)
    (beat,) = station.take("HEARTBEAT")
    assert (beat.type, beat.autopilot, beat.system_status) == (10, autopilot, 3)
    (version,) = yard.ask(station, command(512, 148), "AUTOPILOT_VERSION")
    assert version.capabilities == bits
    assert version.flight_sw_version & 0xFF == 0  # DEV


@pytest.mark.parametrize("persona", [PX4, GENERIC])
def test_px4_mode_numbers(persona: Persona) -> None:
    yard, station = yard_of(persona)
    assert station.take("HEARTBEAT")[-1].custom_mode == PX4_HOLD
    assert result(yard, station, command(400, 1.0)) == 0
    for main, sub, number, mode in (
        (4.0, 5.0, PX4_RETURN, Mode.RETURN),
        (6.0, 0.0, PX4_OFFBOARD, Mode.GUIDED),
        (1.0, math.nan, PX4_MANUAL, Mode.MANUAL),
        (4.0, 3.0, PX4_HOLD, Mode.HOLD),
    ):
        assert result(yard, station, command(176, 129.0, main, sub)) == 0
        assert yard.autopilot.mode is mode
        assert station.take("HEARTBEAT")[-1].custom_mode == number
    for main, sub in ((4.0, 0.0), (10.0, 0.0), (4.5, 3.0), (math.nan, 0.0), (7.0, 0.0)):
        assert result(yard, station, command(176, 1.0, main, sub)) == 3
    (answer,) = yard.ask(station, mavlink.MAVLink_set_mode_message(1, 1, PX4_RETURN), "COMMAND_ACK")
    assert (answer.command, answer.result, yard.autopilot.mode) == (11, 0, Mode.RETURN)


@pytest.mark.parametrize("main", [2.0, 3.0])
def test_px4s_other_modes_for_sticks_are_manual(main: float) -> None:
    yard, station = yard_of(PX4)
    assert result(yard, station, command(176, 1.0, main, 0.0)) == 0
    assert yard.autopilot.mode is Mode.MANUAL
    assert station.take("HEARTBEAT")[-1].custom_mode == PX4_MANUAL


def test_ardupilot_refuses_px4_numbers() -> None:
    yard, station = yard_of(ARDUPILOT)
    assert result(yard, station, command(176, 1.0, 6.0)) == 3  # Follow: not there
    (answer,) = yard.ask(station, mavlink.MAVLink_set_mode_message(1, 1, PX4_HOLD), "COMMAND_ACK")
    assert answer.result == 4


def test_a_px4_drives_to_a_place_in_hold_and_pauses_by_a_place_that_is_none() -> None:
    yard, station = yard_of(PX4)
    yard.autopilot.arm()
    goto = mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, math.nan, 384064000, -1107918300, math.nan)
    assert result(yard, station, goto) == 0
    assert yard.autopilot.has_guided_task
    assert station.take("HEARTBEAT")[-1].custom_mode == PX4_HOLD
    nothing = (math.nan,) * 4
    assert result(yard, station, command(192, -1.0, 1.0, 0.0, *nothing)) == 0
    assert yard.autopilot.mode is Mode.HOLD


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_item_0(persona: Persona) -> None:
    """A waypoint in the absolute frame is home to an ArduPilot and the first place to drive to for the others."""
    yard, station = yard_of(persona)
    item = WireItem(0, 16, (0.0,) * 4, 384064000, -1107919000, 0.0)
    yard.ask(station, mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
    for seq in (0, 1):
        yard.ask(station, item.message(1, 1, seq))
    (ack,) = station.take("MISSION_ACK")
    assert ack.type == 0
    assert yard.autopilot.auto.current == (1 if persona is ARDUPILOT else 0)
    assert station.take("MISSION_CURRENT")[-1].total == (1 if persona is ARDUPILOT else 2)


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_home_can_be_read_without_a_mission_only_from_an_ardupilot(persona: Persona) -> None:
    yard, station = yard_of(persona)
    request = mavlink.MAVLink_mission_request_int_message(1, 1, 0)
    (answer,) = yard.ask(station, request, "MISSION_ITEM_INT", "MISSION_ACK")
    assert answer.get_type() == ("MISSION_ITEM_INT" if persona is ARDUPILOT else "MISSION_ACK")


def test_whole_numbers_travel_as_bytes_or_as_floats() -> None:
    for persona, wire in ((ARDUPILOT, 1.0), (PX4, 1e-45), (GENERIC, 1e-45)):  # 1e-45: the float whose bytes are 1
        yard, station = yard_of(persona)
        read = mavlink.MAVLink_param_request_read_message(1, 1, b"FS_SLIP_ENABLE", -1)
        (value,) = yard.ask(station, read, "PARAM_VALUE")
        assert (value.param_value, value.param_type) == (pytest.approx(wire, rel=0.5), 6)
        put = mavlink.MAVLink_param_set_message(1, 1, b"FS_SLIP_ENABLE", 0.0, 6)
        yard.ask(station, put)
        assert yard.autopilot.parameters["FS_SLIP_ENABLE"] == 0.0
        back = mavlink.MAVLink_param_set_message(1, 1, b"FS_SLIP_ENABLE", value.param_value, 6)
        yard.ask(station, back)
        assert yard.autopilot.parameters["FS_SLIP_ENABLE"] == 1.0


def test_a_whole_number_sent_as_a_float_is_refused_where_bytes_count() -> None:
    yard, station = yard_of(PX4)
    put = mavlink.MAVLink_param_set_message(1, 1, b"FS_SLIP_ENABLE", 0.0, 9)
    assert yard.ask(station, put, "PARAM_ERROR")
    assert yard.autopilot.parameters["FS_SLIP_ENABLE"] == 1.0


@pytest.mark.parametrize(("persona", "at_rest", "driving"), [(ARDUPILOT, 0, 0), (PX4, 1, 2), (GENERIC, 1, 2)])
def test_flying_is_told_once(persona: Persona, at_rest: int, driving: int) -> None:
    yard, station = yard_of(persona)
    (state,) = yard.ask(station, command(512, 245), "EXTENDED_SYS_STATE")
    assert state.landed_state == at_rest
    yard.autopilot.arm()
    yard.autopilot.goto((5.0, 0.0, 0.0))
    yard.step()  # the change is told at once, to whom it says anything
    assert len(station.take("EXTENDED_SYS_STATE")) == (0 if persona is ARDUPILOT else 1)
    (state,) = yard.ask(station, command(512, 245), "EXTENDED_SYS_STATE")
    assert state.landed_state == driving
