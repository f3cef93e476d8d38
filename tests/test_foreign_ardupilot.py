"""The companion with a double of ArduRover 4.6.0-dev: cold start, missions, turns, people."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.commander import CommandState
from rover_sim.mavlink.dialect import Packer, Parser, mavlink
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.foreign_discovery import find
from rover_sim.mavlink.foreign_pursuit import Patience
from rover_sim.mavlink.plan_items import backing_items
from rover_sim.mavlink.uploader import UploadState
from rover_sim.mavlink.vehicle_control import TroubleKind
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from tests.ardupilot_mavlink_double import AUTO, AUTO_S, GUIDED, HOLD, MANUAL, ArduRoverDouble
from tests.foreign_rig import ForeignPair

READY_S = 50.0  # after the start of the vehicle's time line
HOME = (0.0, 0.0, 0.0)


def ardupilot(pair: ForeignPair) -> ArduRoverDouble:
    assert isinstance(pair.double, ArduRoverDouble)
    return pair.double


def driving(pair: ForeignPair, *places: tuple[float, float]) -> ArduRoverDouble:
    """A vehicle that is under way on a mission of ours."""
    pair.companion.drive(pair.items(*places), pair.time_s)
    double = ardupilot(pair)
    pair.until(lambda: double.custom_mode == AUTO and double.armed, 10.0)
    pair.until(lambda: pair.companion.status.mission_state is not MissionState.NOT_STARTED, 10.0)
    pair.run(2.0)
    return double


def test_from_a_cold_start_it_waits_for_the_estimator_then_arms_and_drives_to_the_end() -> None:
    pair = ForeignPair()
    double = ardupilot(pair)
    upload = pair.companion.drive(pair.items((8.0, 0.0), (8.0, 6.0), speed_m_s=1.0), 0.0)
    pair.run(10.0)
    assert upload.state is UploadState.DONE  # a mission goes up long before the vehicle is ready
    assert pair.companion.waits_for == "a position (estimator flags 167)"
    assert not double.armed
    started_s = pair.until(lambda: double.armed and double.custom_mode == AUTO, 60.0)
    assert AUTO_S < started_s < AUTO_S + 2.0
    pair.until(lambda: pair.companion.status.mission_state is MissionState.COMPLETE, 60.0)
    status = pair.companion.status
    assert (status.mode, status.armed, status.reached) == (Mode.AUTO, True, (2, 3))
    assert not double.started_torn
    assert [item.x for item in double.driven] == [item.x for item in upload.items[2:]]
    assert (pair.rover.motion.east_m, pair.rover.motion.north_m) == pytest.approx((8.0, 6.0), abs=0.3)


def test_a_vehicle_that_never_finds_its_position_is_given_up_with_what_it_lacks() -> None:
    class Lost(ArduRoverDouble):
        flags = 167

    pair = ForeignPair(Lost, patience=Patience(ready_s=60.0))
    pair.companion.drive(pair.items((8.0, 0.0)), 0.0)
    at_s = pair.until(lambda: pair.companion.trouble is not None, 90.0)
    trouble = pair.companion.trouble
    assert trouble is not None
    assert trouble.kind is TroubleKind.NOT_READY
    assert "within 60 s: it waits for a position (estimator flags 167)" in trouble.text
    assert 60.0 < at_s < 65.0
    assert not pair.double.armed


def test_a_refused_arming_is_tried_again_and_then_given_up_with_the_vehicles_reason() -> None:
    pair = ForeignPair(
        lambda end: ArduRoverDouble(end, never_ready="Compass not healthy"),
        patience=Patience(armed_s=20.0),
        start_s=READY_S,
    )
    pair.companion.drive(pair.items((8.0, 0.0)), pair.time_s)
    pair.until(lambda: pair.companion.trouble is not None, 40.0)
    trouble = pair.companion.trouble
    assert trouble is not None
    assert (trouble.kind, trouble.text) == (TroubleKind.NOT_ARMED, "arming refused: PreArm: Compass not healthy")
    assert 8 <= pair.double.commands.count(400) <= 12
    assert pair.double.custom_mode == MANUAL


def test_the_next_leg_is_never_uploaded_into_a_mission_that_is_being_driven() -> None:
    pair = ForeignPair(start_s=READY_S)
    double = driving(pair, (9.0, 0.0), (9.0, 9.0), (0.0, 9.0))
    pair.until(lambda: 2 in pair.companion.status.reached or pair.rover.motion.east_m > 8.5, 30.0)
    pair.run(4.0)
    assert double.current == 2
    before = len(double.driven)
    upload = pair.companion.drive(pair.items((12.0, 3.0), (12.0, 6.0)), pair.time_s)
    modes, real = set(), set()
    while upload.state is UploadState.SENDING or not pair.companion.status.mode == double.custom_mode == AUTO:
        pair.step()
        modes.add(pair.companion.status.mode)
        real.add(double.custom_mode)
    assert real == {AUTO, HOLD}
    assert modes == {int(Mode.AUTO)}  # to the planner nothing has changed
    assert not double.started_torn
    pair.until(lambda: pair.companion.status.mission_state is MissionState.COMPLETE, 60.0)
    assert [item.x for item in double.driven[before:]] == [item.x for item in upload.items[1:]]  # from its first item


@pytest.mark.parametrize("after_s", [0.05 * step for step in range(24)])
def test_a_change_of_mind_at_any_moment_of_a_leg_change_ends_in_the_last_mission_from_its_first_item(
    after_s: float,
) -> None:
    pair = ForeignPair(faults=Faults(delay_s=0.04), start_s=READY_S)
    double = driving(pair, (9.0, 0.0), (9.0, 9.0), (0.0, 9.0))
    pair.until(lambda: double.current == 2, 30.0)
    pair.companion.drive(pair.items((12.0, 3.0), (12.0, 6.0)), pair.time_s)
    pair.run(after_s)
    last = pair.companion.drive(pair.items((5.0, 5.0), (4.0, 6.0), (4.0, 2.0)), pair.time_s)
    pair.until(lambda: bool(double.driven) and double.driven[-1].x == last.items[1].x, 15.0)
    assert not double.started_torn
    pair.until(lambda: pair.companion.status.mission_state is MissionState.COMPLETE, 60.0)
    assert [item.x for item in double.driven[-3:]] == [item.x for item in last.items[1:]]


def test_it_backs_up_and_turns_on_the_spot() -> None:
    pair = ForeignPair(start_s=READY_S)
    pair.companion.drive(backing_items([(0.0, -3.0, 0.0)], pair.double.frame, HOME), pair.time_s)
    pair.until(lambda: pair.companion.status.mission_state is MissionState.COMPLETE, 30.0)
    assert pair.rover.motion.north_m == pytest.approx(-3.0, abs=0.3)
    assert pair.rover.motion.heading_rad == pytest.approx(0.0, abs=0.05)
    turn = pair.companion.turn_to(0.0)  # east
    pair.run(12.0)  # longer than set points last
    assert turn.state is CommandState.DONE
    assert pair.companion.status.mode == Mode.GUIDED
    assert pair.rover.motion.heading_rad == pytest.approx(math.pi / 2.0, abs=0.05)
    assert not any("not received" in text for text in pair.double.said)
    pair.companion.drive(pair.items((6.0, 0.0)), pair.time_s)
    pair.until(lambda: pair.double.custom_mode == AUTO, 10.0)


def test_arming_and_a_turn_wait_for_a_vehicle_that_has_just_been_switched_on() -> None:
    pair = ForeignPair()
    pair.companion.arm()
    pair.companion.turn_to(0.0)
    armed_s = pair.until(lambda: pair.double.armed and pair.double.custom_mode == GUIDED, 60.0)
    assert armed_s > AUTO_S


@pytest.mark.parametrize("number", [MANUAL, HOLD, 3])
def test_a_person_who_changes_the_mode_keeps_the_vehicle(number: int) -> None:
    pair = ForeignPair(start_s=READY_S)
    double = driving(pair, (9.0, 0.0), (9.0, 9.0))
    double.set_mode(number)
    pair.run(10.0)
    assert double.custom_mode == number
    assert pair.companion.status.mode == number
    assert not pair.companion.busy


def test_a_person_who_takes_over_in_the_middle_of_a_leg_change_keeps_the_vehicle() -> None:
    pair = ForeignPair(start_s=READY_S)
    double = driving(pair, (9.0, 0.0), (9.0, 9.0))
    pair.companion.drive(pair.items(*((float(step), 3.0) for step in range(20))), pair.time_s)
    pair.until(lambda: double.custom_mode == HOLD, 5.0)
    double.set_mode(MANUAL)
    pair.run(20.0)
    assert double.custom_mode == MANUAL


def test_a_fail_safe_in_the_middle_of_a_leg_change_is_not_driven_over() -> None:
    pair = ForeignPair(start_s=READY_S)
    double = driving(pair, (9.0, 0.0), (9.0, 9.0))
    pair.companion.drive(pair.items(*((float(step), 3.0) for step in range(20))), pair.time_s)
    pair.until(lambda: double.custom_mode == HOLD, 5.0)
    pair.run(0.2)
    double.say(2, "EKF failsafe")
    pair.run(20.0)
    assert double.custom_mode == HOLD
    assert pair.companion.status.mode == Mode.HOLD


def test_a_turn_ends_where_a_person_changes_the_mode() -> None:
    pair = ForeignPair(start_s=READY_S)
    pair.companion.arm()
    pair.companion.turn_to(1.0)
    double = ardupilot(pair)
    pair.until(lambda: double.custom_mode == GUIDED, 10.0)
    pair.run(3.0)
    double.set_mode(HOLD)
    pair.run(10.0)
    assert double.custom_mode == HOLD


def test_an_item_that_it_refuses_is_named_and_nothing_torn_is_left_or_started() -> None:
    pair = ForeignPair(start_s=READY_S)
    double = driving(pair, (9.0, 0.0), (9.0, 9.0), (0.0, 9.0))
    items = pair.items((1.0, 1.0), (2.0, 2.0))
    items[2] = replace(items[2], command=31337)
    upload = pair.companion.drive(items, pair.time_s)
    pair.run(10.0)
    assert upload.state is UploadState.FAILED
    assert upload.reason == "item 2 (command 31337): command not supported"
    trouble = pair.companion.trouble
    assert trouble is not None
    assert trouble.kind is TroubleKind.REFUSED
    assert (double.custom_mode, double.missions.items) == (HOLD, [])
    assert not double.started_torn


def test_too_many_items_are_refused_and_the_mission_before_stays() -> None:
    pair = ForeignPair(start_s=READY_S)
    first = pair.companion.upload(pair.items((1.0, 1.0)), pair.time_s)
    pair.run(3.0)
    second = pair.companion.upload(pair.items(*((float(step), 0.0) for step in range(700))), pair.time_s)
    pair.run(5.0)
    assert (first.state, second.reason) == (UploadState.DONE, "too many items")
    assert len(ardupilot(pair).missions.items) == 2


def test_without_a_wish_to_drive_a_mission_under_way_is_not_touched() -> None:
    pair = ForeignPair(start_s=READY_S)
    double = driving(pair, (9.0, 0.0), (9.0, 9.0))
    upload = pair.companion.upload(pair.items((1.0, 1.0)), pair.time_s)
    pair.run(3.0)
    assert upload.state is UploadState.FAILED
    assert "is driving its mission" in upload.reason
    assert double.custom_mode == AUTO
    assert len(double.missions.items) == 3


def test_only_what_was_read_back_is_started() -> None:
    class Forgetful(ArduRoverDouble):
        """Loses the last item that it acknowledged."""

        def live(self) -> None:
            super().live()
            if len(self.missions.items) == 4 and self.missions._sender is None:
                del self.missions.items[3:]

    pair = ForeignPair(Forgetful, start_s=READY_S)
    upload = pair.companion.drive(pair.items((1.0, 1.0), (2.0, 2.0), (3.0, 3.0)), pair.time_s)
    pair.run(60.0)
    assert upload.state is UploadState.FAILED
    assert upload.reason == "not stored in 4 uploads: read back 3 items instead of 4"
    assert ardupilot(pair).missions.items == []
    assert pair.double.custom_mode == MANUAL
    assert not pair.double.armed


def test_a_mission_that_a_person_sends_is_noticed() -> None:
    pair = ForeignPair(start_s=READY_S)
    double = ardupilot(pair)
    pair.companion.upload(pair.items((1.0, 1.0)), pair.time_s)
    pair.run(5.0)
    assert pair.companion.owns_mission is True
    other = [WireItem(3, WAYPOINT, (0.0, 0.0, 0.0, 0.0), -353_600_000, 1_491_600_000, 0.0)]
    double.missions.items[1:] = other  # as many items as before: only the text tells
    double.say(6, "Flight plan received")
    pair.run(3.0)
    assert pair.companion.owns_mission is False


def test_who_is_no_rover_is_refused_by_name_and_who_is_not_there_after_a_stated_time() -> None:
    class Copter(ArduRoverDouble):
        kind = 2

    pair = ForeignPair(Copter, start_s=READY_S)
    pair.companion.drive(pair.items((1.0, 1.0)), pair.time_s)
    pair.run(5.0)
    trouble = pair.companion.trouble
    assert trouble is not None
    assert trouble.text == "a quadrotor (ArduPilot, system 1); allowed: a ground rover"
    assert pair.double.commands == []
    assert ardupilot(pair).missions.items == []

    silent = ForeignPair(patience=Patience(vehicle_s=7.0))
    while silent.companion.trouble is None:
        silent.companion.tick(silent.time_s)
        silent.time_s += 0.5
    assert silent.companion.trouble.text == "no autopilot heard within 7 s"
    assert silent.time_s == pytest.approx(7.5)


def test_ground_stations_and_cameras_are_no_autopilots() -> None:
    def heard(system: int, component: int, kind: int, autopilot: int) -> object:
        frame = Packer(system, component).pack(mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 0, 3))
        return find(Parser().datagram(frame)[0])

    assert heard(255, 190, 6, 8) is None
    assert heard(1, 100, 30, 8) is None
    assert heard(1, 1, 10, 3) is not None


def test_a_speed_is_told_at_once_and_a_hold_too() -> None:
    pair = ForeignPair(start_s=READY_S)
    double = driving(pair, (30.0, 0.0))
    speed = pair.companion.change_speed(0.4)
    pair.run(1.0)
    assert speed.state is CommandState.DONE
    assert double.speed_m_s == pytest.approx(0.4)
    pair.companion.set_mode(Mode.HOLD)
    pair.run(0.5)
    assert double.custom_mode == HOLD
    assert pair.companion.status.mode == Mode.HOLD
    pair.run(5.0)
    pair.companion.start_mission()
    pair.run(1.0)
    assert double.custom_mode == AUTO
    assert double.armed
