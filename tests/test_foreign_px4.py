"""The companion with a double of a PX4 rover: its own numbers, atomic missions, preflight checks, Offboard."""

from __future__ import annotations

import math

import pytest

from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.commander import CommandState
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.plan_items import backing_items
from rover_sim.mavlink.uploader import UploadState
from rover_sim.mavlink.vehicle_control import TroubleKind
from tests.foreign_rig import ForeignPair
from tests.px4_mavlink_double import LOITER, MISSION, OFFBOARD, POSITION_S, READY_S, Px4RoverDouble


def px4(pair: ForeignPair) -> Px4RoverDouble:
    assert isinstance(pair.double, Px4RoverDouble)
    return pair.double


def test_from_a_cold_start_to_the_end_with_items_counted_without_home() -> None:
    pair = ForeignPair(Px4RoverDouble)
    double = px4(pair)
    upload = pair.companion.drive(pair.items((6.0, 0.0), (6.0, 5.0), speed_m_s=1.0), 0.0)
    pair.run(5.0)
    assert upload.state is UploadState.DONE
    assert list(double.items) == [*upload.items[1:]]
    assert pair.companion.waits_for == "a position (estimator flags 7)"
    pair.run(POSITION_S - 3.0)
    assert pair.companion.waits_for == "its pre-arm checks"
    started_s = pair.until(lambda: double.armed and double.custom_mode == MISSION, 20.0)
    assert READY_S < started_s < READY_S + 4.0
    pair.until(lambda: pair.companion.status.mission_state is MissionState.COMPLETE, 60.0)
    assert pair.companion.status.reached == (2, 3)  # as our list counts, home is 0
    assert pair.companion.status.mode == Mode.AUTO
    assert pair.companion.owns_mission is True


def test_the_next_leg_goes_up_under_way_without_a_stop() -> None:
    pair = ForeignPair(Px4RoverDouble, start_s=20.0)
    double = px4(pair)
    pair.companion.drive(pair.items((9.0, 0.0), (9.0, 9.0)), pair.time_s)
    pair.until(lambda: pair.rover.motion.east_m > 3.0, 30.0)
    upload = pair.companion.drive(pair.items((14.0, 0.0)), pair.time_s)
    slowest, end_s = 9.0, pair.time_s + 4.0
    while pair.time_s < end_s:
        pair.step()
        slowest = min(slowest, pair.rover.motion.speed_m_s)
        assert double.custom_mode == MISSION
    assert upload.state is UploadState.DONE
    assert slowest > 0.9
    pair.until(lambda: pair.companion.status.mission_state is MissionState.COMPLETE, 30.0)
    assert double.driven[-1] == upload.items[1]


def test_it_turns_by_attitude_set_points_that_are_there_before_the_mode() -> None:
    pair = ForeignPair(Px4RoverDouble, start_s=20.0)
    pair.companion.arm()
    turn = pair.companion.turn_to(0.0)  # east
    pair.until(lambda: turn.state is CommandState.DONE, 20.0)
    pair.run(8.0)
    assert pair.double.custom_mode == OFFBOARD
    assert pair.companion.status.mode == Mode.GUIDED
    assert pair.rover.motion.heading_rad == pytest.approx(math.pi / 2.0, abs=0.05)
    pair.companion.set_mode(Mode.HOLD)
    pair.run(3.0)
    assert pair.double.custom_mode == LOITER


def test_backing_up_is_refused_before_anything_is_sent() -> None:
    pair = ForeignPair(Px4RoverDouble, start_s=20.0)
    upload = pair.companion.drive(backing_items([(0.0, -3.0, 0.0)], pair.double.frame, (0.0, 0.0, 0.0)), pair.time_s)
    pair.run(10.0)
    assert (upload.state, upload.refused_item) == (UploadState.FAILED, 1)
    assert upload.reason == f"item 1: PX4 takes no command {mavlink.MAV_CMD_DO_SET_REVERSE}"
    assert pair.companion.trouble is not None
    assert pair.companion.trouble.kind is TroubleKind.REFUSED
    assert not pair.double.armed


def test_a_mission_of_another_station_is_told_by_its_id() -> None:
    pair = ForeignPair(Px4RoverDouble, start_s=20.0)
    double = px4(pair)
    pair.companion.upload(pair.items((6.0, 0.0)), pair.time_s)
    pair.run(5.0)
    assert pair.companion.owns_mission is True
    double._store(pair.items((5.0, 5.0))[1:], (255, 190))
    pair.run(5.0)
    assert pair.companion.owns_mission is False


def test_an_id_that_we_cannot_foretell_is_looked_into_once() -> None:
    pair = ForeignPair(Px4RoverDouble, start_s=20.0)
    pair.companion.upload(pair.items((6.0, 0.0)), pair.time_s)
    pair.run(5.0)
    double = px4(pair)
    double.opaque_id += 1
    reads: list[float] = []
    listed = double._handlers["MISSION_REQUEST_LIST"]

    def note(message: Message) -> None:
        reads.append(pair.time_s)
        listed(message)

    double._handlers["MISSION_REQUEST_LIST"] = note
    pair.run(10.0)
    assert len(reads) == 1
    assert pair.companion.owns_mission is True  # the items are the same


def test_a_cleared_mission_is_nobodys() -> None:
    pair = ForeignPair(Px4RoverDouble, start_s=20.0)
    pair.companion.upload(pair.items((6.0, 0.0)), pair.time_s)
    pair.run(5.0)
    px4(pair)._store([], (255, 190))
    pair.run(2.0)
    assert pair.companion.owns_mission is None
    assert pair.companion.status.mission_state is MissionState.NO_MISSION
