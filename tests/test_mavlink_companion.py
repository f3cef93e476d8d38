from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.commander import CommandState
from rover_sim.mavlink.companion import Companion
from rover_sim.mavlink.dialect import mavlink, mission_ack
from rover_sim.mavlink.endpoint import Link
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.plan_items import backing_items, mission_items, turning_items
from rover_sim.mavlink.stack import MavlinkStack
from rover_sim.mavlink.streams import COMPANION_RATES
from rover_sim.mavlink.uploader import Uploader, UploadState
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_rig import FOOTPRINT, Station, Yard
from worlds.scenario import Origin

HOME = (0.0, 0.0, 0.0)


class Pair(Yard):
    """A vehicle and its companion on one link."""

    def __init__(self, faults: Faults | None = None, seed: int = 1) -> None:
        inner, outer = memory_link(faults, np.random.default_rng(seed))
        self.companion = Companion(Link(outer, {}))
        station = Station()
        station.link = Link(inner, COMPANION_RATES)
        super().__init__(station)

    def run(self, seconds: float) -> None:
        end = self.time_s + seconds
        while self.time_s < end:
            self.step()
            self.companion.tick(self.time_s)

    def items(self, *places: tuple[float, float]) -> list[WireItem]:
        return mission_items([(x, y, 0.0) for x, y in places], self.frame, HOME)


def test_upload_arm_start_and_follow_to_the_end() -> None:
    pair = Pair()
    pair.run(0.5)
    upload = pair.companion.upload(pair.items((2.0, 0.0), (3.0, 1.0)), pair.time_s)
    arm = pair.companion.arm()
    pair.run(0.5)
    assert (upload.state, upload.reason) == (UploadState.DONE, "")
    start = pair.companion.start_mission()
    pair.run(0.2)
    assert arm.state is start.state is CommandState.DONE
    status = pair.companion.status
    assert (status.mode, status.armed, status.current, status.mission_state) == (10, True, 1, MissionState.ACTIVE)
    pair.run(15.0)
    status = pair.companion.status
    assert (status.reached, status.mission_state) == ((1, 2), MissionState.COMPLETE)
    assert "Mission complete" in [text for _, _, text in status.texts]
    assert pair.companion.linked


def test_a_new_plan_while_driving_is_driven_without_another_command() -> None:
    pair = Pair()
    pair.companion.drive(pair.items((9.0, 0.0)), 0.0)
    pair.run(4.5)
    assert pair.rover.x_m > 1.0
    upload = pair.companion.drive(pair.items((3.0, 3.0)), pair.time_s)
    assert pair.companion._commander._queue == deque()
    pair.run(15.0)
    assert upload.state is UploadState.DONE
    assert np.hypot(pair.rover.x_m - 3.0, pair.rover.y_m - 3.0) < 0.5


def test_backing_up_and_turning_as_missions() -> None:
    pair = Pair()
    pair.companion.upload(backing_items([(-1.2, 0.0, 0.0)], pair.frame, HOME), 0.0)
    pair.companion.arm()
    pair.run(0.5)
    pair.companion.start_mission()
    pair.run(8.0)
    assert pair.rover.x_m == pytest.approx(-1.2, abs=0.35)
    assert abs(pair.rover.yaw_rad) < 0.1
    assert pair.companion.status.reached == (1, 2, 3)
    pair.companion.upload(turning_items(1.5, pair.frame, HOME), pair.time_s)
    pair.run(8.0)
    assert pair.rover.yaw_rad == pytest.approx(1.5, abs=0.2)
    turn = pair.companion.turn_to(0.0)
    pair.run(8.0)
    assert turn.state is CommandState.DONE
    assert pair.rover.yaw_rad == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("seed", range(6))
def test_upload_under_20_percent_loss_and_half_a_second_of_delay(seed: int) -> None:
    pair = Pair(Faults(loss=0.2, delay_s=0.5), seed)
    items = pair.items(*((float(step), 0.0) for step in range(10)))
    upload = pair.companion.upload(items, pair.time_s)
    arm = pair.companion.arm()
    pair.run(60.0)
    assert upload.state is UploadState.DONE
    assert [item.x for item in pair.vehicle.store.items] == [item.x for item in items]
    assert arm.state is CommandState.DONE
    assert pair.autopilot.armed


def test_after_a_slip_stop_the_companion_drives_on_with_another_mission() -> None:
    pair = Pair()
    pair.companion.drive(pair.items((9.0, 0.0)), 0.0)
    pair.run(3.0)
    pair.rover.slip = 0.9
    pair.run(6.0)
    assert pair.companion.status.mode == Mode.HOLD
    assert any(text.startswith("Slip stop") for _, _, text in pair.companion.status.texts)
    pair.rover.slip = 0.0
    x = pair.rover.x_m
    pair.companion.drive(backing_items([(x - 1.0, 0.0, 0.0)], pair.frame, HOME), pair.time_s)
    pair.run(6.0)
    assert pair.rover.x_m == pytest.approx(x - 1.0, abs=0.35)
    assert pair.companion.status.mission_state is MissionState.COMPLETE


def test_100_items_at_25_percent_loss() -> None:
    pair = Pair(Faults(loss=0.25), 3)
    items = pair.items(*((0.1 * step, 0.0) for step in range(99)))
    upload = pair.companion.upload(items, 0.0)
    pair.run(90.0)
    assert upload.state is UploadState.DONE
    assert [item.x for item in pair.vehicle.store.items] == [item.x for item in items]


def test_only_the_newest_waiting_plan_is_sent() -> None:
    pair = Pair()
    plans = [pair.companion.upload(pair.items((float(number), 0.0)), 0.0) for number in (1, 2, 3)]
    pair.run(1.0)
    assert [plan.state for plan in plans] == [UploadState.DONE, UploadState.REPLACED, UploadState.DONE]
    assert pair.vehicle.store.items[1].x == pair.items((3.0, 0.0))[1].x


def test_a_refused_plan_says_why_and_the_next_one_goes_out() -> None:
    pair = Pair()
    bad = pair.companion.upload([WireItem(3, 9999, (0, 0, 0, 0), 0, 0, 0.0)], 0.0)
    good = pair.companion.upload(pair.items((1.0, 0.0)), 0.0)
    pair.run(1.0)
    assert (bad.state, bad.reason) == (UploadState.FAILED, "command not supported")
    assert good.state is UploadState.DONE


def test_a_silent_vehicle_fails_the_upload_and_the_command() -> None:
    _, outer = memory_link()
    companion = Companion(Link(outer, {}))
    upload = companion.upload([], 0.0)
    command = companion.set_mode(4)
    for tick in range(260):
        companion.tick(tick * 0.1)
    assert (upload.state, upload.reason) == (UploadState.FAILED, "the vehicle does not answer")
    assert (command.state, command.result) == (CommandState.FAILED, None)
    assert not companion.linked


def test_both_names_of_the_request_get_integer_items_and_result_13_ends_nothing() -> None:
    sent: list[object] = []
    uploader = Uploader(sent.append, 1, 1)
    item = WireItem(3, 16, (0, 0, 0, 0), 1, 2, 3.0)
    upload = uploader.upload([item], 0.0)
    uploader.requested(mavlink.MAVLink_mission_request_message(1, 191, 0), 0.1)
    uploader.acknowledged(mavlink.MAVLink_mission_ack_message(1, 191, 13), 0.2)
    uploader.requested(mavlink.MAVLink_mission_request_int_message(1, 191, 0), 0.3)
    names = [type(message).__name__ for message in sent]
    assert names == ["MAVLink_mission_count_message", *["MAVLink_mission_item_int_message"] * 2]
    uploader.acknowledged(mission_ack(1, 191, 0, 0, 0), 0.4)
    assert upload.state is UploadState.DONE


def test_an_early_result_belongs_to_the_upload_before() -> None:
    uploader = Uploader(lambda _: None, 1, 1)
    item = WireItem(3, 16, (0, 0, 0, 0), 1, 2, 3.0)
    upload = uploader.upload([item, item], 0.0)
    uploader.acknowledged(mission_ack(1, 191, 0, 0, 0), 0.1)
    assert upload.state is UploadState.SENDING


def test_the_stack_serves_a_ground_station_beside_its_companion() -> None:
    from rover_sim.autopilot.autopilot import Autopilot
    from rover_sim.mavlink.dialect import Packer, Parser
    from rover_sim.mavlink.transport import parse_url
    from rover_sim.mavlink.udp import UdpIn
    from tests.mavlink_rig import KinematicRover

    listener = UdpIn(parse_url("udpin:127.0.0.1:0"))
    autopilot, rover = Autopilot(FOOTPRINT, HOME), KinematicRover()
    stack = MavlinkStack(Origin(), autopilot, [f"udpout:127.0.0.1:{listener.port}"])
    items = mission_items([(4.0, 0.0, 0.0)], stack.frame, HOME)
    upload = stack.companion.upload(items, 0.0)
    stack.companion.say(mavlink.MAV_SEVERITY_WARNING, "Route: risk 31 %, leg 2 of 6 28 %")
    parser, packer, heard = Parser(), Packer(255, 190), []
    for _ in range(480):
        wheels = autopilot.update(rover.time_s, rover.estimate(), rover.readings())
        stack.tick(rover.time_s, rover.estimate(), rover.readings())
        rover.move(wheels, 1.0 / 48.0)
        for peer, data in listener.receive(rover.time_s):
            heard += parser.datagram(data)
            if not any(message.get_type() == "MISSION_COUNT" for message in heard):
                listener.send(packer.pack(mavlink.MAVLink_mission_request_list_message(1, 1)), peer, rover.time_s)
    names = {message.get_type() for message in heard}
    assert names >= {"HEARTBEAT", "GLOBAL_POSITION_INT", "ATTITUDE", "MISSION_CURRENT", "MISSION_COUNT"}
    assert "MISSION_REQUEST_INT" not in names  # what is said to the companion is not said to others
    told = [(text.get_srcComponent(), text.severity) for text in heard if "risk 31 %" in getattr(text, "text", "")]
    assert told == [(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, mavlink.MAV_SEVERITY_WARNING)]  # once, and as who said it
    assert upload.state is UploadState.DONE
    assert autopilot.mode is Mode.HOLD
    stack.close()
    listener.close()


def test_a_link_that_cannot_open_closes_the_others() -> None:
    from rover_sim.autopilot.autopilot import Autopilot
    from rover_sim.errors import InputError
    from rover_sim.mavlink.transport import parse_url
    from rover_sim.mavlink.udp import UdpIn

    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    port = free.port
    free.close()
    with pytest.raises(InputError, match="unknown kind"):
        MavlinkStack(Origin(), Autopilot(FOOTPRINT, HOME), [f"udpin:127.0.0.1:{port}", "nonsense"])
    UdpIn(parse_url(f"udpin:127.0.0.1:{port}")).close()


def refuse(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Times at which the autopilot, which is not ready, is asked to start the mission."""
    asked: list[float] = []

    def start_mission() -> str:
        asked.append(pair.time_s)
        return "not now"

    monkeypatch.setattr(pair.autopilot, "start_mission", start_mission)
    return asked


def test_a_refused_start_is_asked_for_again_until_it_is_granted(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = Pair()
    pair.run(0.5)
    with monkeypatch.context() as patch:
        asked = refuse(pair, patch)
        pair.companion.drive(pair.items((5.0, 0.0)), pair.time_s)
        pair.run(5.0)
    assert np.diff(asked) == pytest.approx([2.0, 2.0], abs=0.1)
    pair.run(2.5)
    assert pair.companion.status.mode == Mode.AUTO


@pytest.mark.parametrize("by", ["person", "planner"])
def test_a_refused_start_is_given_up_when_something_else_is_wanted(by: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pair = Pair()
    pair.run(0.5)
    asked = refuse(pair, monkeypatch)
    pair.companion.drive(pair.items((5.0, 0.0)), pair.time_s)
    pair.run(1.0)
    if by == "person":
        pair.autopilot.set_mode(Mode.MANUAL)
    else:
        pair.companion.turn_to(1.0)
    pair.run(5.0)
    assert len(asked) == 1
