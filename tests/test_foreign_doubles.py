"""The doubles behave as ArduRover was measured, and PX4 was read: answers, rounding, time line, silence, expiry."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Generic, TypeVar

import pytest

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from tests.ardupilot_mavlink_double import AUTO, GUIDED, HOLD, MANUAL, ArduRoverDouble
from tests.mavlink_rig import Station
from tests.px4_mavlink_double import MISSION, Px4RoverDouble
from tests.vehicle_double import KinematicRover, VehicleDouble

STEP_S = 0.05
ITEM = WireItem(3, WAYPOINT, (1.7, 2.0, 0.0, 90.0), -353_632_000, 1_491_652_000, 1.234)
NAN = math.nan
Double = TypeVar("Double", bound=VehicleDouble)


class Scene(Generic[Double]):
    """A double, its rover and a ground station; a second station where one is asked for."""

    def __init__(self, kind: type[Double], start_s: float = 60.0) -> None:
        self.station = Station()
        self.double = kind(self.station.link.transport)
        self.rover = KinematicRover()
        self.time_s = start_s
        self.run(0.1)

    def run(self, seconds: float) -> None:
        end = self.time_s + seconds
        while self.time_s < end:
            self.rover.step(self.double.tick(self.time_s, self.rover.motion), STEP_S)
            self.station.listen(self.time_s)
            self.time_s += STEP_S

    def ask(self, message: Message, *names: str) -> list[Message]:
        self.station.take(*names)
        self.station.send(message, self.time_s)
        self.run(STEP_S)
        return self.station.take(*names)

    def command(self, number: int, *parameters: float) -> int:
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *padded)
        return int(self.ask(message, "COMMAND_ACK")[0].result)

    def upload(self, *items: WireItem) -> int:
        """The result of a whole upload."""
        answer = self.ask(mavlink.MAVLink_mission_count_message(1, 1, len(items)), *_ASKS)
        while answer and answer[0].get_type() != "MISSION_ACK":
            seq = answer[0].seq
            answer = self.ask(items[seq].message(1, 1, seq), *_ASKS)
        return int(answer[0].type)

    def read(self, seq: int) -> WireItem:
        return WireItem.of(self.ask(mavlink.MAVLink_mission_request_int_message(1, 1, seq), "MISSION_ITEM_INT")[0])


_ASKS = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")


def ardupilot(start_s: float = 60.0) -> Scene[ArduRoverDouble]:
    return Scene(ArduRoverDouble, start_s)


def test_ardupilot_asks_by_the_old_name_and_keeps_home_as_item_0_and_rounds_the_rest() -> None:
    scene = ardupilot()
    first = scene.ask(mavlink.MAVLink_mission_count_message(1, 1, 2), *_ASKS)
    assert [message.get_type() for message in first] == ["MISSION_REQUEST"]
    assert scene.upload(ITEM, ITEM, replace(ITEM, frame=6)) == 0
    home, back, terrain = (scene.read(seq) for seq in range(3))
    assert (home.frame, home.x) == (0, scene.double.missions._home.x)
    assert (back.params, back.frame, back.x) == ((1.0, 0.0, 0.0, 0.0), 3, ITEM.x)
    assert back.z == pytest.approx(1.23)
    assert terrain.frame == 3


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (replace(ITEM, command=31337), 3),
        (replace(ITEM, frame=1), 2),
        (replace(ITEM, params=(NAN, 0.0, 0.0, 0.0)), 6),
        (replace(ITEM, params=(0.0, NAN, 0.0, 0.0)), 7),
        (replace(ITEM, params=(0.0, 0.0, 0.0, NAN)), 0),
        (replace(ITEM, params=(0.0, 0.0, 0.0, math.inf)), 9),
        (replace(ITEM, x=910_000_000), 10),
        (replace(ITEM, y=1_810_000_000), 11),
    ],
)
def test_ardupilot_answers_each_defect_as_measured(item: WireItem, result: int) -> None:
    assert ardupilot().upload(ITEM, item) == result


def test_a_refused_upload_leaves_the_ardupilots_mission_cut() -> None:
    scene = ardupilot()
    assert scene.upload(ITEM, ITEM, ITEM) == 0
    assert scene.upload(ITEM, replace(ITEM, command=31337)) == 3
    assert len(scene.double.missions.items) == 2
    assert scene.double.missions.torn
    assert scene.upload(*[ITEM] * 656) == 4
    assert len(scene.double.missions.items) == 2  # decided before anything is cut
    assert "Only 655 items are supported" in scene.double.said


def test_order_strangers_and_the_end_of_an_ardupilots_patience() -> None:
    scene = ardupilot()
    assert scene.ask(ITEM.message(1, 1, 0), "MISSION_ACK")[0].type == 1  # no upload open
    scene.ask(mavlink.MAVLink_mission_count_message(1, 1, 3), *_ASKS)
    assert scene.ask(ITEM.message(1, 1, 2), "MISSION_ACK")[0].type == 13
    scene.station.packer._mav.srcComponent = 230
    assert scene.ask(mavlink.MAVLink_mission_count_message(1, 1, 3), "MISSION_ACK")[0].type == 14
    assert scene.ask(ITEM.message(1, 1, 0), "MISSION_ACK")[0].type == 14
    assert scene.ask(mavlink.MAVLink_mission_request_list_message(1, 1), "MISSION_ACK")[0].type == 14
    scene.run(4.0)
    assert {message.seq for message in scene.station.take("MISSION_REQUEST")} == {0}  # asks again
    scene.run(5.0)
    assert [message.type for message in scene.station.take("MISSION_ACK")] == [15]
    assert "Mission upload timeout" in scene.double.said


@pytest.mark.parametrize(
    ("time_s", "flags", "armed", "text"),
    [
        (1.0, 1024, 4, "PreArm: Accels inconsistent"),
        (4.0, 0, 4, "PreArm: Accels inconsistent"),
        (20.0, 167, 4, "PreArm: Gyros inconsistent"),
        (24.0, 167, 0, ""),
        (60.0, 831, 0, ""),
    ],
)
def test_the_ardupilots_time_line(time_s: float, flags: int, armed: int, text: str) -> None:
    scene = ardupilot(time_s)
    assert scene.double.flags == flags
    assert scene.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == armed
    assert not text or scene.double.said[-1] == text


def test_the_ardupilots_modes() -> None:
    scene = ardupilot(30.0)
    mode = mavlink.MAV_CMD_DO_SET_MODE
    assert scene.command(mode, 1, GUIDED) == 0  # disarmed, nobody asks for a position
    assert scene.command(mode, 1, MANUAL) == 0
    assert scene.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == 0
    assert scene.command(mode, 1, GUIDED) == 4
    assert scene.double.said[-1] == "Flight mode change failed"
    scene.run(15.0)
    assert scene.command(mode, 1, GUIDED) == 0
    assert scene.command(mode, 1, AUTO) == 4
    assert scene.double.said[-1] == "No Mission. Can't set AUTO."
    assert scene.command(mode, 1, 99) == 4
    assert scene.command(mode, 0, HOLD) == 4  # without the custom bit
    assert scene.command(mavlink.MAV_CMD_DO_REPOSITION, 0.0) == 3  # COMMAND_INT only


def test_an_ardupilot_goes_on_at_the_number_where_the_old_mission_was() -> None:
    scene = ardupilot()
    frame = scene.double.frame

    def at(x_m: float, y_m: float) -> WireItem:
        place = frame.to_geo((x_m, y_m, 0.0))
        return replace(ITEM, params=(0.0,) * 4, x=place.latitude_e7, y=place.longitude_e7)

    scene.upload(ITEM, at(2.0, 0.0), at(9.0, 0.0), at(9.0, 9.0))
    scene.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    scene.command(mavlink.MAV_CMD_DO_SET_MODE, 1, AUTO)
    scene.run(6.0)
    assert scene.double.current == 2
    scene.command(mavlink.MAV_CMD_DO_SET_MODE, 1, HOLD)
    scene.upload(ITEM, at(0.0, 5.0), at(0.0, 6.0), at(0.0, 7.0))
    scene.command(mavlink.MAV_CMD_DO_SET_MODE, 1, AUTO)
    assert scene.double.current == 2
    assert scene.command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 1) == 0
    assert scene.double.current == 1
    assert scene.ask(mavlink.MAVLink_mission_clear_all_message(1, 1), "MISSION_ACK")[0].type == 1  # in Auto
    scene.run(60.0)
    assert scene.double.said[-1] == "Mission Complete"
    assert scene.double.custom_mode == AUTO


def test_set_points_to_an_ardupilot_are_dropped_silently_and_expire() -> None:
    scene = ardupilot()
    scene.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def target(frame: int, mask: int, *numbers: float) -> None:
        padded = (*numbers, *(0.0,) * (11 - len(numbers)))
        message = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *padded)
        said = len(scene.double.said)
        scene.ask(message, "STATUSTEXT")
        assert len(scene.double.said) == said

    target(1, 3580, 5.0, 0.0)
    assert scene.double.target is None  # not in Guided
    scene.command(mavlink.MAV_CMD_DO_SET_MODE, 1, GUIDED)
    target(3, 3580, 5.0, 0.0)
    assert scene.double.target is None  # a frame that it does not take
    target(1, 3559, 0.0, 0.0, 0.0, 1.0, 0.0)
    scene.run(2.5)
    assert scene.rover.motion.speed_m_s == pytest.approx(1.0, abs=0.05)
    scene.run(2.0)
    assert scene.double.said[-1] == "target not received last 3secs, stopping"
    assert scene.rover.motion.speed_m_s == pytest.approx(0.0, abs=0.05)
    target(8, 3580, 3.0, 0.0)  # ahead of the rover; a place does not expire
    scene.run(10.0)
    assert scene.rover.motion.north_m == pytest.approx(5.8, abs=0.5)


def test_px4_takes_a_mission_whole_or_not_at_all_and_reads_in_order() -> None:
    scene = Scene(Px4RoverDouble)
    place = replace(ITEM, params=(0.0,) * 4)
    assert scene.upload(place, place) == 0
    assert scene.upload(place, replace(place, command=194)) == 3
    assert len(scene.double.items) == 2
    assert scene.upload(replace(place, frame=1)) == 2
    scene.ask(mavlink.MAVLink_mission_count_message(1, 1, 3), *_ASKS)
    assert scene.ask(mavlink.MAVLink_mission_count_message(1, 1, 3), *_ASKS)[0].get_type() == "MISSION_REQUEST_INT"
    scene.ask(place.message(1, 1, 0), *_ASKS)
    assert scene.ask(mavlink.MAVLink_mission_count_message(1, 1, 3), "MISSION_ACK")[0].type == 1
    assert scene.ask(mavlink.MAVLink_mission_request_list_message(1, 1), "MISSION_COUNT") == []
    scene.run(6.0)
    assert "Operation timeout" in scene.double.said
    assert scene.ask(mavlink.MAVLink_mission_request_list_message(1, 1), "MISSION_COUNT")[0].count == 2
    assert scene.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 4) == 0
    assert scene.double.custom_mode == MISSION
    assert scene.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == 1  # Offboard wants set points first
