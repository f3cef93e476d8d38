"""Parameters per persona: what ground stations expect, errors, the file; and the lists of modes."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import pytest

from rover_sim.autopilot.parameter_file import load_parameters, save_parameters
from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.errors import InputError
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.persona import ARDUPILOT, GENERIC, PERSONAS, PX4, Persona
from tests.mavlink_rig import Station, Yard

# QGroundControl reads these without checking that they exist (docs/mavlink.md).
EXPECTED = {
    "ardupilot": "RCMAP_ROLL RCMAP_PITCH RCMAP_YAW RCMAP_THROTTLE RC1_MIN RC2_MAX RC3_TRIM RC4_MIN COMPASS_DEV_ID "
    "COMPASS_DEV_ID2 COMPASS_DEV_ID3 COMPASS_USE COMPASS_USE2 COMPASS_USE3 COMPASS_OFS_X INS_ACCOFFS_X INS_ACCOFFS_Z",
    "px4": "SYS_AUTOSTART COM_RC_IN_MODE CAL_GYRO0_ID CAL_ACC0_ID CAL_MAG0_ID SYS_HAS_MAG RC_MAP_ROLL RC_MAP_THROTTLE "
    "BAT1_SOURCE BAT1_V_CHARGED BAT1_V_EMPTY BAT1_N_CELLS",
    "generic": "",
}


def yard_of(persona: Persona) -> tuple[Yard, Station]:
    station = Station()
    return Yard(station, persona=persona), station


def set_to(name: str, value: float, kind: int) -> Message:
    return mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind)


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_the_list_is_complete_and_each_one_can_be_read_by_its_index(persona: Persona) -> None:
    yard, station = yard_of(persona)
    values = yard.ask(station, mavlink.MAVLink_param_request_list_message(1, 1), "PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    assert {value.param_id for value in values} >= {"CRUISE_SPEED", *EXPECTED[persona.name].split()}
    for value in values:
        read = mavlink.MAVLink_param_request_read_message(1, 1, b"", value.param_index)
        (again,) = yard.ask(station, read, "PARAM_VALUE")
        assert (again.param_id, again.param_type) == (value.param_id, value.param_type)
        assert struct.pack("<f", again.param_value) == struct.pack("<f", value.param_value)


def test_what_the_simulation_has_not_can_be_read_and_not_changed() -> None:
    yard, station = yard_of(ARDUPILOT)
    error, value = yard.ask(station, set_to("COMPASS_USE", 0.0, 6), "PARAM_ERROR", "PARAM_VALUE")
    assert (error.error, value.param_value) == (mavlink.MAV_PARAM_ERROR_READ_ONLY, 1.0)
    (value,) = yard.ask(station, set_to("RC3_MIN", 990.0, 6), "PARAM_VALUE")
    assert value.param_value == 990.0


def test_px4_tells_a_checksum_that_changes_with_the_values() -> None:
    read = mavlink.MAVLink_param_request_read_message(1, 1, b"_HASH_CHECK", -1)
    yard, station = yard_of(PX4)
    table = yard.autopilot.parameters

    def expected() -> int:
        checksum = 0
        for name in sorted(table.names):
            value = (
                struct.pack("<i", int(table[name])) if table.describe(name).integer else struct.pack("<f", table[name])
            )
            checksum = zlib.crc32(value, zlib.crc32(name.encode(), checksum))
        return checksum

    def told() -> int:
        (value,) = yard.ask(station, read, "PARAM_VALUE")
        return int(struct.unpack("<I", struct.pack("<f", value.param_value))[0])

    first = told()
    assert first == expected()
    table.set("CRUISE_SPEED", 0.9)
    assert told() == expected() != first
    other, station = yard_of(ARDUPILOT)
    assert other.ask(station, read, "PARAM_ERROR")


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4, GENERIC])
def test_modes_are_listed_one_by_one_as_qgroundcontrol_asks(persona: Persona) -> None:
    yard, station = yard_of(persona)

    def ask(index: int) -> list[Message]:
        message = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 435, index, 0, 0, 0, 0, 0)
        return yard.ask(station, message, "AVAILABLE_MODES", "COMMAND_ACK")

    first = ask(1)[0]
    listed = [ask(index)[0] for index in range(1, first.number_modes + 1)]
    assert {mode.custom_mode for mode in listed} == set(persona.numbers.values())
    assert [mode.mode_index for mode in listed] == list(range(1, first.number_modes + 1))
    assert {"Manual", "Hold"} < {mode.mode_name for mode in listed}
    assert [answer.get_type() for answer in ask(99)] == ["COMMAND_ACK"]
    assert len(ask(0)) == first.number_modes + 1
    current = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 436, 0, 0, 0, 0, 0, 0)
    (mode,) = yard.ask(station, current, "CURRENT_MODE")
    assert mode.custom_mode == persona.custom_mode(yard.autopilot)


def test_pause_continue_and_storing() -> None:
    yard, station = yard_of(ARDUPILOT)

    def result(number: int, first: float) -> int:
        message = mavlink.MAVLink_command_long_message(1, 1, number, 0, first, 0, 0, 0, 0, 0, 0)
        (answer,) = yard.ask(station, message, "COMMAND_ACK")
        return int(answer.result)

    assert (result(193, 0.0), result(193, 1.0), result(193, 7.0)) == (0, 4, 2)  # there is no mission to go on with
    assert (result(245, 1.0), result(245, 2.0)) == (0, 3)


def test_parameters_are_kept_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "rover.params"
    table = ParameterTable()
    table.set("CRUISE_SPEED", 0.1 + 0.2)
    save_parameters(path, table)
    again = ParameterTable()
    load_parameters(path, again)
    assert {name: again[name] for name in again.names} == {name: table[name] for name in table.names}


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("NO_SUCH 1", "line 2: no parameter is called 'NO_SUCH'"),
        ("CRUISE_SPEED fast", "CRUISE_SPEED = 'fast'; allowed: 0.05 to 2"),
        ("CRUISE_SPEED nan", "allowed: 0.05 to 2"),
        ("CRUISE_SPEED 99", "allowed: 0.05 to 2"),
    ],
)
def test_a_wrong_line_changes_nothing(line: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "rover.params"
    path.write_text(f"WP_RADIUS 1.0\n{line}\n", encoding="utf-8")
    table = ParameterTable()
    with pytest.raises(InputError, match=says):
        load_parameters(path, table)
    assert table["WP_RADIUS"] == 0.25
