"""The onboard computer against a real vehicle on a kinematic rover: missions, fail-safe stops, people."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from perception.pipeline import Knowledge, load_knowledge
from planner import navigator, route_following, trouble
from planner.relocation import Located
from planner.route_cost import slope_costs
from planner.route_ground import ElevationMap
from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.stack import MavlinkStack
from rover_sim.mavlink.wire import WireItem
from rover_sim.onboard import STOPS_ALLOWED, OnboardComputer
from tests.mavlink_rig import FOOTPRINT, KinematicRover, Station
from worlds.geometry import camera_pose
from worlds.scenario import Origin
from worlds.types import CameraModel, Frame, GroundPlane, HeightField

HOME = (0.0, 0.0, 0.0)
CAMERA = CameraModel(320, 240, 207.8, (0.3, 0.0, 1.1), float(np.radians(25.0)))
SAND = np.random.default_rng(1).normal((200.0, 160.0, 110.0), 2.0, (240, 320, 3)).clip(0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def knowledge() -> Knowledge:
    return load_knowledge("rendered")


class Drive:
    """Rover, autopilot, link and onboard computer on bare sand, a picture each half second."""

    def __init__(self, goal_w: tuple[float, float], knowledge: Knowledge) -> None:
        self.rover = KinematicRover()
        self.autopilot = Autopilot(FOOTPRINT, HOME)
        self.stack = MavlinkStack(Origin(), self.autopilot)
        plan = navigator.begin(goal_w, 0.5, FOOTPRINT, (0.0, 0.0))
        self.onboard = OnboardComputer(self.stack.companion, self.stack.frame, HOME, plan, knowledge)
        self._ticks = 0

    def run(self, until: Callable[[], bool], limit_s: float) -> None:
        end = self.rover.time_s + limit_s
        while not until():
            assert self.rover.time_s < end, f"not within {limit_s} s"
            self._tick()

    def _tick(self) -> None:
        estimate, readings, time_s = self.rover.estimate(), self.rover.readings(), self.rover.time_s
        wheels = self.autopilot.update(time_s, estimate, readings)
        self.stack.tick(time_s, estimate, readings)
        self.onboard.tick(estimate)
        if self._ticks % 24 == 0:
            ground = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
            pose = camera_pose(estimate.pose, CAMERA)
            self.onboard.look(Frame(time_s, SAND, CAMERA, pose, ground), partial(Located, estimate=estimate), time_s)
        self._ticks += 1
        self.rover.move(wheels, 1.0 / 48.0)


def test_it_arms_drives_by_mission_and_holds_at_the_goal(knowledge: Knowledge) -> None:
    drive = Drive((6.0, 1.0), knowledge)
    drive.run(lambda: drive.onboard.plan.end is not None, 40.0)
    assert drive.onboard.plan.end is not None
    assert drive.onboard.plan.end.kind == "arrived"
    assert np.hypot(drive.rover.x_m - 6.0, drive.rover.y_m - 1.0) < 0.5
    drive.run(lambda: drive.autopilot.mode is Mode.HOLD, 1.0)
    # On bare ground the first way leads to the goal: nothing else is worth sending.
    assert drive.onboard.counts.missions_sent <= 3
    assert drive.onboard.counts.waypoints_sent >= 1


def test_a_slip_stop_is_noted_avoided_and_driven_out_of(knowledge: Knowledge) -> None:
    drive = Drive((8.0, 0.0), knowledge)
    drive.run(lambda: drive.rover.x_m > 2.0, 20.0)
    drive.rover.slip = 0.7
    drive.run(lambda: drive.onboard.counts.failsafe_stops == 1, 20.0)
    drive.rover.slip = 0.0
    assert "lip" in drive.onboard.stop_text
    assert len(drive.onboard.plan.avoid_w) == 1
    drive.run(lambda: drive.onboard.plan.end is not None, 90.0)
    assert drive.onboard.plan.end is not None
    assert drive.onboard.plan.end.kind == "arrived"


def test_stops_without_getting_on_exhaust_it(knowledge: Knowledge) -> None:
    drive = Drive((8.0, 0.0), knowledge)
    drive.rover.slip = 1.0
    drive.run(lambda: drive.onboard.exhausted or drive.onboard.plan.end is not None, 300.0)
    stops = drive.onboard.counts.failsafe_stops
    assert stops > STOPS_ALLOWED or (drive.onboard.plan.end is not None and drive.onboard.plan.end.kind == "no_path")


def test_with_a_route_another_way_is_tried_where_the_rover_cannot_get_on(knowledge: Knowledge) -> None:
    drive = Drive((8.0, 0.0), knowledge)
    flat = ElevationMap.of(HeightField(np.zeros((61, 61)), 1.0, (-30.0, -30.0)))
    costs = slope_costs("mars_sand", FOOTPRINT, "husky")
    route = route_following.begin(flat, costs, (0.0, 0.0), (25.0, 0.0), 0.5)
    plan = navigator.begin((25.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    computer = OnboardComputer(drive.stack.companion, drive.stack.frame, HOME, plan, knowledge, route=route)
    for stop in range(STOPS_ALLOWED + 1):
        estimate = replace(drive.rover.estimate(), time_s=15.0 * stop)
        computer._note_stop(estimate)
        assert not computer.exhausted
    assert computer.route is not None
    assert computer.route.refusals == 1
    assert computer.route.reasons[0].startswith("stopped 7 times about one place")
    assert computer.route.route.cost > route.route.cost
    assert computer.plan.end is None
    assert computer.plan.ladder.back_first


def test_a_person_who_sets_hold_keeps_the_rover_until_auto_is_set_again(knowledge: Knowledge) -> None:
    drive = Drive((8.0, 0.0), knowledge)
    drive.run(lambda: drive.rover.x_m > 1.0, 20.0)
    drive.autopilot.set_mode(Mode.HOLD)
    drive.run(lambda: drive.onboard.doing == "taken over", 2.0)
    sent, start = drive.onboard.counts.missions_sent, drive.rover.time_s
    drive.run(lambda: drive.rover.time_s > start + 5.0, 10.0)
    assert drive.autopilot.mode is Mode.HOLD
    assert drive.onboard.counts.missions_sent == sent
    drive.autopilot.set_mode(Mode.AUTO)
    drive.run(lambda: drive.onboard.plan.end is not None, 40.0)
    assert drive.onboard.plan.end is not None
    assert drive.onboard.plan.end.kind == "arrived"


class Shared(Drive):
    """A drive with a ground station on a link of its own; asks it as a `Yard` does."""

    def __init__(self, goal_w: tuple[float, float], knowledge: Knowledge, monkeypatch: pytest.MonkeyPatch) -> None:
        self.station = Station()
        monkeypatch.setattr("rover_sim.mavlink.stack.open_links", lambda *_: ([self.station.link], None))
        super().__init__(goal_w, knowledge)

    def upload(self, items: list[WireItem]) -> int:
        """A whole upload by the person; its result."""
        self._send(mavlink.MAVLink_mission_count_message(1, 1, len(items)))
        while True:
            self._tick()
            self.station.listen(self.rover.time_s)
            for message in self.station.take("MISSION_REQUEST_INT", "MISSION_ACK"):
                if message.get_type() == "MISSION_ACK":
                    return int(message.type)
                self._send(items[message.seq].message(1, 1, message.seq))

    def clear(self) -> None:
        self._send(mavlink.MAVLink_mission_clear_all_message(1, 1))
        self._tick()

    def wait(self, seconds: float) -> None:
        end = self.rover.time_s + seconds
        self.run(lambda: self.rover.time_s >= end, seconds + 1.0)

    def _send(self, message: Message) -> None:
        self.station.send(message, self.rover.time_s)


ASIDE = mission_items([(1.0, 4.0, 0.0)], LocalFrame(Origin()), HOME)


def test_a_persons_mission_stands_until_it_is_cleared(knowledge: Knowledge, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Shared((9.0, 0.0), knowledge, monkeypatch)
    drive.run(lambda: drive.rover.x_m > 1.0, 20.0)
    assert drive.upload(ASIDE) == 0
    drive.run(lambda: drive.onboard.doing == "taken over", 1.0)
    sent = drive.onboard.counts.missions_sent
    drive.run(lambda: drive.rover.y_m > 3.0, 40.0)  # it is driven, in Auto, and to its end
    drive.wait(10.0)
    assert drive.onboard.counts.missions_sent == sent
    assert [item.x for item in drive.stack.vehicle.store.items] == [item.x for item in ASIDE]
    refused = drive.stack.companion.upload(ASIDE[:1], drive.rover.time_s)  # even if it tried
    drive.wait(1.0)
    assert "denied" in refused.reason
    drive.clear()
    drive.run(lambda: drive.onboard.plan.end is not None, 60.0)
    assert drive.onboard.plan.end is not None
    assert drive.onboard.plan.end.kind == "arrived"


def test_the_planners_own_mission_sent_back_unchanged_stays_its_own(
    knowledge: Knowledge, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = Shared((9.0, 0.0), knowledge, monkeypatch)
    drive.run(lambda: drive.rover.x_m > 1.0, 20.0)
    assert drive.upload(list(drive.stack.vehicle.store.items)) == 0
    drive.wait(0.5)
    assert drive.onboard.doing == "drive"
    assert drive.stack.companion.upload(ASIDE, drive.rover.time_s).state == "sending"
    drive.run(lambda: drive.stack.companion.owns_mission is True, 2.0)
    drive.wait(1.0)
    assert [item.x for item in drive.stack.vehicle.store.items] == [item.x for item in ASIDE]


def test_in_hold_a_cleared_mission_is_offered_again_and_auto_starts_it(
    knowledge: Knowledge, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = Shared((9.0, 0.0), knowledge, monkeypatch)
    drive.run(lambda: drive.rover.x_m > 1.0, 20.0)
    drive.autopilot.set_mode(Mode.HOLD)
    drive.upload(ASIDE)
    drive.wait(2.0)
    drive.clear()
    drive.wait(3.0)
    assert drive.autopilot.mode is Mode.HOLD
    assert drive.onboard.doing == "taken over"
    assert drive.stack.vehicle.store.items  # the planner's, so that Auto is possible
    assert drive.autopilot.set_mode(Mode.AUTO) is None
    drive.run(lambda: drive.onboard.plan.end is not None, 60.0)


def test_a_person_goes_first_in_the_middle_of_the_planners_upload(
    knowledge: Knowledge, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = Shared((9.0, 0.0), knowledge, monkeypatch)
    drive.run(lambda: drive.rover.x_m > 1.0, 20.0)
    way = mission_items([(2.0 + 0.1 * step, 0.0, 0.0) for step in range(60)], LocalFrame(Origin()), HOME)
    upload = drive.stack.companion.upload(way, drive.rover.time_s)
    drive.wait(0.3)
    assert upload.state == "sending"
    assert drive.upload(ASIDE) == 0
    assert (upload.state, upload.reason) == ("failed", "cancelled by the vehicle")
    assert [item.x for item in drive.stack.vehicle.store.items] == [item.x for item in ASIDE]


def test_what_the_person_cleared_under_way_is_sent_again(knowledge: Knowledge, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Shared((9.0, 0.0), knowledge, monkeypatch)
    drive.run(lambda: drive.rover.x_m > 1.0, 20.0)
    drive.clear()
    assert not drive.stack.vehicle.store.items
    drive.run(lambda: bool(drive.stack.vehicle.store.items), 2.0)
    drive.run(lambda: drive.onboard.plan.end is not None, 60.0)


def test_ground_stations_see_each_new_plan_by_its_id_and_no_plan_is_sent_twice(
    knowledge: Knowledge, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = Shared((9.0, 0.0), knowledge, monkeypatch)
    drive.run(lambda: drive.rover.x_m > 3.0, 30.0)
    drive.onboard.plan = trouble.note_trouble(drive.onboard.plan, drive.rover.estimate())  # something to plan around
    drive.run(lambda: drive.onboard.plan.end is not None, 90.0)
    drive.station.listen(drive.rover.time_s)
    ids = [message.mission_id for message in drive.station.take("MISSION_CURRENT")]
    seen = [after for before, after in pairwise(ids) if after != before]
    assert len(seen) == len(set(seen)) == drive.onboard.counts.missions_sent
