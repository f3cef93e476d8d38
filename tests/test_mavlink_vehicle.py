from __future__ import annotations

import math

import numpy as np
import pytest

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.status import status_texts
from tests.mavlink_rig import Station, Yard


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture
def yard(station: Station) -> Yard:
    return Yard(station)


def command(number: int, *parameters: float, component: int = 1) -> Message:
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(1, component, number, 0, *padded)


def result(yard: Yard, station: Station, message: Message) -> int:
    (answer,) = yard.ask(station, message, "COMMAND_ACK")
    assert (answer.target_system, answer.target_component) == (255, 190)
    return int(answer.result)


def test_it_is_an_ardupilot_rover_that_says_it_is_a_simulator(yard: Yard, station: Station) -> None:
    (beat,) = station.take("HEARTBEAT")
    assert (beat.type, beat.autopilot, beat.custom_mode, beat.system_status) == (10, 3, 4, 3)
    back = yard.ask(station, command(512, 148), "AUTOPILOT_VERSION", "COMMAND_ACK", "STATUSTEXT")
    version = next(message for message in back if message.get_type() == "AUTOPILOT_VERSION")
    assert version.capabilities == 0x2E1AC
    assert version.flight_sw_version & 0xFF == 0  # type DEV: no "outdated firmware" pop-up
    assert any("simulated" in message.text for message in back if message.get_type() == "STATUSTEXT")
    again = yard.ask(station, command(512, 148), "STATUSTEXT")
    assert again == []


def test_stream_rates(yard: Yard, station: Station) -> None:
    yard.step(1.0)
    station.heard.clear()
    yard.step(10.0)
    counts = {name: len(station.take(name)) for name in ("HEARTBEAT", "ATTITUDE", "GLOBAL_POSITION_INT", "VFR_HUD")}
    for name, wanted in (("HEARTBEAT", 10), ("ATTITUDE", 100), ("GLOBAL_POSITION_INT", 50), ("VFR_HUD", 40)):
        assert counts[name] == pytest.approx(wanted, abs=1)
    assert len(station.take("EXTENDED_SYS_STATE")) == pytest.approx(10, abs=1)
    assert len(station.take("BATTERY_STATUS")) == pytest.approx(5, abs=1)


def test_mode_and_arm_changes_are_pushed_in_the_same_tick(yard: Yard, station: Station) -> None:
    station.take("HEARTBEAT")
    assert result(yard, station, command(400, 1.0)) == 0
    (beat,) = station.take("HEARTBEAT")
    assert beat.base_mode & 128
    assert result(yard, station, command(176, 1.0, 15.0)) == 0
    (beat,) = station.take("HEARTBEAT")
    assert (beat.custom_mode, beat.system_status) == (15, 4)
    assert result(yard, station, command(400, 0.0, component=0)) == 0
    assert not yard.autopilot.armed


def test_frames_turn_at_the_edge(yard: Yard, station: Station) -> None:
    yard.rover.x_m, yard.rover.y_m, yard.rover.yaw_rad, yard.rover.roll_rad = 100.0, 50.0, 0.5, 0.1
    yard.step(1.0)
    attitude = station.take("ATTITUDE")[-1]
    assert attitude.roll == pytest.approx(0.1)
    assert attitude.yaw == pytest.approx(math.pi / 2 - 0.5)
    position = station.take("GLOBAL_POSITION_INT")[-1]
    assert position.hdg == pytest.approx(100 * (90 - math.degrees(0.5)), abs=1)
    assert (position.lat - 384064000) * 0.01110 == pytest.approx(50.0, abs=0.1)  # 1e-7 deg of latitude is 1.110 cm
    assert station.take("HOME_POSITION")[-1].latitude == 384064000
    hud = station.take("VFR_HUD")[-1]
    assert hud.heading == round(90 - math.degrees(0.5))
    assert station.take("GPS_RAW_INT")[-1].fix_type == 3


@pytest.mark.parametrize("number", [0, 21, 22, 246, 262, 241, 400 + 9000, 31000, 65535])
def test_unknown_commands_are_refused_at_once(yard: Yard, station: Station, number: int) -> None:
    assert result(yard, station, command(number)) == 3
    other = mavlink.MAVLink_command_int_message(1, 1, 0, number, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert result(yard, station, other) == 3


def test_commands_with_nan_are_refused_and_change_nothing(yard: Yard, station: Station) -> None:
    nan = (math.nan,) * 7
    for number in (400, 176, 224, 192, 178, 115, 179, 512, 511, 510):
        assert result(yard, station, command(number, *nan)) != 0
    assert (yard.autopilot.mode, yard.autopilot.armed) == (Mode.HOLD, False)


def test_goto_as_both_kinds_of_command(yard: Yard, station: Station) -> None:
    yard.autopilot.arm()
    goto = mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, math.nan, 384064000, -1107918300, math.nan)
    assert result(yard, station, goto) == 0
    yard.step(15.0)
    assert yard.rover.x_m == pytest.approx(6.1, abs=0.5)  # 700e-7 deg of longitude at 38.4 deg north
    assert result(yard, station, command(192, -1, 1, 0, math.nan, 38.4064, -110.7919, 0.0)) == 0
    yard.step(20.0)
    assert yard.rover.x_m == pytest.approx(0.0, abs=0.7)
    assert result(yard, station, command(192, -1, 1, 0, math.nan, -38.4064, -110.7919, 0.0)) == 2


def test_refusals_say_why(yard: Yard, station: Station) -> None:
    yard.rover.position_sd_m = 50.0
    yard.step()
    assert result(yard, station, command(400, 1.0)) == 4
    assert "PreArm: position uncertain by 50.0 m" in [message.text for message in station.take("STATUSTEXT")]
    assert result(yard, station, command(400, 1.0, 2989.0)) == 0  # forced
    assert result(yard, station, command(400, 0.0, 21196.0)) == 0  # emergency stop
    assert result(yard, station, command(300)) == 4
    assert "Auto: no mission" in [message.text for message in station.take("STATUSTEXT")]


def test_older_set_mode(yard: Yard, station: Station) -> None:
    (answer,) = yard.ask(station, mavlink.MAVLink_set_mode_message(1, 1, 15), "COMMAND_ACK")
    assert (answer.command, answer.result) == (11, 0)
    assert yard.autopilot.mode is Mode.GUIDED


def test_turning_by_command(yard: Yard, station: Station) -> None:
    yard.autopilot.arm()
    assert result(yard, station, command(115, 0.0)) == 0  # to the north
    yard.step(8.0)
    assert yard.rover.yaw_rad == pytest.approx(math.pi / 2, abs=0.2)
    assert result(yard, station, command(115, 90.0, 0.0, 1.0, 1.0)) == 0  # 90 deg to the right
    yard.step(8.0)
    assert yard.rover.yaw_rad == pytest.approx(0.14, abs=0.3)


def test_streams_on_request(yard: Yard, station: Station) -> None:
    attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE
    assert result(yard, station, command(511, attitude, 50_000.0)) == 0
    station.take("ATTITUDE")
    yard.step(5.0)
    assert len(station.take("ATTITUDE")) == pytest.approx(100, abs=4)
    (interval,) = yard.ask(station, command(510, attitude), "MESSAGE_INTERVAL")
    assert interval.interval_us == 50_000
    assert result(yard, station, command(511, attitude, -1.0)) == 0
    station.take("ATTITUDE")
    yard.step(2.0)
    assert station.take("ATTITUDE") == []
    assert result(yard, station, command(511, attitude, 0.0)) == 0
    yard.step(2.0)
    assert len(station.take("ATTITUDE")) == pytest.approx(20, abs=2)
    assert result(yard, station, command(511, 9999, 1e6)) == 2
    assert result(yard, station, command(512, 9999)) == 3
    assert result(yard, station, command(511, mavlink.MAVLINK_MSG_ID_HEARTBEAT, -1.0)) == 2


def test_streams_by_the_older_request(yard: Yard, station: Station) -> None:
    yard.ask(station, mavlink.MAVLink_request_data_stream_message(1, 1, 0, 2, 1))
    station.heard.clear()
    yard.step(5.0)
    assert len(station.take("ATTITUDE")) == pytest.approx(10, abs=1)
    yard.ask(station, mavlink.MAVLink_request_data_stream_message(1, 1, 10, 0, 0))
    station.heard.clear()
    yard.step(2.0)
    assert station.take("ATTITUDE") == []


def test_parameters_list_read_set(yard: Yard, station: Station) -> None:
    values = yard.ask(station, mavlink.MAVLink_param_request_list_message(1, 1), "PARAM_VALUE")
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    assert {value.param_id for value in values} >= {"WP_RADIUS", "CRUISE_SPEED", "TURN_RATE", "FS_SLIP_PCT"}
    (value,) = yard.ask(station, mavlink.MAVLink_param_request_read_message(1, 1, b"WP_RADIUS", -1), "PARAM_VALUE")
    assert value.param_value == 0.25
    assert (value.param_type, value.param_id) == (9, "WP_RADIUS")
    (value,) = yard.ask(station, mavlink.MAVLink_param_set_message(1, 1, b"WP_RADIUS", 0.5, 9), "PARAM_VALUE")
    assert value.param_value == 0.5 == yard.autopilot.parameters["WP_RADIUS"]
    (value,) = yard.ask(station, mavlink.MAVLink_param_request_read_message(1, 1, b"", 0), "PARAM_VALUE")
    assert value.param_index == 0


def test_parameter_errors_are_told(yard: Yard, station: Station) -> None:
    read = mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1)
    (error,) = yard.ask(station, read, "PARAM_ERROR")
    assert (error.param_id, error.error) == ("NO_SUCH", 1)
    (error,) = yard.ask(station, mavlink.MAVLink_param_set_message(1, 1, b"NO_SUCH", 1.0, 9), "PARAM_ERROR")
    assert error.error == 1
    bad = mavlink.MAVLink_param_set_message(1, 1, b"WP_RADIUS", math.nan, 9)
    back = yard.ask(station, bad, "PARAM_ERROR", "PARAM_VALUE")
    assert [message.get_type() for message in back] == ["PARAM_ERROR", "PARAM_VALUE"]
    assert (back[0].error, back[1].param_value) == (2, 0.25)


def test_long_texts_come_in_chunks() -> None:
    chunks = status_texts(4, "x" * 50 + "y" * 50, 9)
    assert [(chunk.id, chunk.chunk_seq, len(chunk.text)) for chunk in chunks] == [(9, 0, 50), (9, 1, 50), (9, 2, 0)]
    (short,) = status_texts(4, "", 9)
    assert (short.id, short.text) == (0, "")


def test_a_pose_that_is_no_number_stops_the_pose_messages_and_nothing_else(yard: Yard, station: Station) -> None:
    yard.rover.x_m = math.nan
    station.heard.clear()
    yard.step(2.5)
    assert station.take("GLOBAL_POSITION_INT", "ATTITUDE", "VFR_HUD") == []
    assert len(station.take("HEARTBEAT")) >= 2
    assert not station.take("SYS_STATUS")[-1].onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_AHRS


def test_each_listener_hears_an_unbroken_sequence(yard: Yard, station: Station) -> None:
    other = Station(254, 190)
    yard = Yard(station, other)
    station.heard.clear()
    other.heard.clear()
    for _ in range(20):
        yard.ask(station, mavlink.MAVLink_param_request_list_message(1, 1))
    for listener in (station, other):
        numbers = np.array([message.get_seq() for message in listener.heard])
        assert set(np.diff(numbers) % 256) == {1}


def test_fail_safe_is_a_critical_state_and_a_text(yard: Yard, station: Station) -> None:
    yard.autopilot.arm()
    yard.autopilot.goto((9.0, 0.0, 0.0))
    yard.step(2.0)
    yard.rover.slip = 0.8
    yard.step(4.0)
    assert any(message.text.startswith("Slip stop") for message in station.take("STATUSTEXT"))
    beat = station.take("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.system_status) == (4, 5)
    assert max(message.value for message in station.take("NAMED_VALUE_FLOAT")) > 0.4


def test_a_peer_of_mavlink_1_is_answered_in_mavlink_1_until_it_speaks_2(yard: Yard, station: Station) -> None:
    def first_bytes() -> set[int]:
        return {message.get_msgbuf()[0] for message in station.heard}

    station.packer.version_1 = True
    station.heard.clear()
    yard.ask(station, command(512, 148), "AUTOPILOT_VERSION")
    yard.step(0.5)
    assert first_bytes() == {0xFE}
    assert yard.ask(station, mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1), "PARAM_ERROR") == []
    station.packer.version_1 = False
    yard.ask(station, command(512, 148))
    station.heard.clear()
    yard.step(0.5)
    assert first_bytes() == {0xFD}
