"""PING, TIMESYNC and SYSTEM_TIME by hand-made messages."""

from __future__ import annotations

import pytest

from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.tlog import SIMULATED_EPOCH_S
from tests.mavlink_rig import Station, Yard


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture
def yard(station: Station) -> Yard:
    return Yard(station)


def test_a_ping_comes_back_as_it_was_to_who_sent_it(yard: Yard, station: Station) -> None:
    (answer,) = yard.ask(station, mavlink.MAVLink_ping_message(2**63, 6, 0, 0), "PING")
    assert (answer.time_usec, answer.seq, answer.target_system, answer.target_component) == (2**63, 6, 255, 190)


@pytest.mark.parametrize("target", [(1, 1), (1, 0), (77, 1)])
def test_an_answer_to_a_ping_is_not_answered(yard: Yard, station: Station, target: tuple[int, int]) -> None:
    assert yard.ask(station, mavlink.MAVLink_ping_message(5, 6, *target), "PING") == []


def test_timesync_tells_the_time_since_start(yard: Yard, station: Station) -> None:
    yard.step(3.0)
    now_ns = yard.time_s * 1e9
    (answer,) = yard.ask(station, mavlink.MAVLink_timesync_message(0, 1234), "TIMESYNC")
    assert answer.ts1 == 1234
    assert answer.tc1 == pytest.approx(now_ns, abs=2e6)
    assert yard.ask(station, mavlink.MAVLink_timesync_message(5, 1234), "TIMESYNC") == []


def test_at_time_zero_too_the_answer_is_no_question(station: Station) -> None:
    yard = Yard(station)
    station.send(mavlink.MAVLink_timesync_message(0, 9), 0.0)
    yard.vehicle.answer(0.0)
    station.listen(0.0)
    assert station.take("TIMESYNC")[0].tc1 > 0


def test_system_time_runs_with_the_simulation_once_a_second(yard: Yard, station: Station) -> None:
    station.send(mavlink.MAVLink_system_time_message(1_700_000_000_000_000, 5), yard.time_s)  # sets nothing
    yard.step(10.0)
    told = station.take("SYSTEM_TIME")
    assert len(told) == pytest.approx(10, abs=1)
    for one in told:
        assert one.time_unix_usec / 1e6 == pytest.approx(SIMULATED_EPOCH_S + one.time_boot_ms / 1e3, abs=2e-3)
    assert told[-1].time_boot_ms > told[0].time_boot_ms


def test_the_time_since_start_agrees_between_messages(yard: Yard, station: Station) -> None:
    yard.step(2.0)
    station.heard.clear()
    ask = mavlink.MAVLink_command_long_message(1, 1, 512, 0, mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 0, 0, 0, 0, 0, 0)
    station.send(ask, yard.time_s)
    (sync,) = yard.ask(station, mavlink.MAVLink_timesync_message(0, 1), "TIMESYNC")
    assert sync.tc1 / 1e6 == pytest.approx(station.take("SYSTEM_TIME")[0].time_boot_ms, abs=1.0)
