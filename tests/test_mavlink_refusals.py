"""Numbers that are none and places on another continent: refused with the protocol's own code, and nothing happens."""

from __future__ import annotations

import math

import pytest

from rover_sim.mavlink.commands import ACTIONS
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.persona import PERSONAS
from tests.mavlink_rig import Station, Yard

NAN, INF = math.nan, math.inf
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
HERE = (38.4064, -110.7919)
PARIS = (48.8566, 2.3522)


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture(params=PERSONAS)
def yard(request: pytest.FixtureRequest, station: Station) -> Yard:
    made = Yard(station, persona=PERSONAS[request.param])
    made.step(1.0)
    made.autopilot.arm(force=True)
    return made


def long(number: int, *values: float) -> Message:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *values, *(0.0,) * (7 - len(values)))


def result(yard: Yard, station: Station, message: Message) -> int:
    (ack,) = yard.ask(station, message, "COMMAND_ACK")
    return int(ack.result)


def state(yard: Yard) -> tuple[object, ...]:
    autopilot = yard.autopilot
    names = autopilot.parameters.names
    return (autopilot.mode, autopilot.armed, autopilot.home_w, tuple(autopilot.parameters[name] for name in names))


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
def test_commands_of_nothing_but_such_numbers_do_nothing(yard: Yard, station: Station, bad: float) -> None:
    told = {mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, mavlink.MAV_CMD_GET_HOME_POSITION}  # take no numbers
    told |= {mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, mavlink.MAV_CMD_RUN_PREARM_CHECKS}
    pauses = {mavlink.MAV_CMD_DO_REPOSITION} if yard.vehicle._context.persona.px4_modes and math.isnan(bad) else set()
    for number in sorted(set(ACTIONS) - told - pauses - {mavlink.MAV_CMD_MISSION_START}):
        before = state(yard)
        assert result(yard, station, long(number, *(bad,) * 7)) in (DENIED, UNSUPPORTED, FAILED), number
        assert state(yard) == before, number


@pytest.mark.parametrize(
    "place", [PARIS, (NAN, HERE[1]), (HERE[0], NAN), (INF, -INF), (91.0, 0.0), (0.0, 181.0), (1e30, 1e30)]
)
def test_no_place_on_another_continent(yard: Yard, station: Station, place: tuple[float, float]) -> None:
    before = state(yard)
    for number in (mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_SET_HOME):
        assert result(yard, station, long(number, 0.0, 0.0, 0.0, 0.0, *place, 0.0)) == DENIED
    assert state(yard) == before
    assert result(yard, station, long(mavlink.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, NAN, *HERE, NAN)) == ACCEPTED


@pytest.mark.parametrize(
    ("kind", "command", "first"), [(0, 16, 0.0), (0, 19, 0.0), (1, 5003, 5.0), (1, 5000, 0.0), (2, 5100, 0.0)]
)
def test_no_item_on_another_continent(yard: Yard, station: Station, kind: int, command: int, first: float) -> None:
    x, y = (round(degrees * 1e7) for degrees in PARIS)
    for frame in (3, 6):
        (asked,) = yard.ask(station, mavlink.MAVLink_mission_count_message(1, 1, 1, kind), "MISSION_REQUEST_INT")
        assert asked.seq == 0
        item = mavlink.MAVLink_mission_item_int_message(1, 1, 0, frame, command, 0, 1, first, 0, 0, 0, x, y, 0, kind)
        (ack,) = yard.ask(station, item, "MISSION_ACK")
        assert (ack.type, ack.mission_type) == (mavlink.MAV_MISSION_INVALID, kind)
    item = mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, x, y, 0, 0
    )  # the older "go there"
    assert [ack.type for ack in yard.ask(station, item, "MISSION_ACK")] == [mavlink.MAV_MISSION_INVALID]


@pytest.mark.parametrize("bad", [NAN, INF, -INF, 1e30])
def test_no_parameter_takes_such_a_number(yard: Yard, station: Station, bad: float) -> None:
    before = state(yard)
    for name in ("WP_RADIUS", "CRUISE_SPEED", "FS_SLIP_PCT"):
        answer = yard.ask(station, mavlink.MAVLink_param_set_message(1, 1, name.encode(), bad, 9), "PARAM_ERROR")
        assert len(answer) == 1
    assert state(yard) == before


def test_intervals_and_speeds(yard: Yard, station: Station) -> None:
    for bad in (NAN, INF, -INF):
        assert result(yard, station, long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 30.0, bad)) == DENIED
    for bad in (NAN, INF, -INF, 0.0, -5.0):
        assert result(yard, station, long(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, bad, -1.0)) == DENIED
