from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.events import Reached, Text
from rover_sim.autopilot.mission import (
    DriveTo,
    Home,
    Item,
    Jump,
    Mission,
    ReturnHome,
    SetFence,
    SetHome,
    SetReverse,
    SetSpeed,
    TurnTo,
    Wait,
)
from rover_sim.autopilot.modes import MissionState, Mode
from tests.mavlink_rig import FOOTPRINT, KinematicRover

STEP_S = 1.0 / 48.0


class Drive:
    """An autopilot with a rover that obeys it."""

    def __init__(self) -> None:
        self.rover = KinematicRover()
        self.autopilot = Autopilot(FOOTPRINT, (0.0, 0.0, 0.0))
        self.texts: list[str] = []
        self.reached: list[int] = []
        self.track: list[tuple[float, float]] = []
        self.step()

    def step(self) -> None:
        wheels = self.autopilot.update(self.rover.time_s, self.rover.estimate(), self.rover.readings())
        self.rover.move(wheels, STEP_S)
        self.track.append((self.rover.x_m, self.rover.y_m))
        for event in self.autopilot.take_events():
            if isinstance(event, Text):
                self.texts.append(event.text)
            if isinstance(event, Reached):
                self.reached.append(event.index)

    def until(self, done: Callable[[], bool], limit_s: float = 60.0) -> None:
        end = self.rover.time_s + limit_s
        while not done():
            assert self.rover.time_s < end, "time limit"
            self.step()

    def begin(self, *items: Item) -> None:
        self.autopilot.set_mission(Mission(items))
        assert self.autopilot.arm() is None
        assert self.autopilot.start_mission() is None

    def state(self) -> MissionState:
        return self.autopilot.auto.state

    def complete(self) -> bool:
        return self.autopilot.auto.state is MissionState.COMPLETE


def test_it_drives_its_waypoints_in_order_and_says_so() -> None:
    drive = Drive()
    drive.begin(Home(), DriveTo((3.0, 0.0, 0.0)), DriveTo((4.0, 2.0, 0.0)))
    assert drive.autopilot.auto.current == 1
    drive.until(drive.complete)
    drive.until(lambda: drive.autopilot.motion.linear_m_s == 0.0)
    assert drive.reached == [1, 2]
    assert np.hypot(drive.rover.x_m - 4.0, drive.rover.y_m - 2.0) < 0.35
    assert "Mission complete" in drive.texts
    assert drive.autopilot.auto.current == 2


def test_waypoints_are_driven_through_without_a_stop() -> None:
    drive = Drive()
    drive.begin(DriveTo((2.0, 0.0, 0.0)), SetSpeed(0.5), DriveTo((4.0, 0.0, 0.0)))
    speeds = []
    while not drive.complete():
        drive.step()
        if 1.0 < drive.rover.x_m < 2.8:
            speeds.append(drive.autopilot.motion.linear_m_s)
    assert min(speeds) > 0.45
    assert drive.reached == [0, 1, 2]


def test_a_speed_change_holds_until_the_mission_ends() -> None:
    drive = Drive()
    drive.begin(SetSpeed(0.3), DriveTo((2.0, 0.0, 0.0)))
    drive.until(lambda: drive.rover.x_m > 1.0)
    assert drive.autopilot.motion.linear_m_s == pytest.approx(0.3)
    drive.until(drive.complete)
    drive.autopilot.set_mission(Mission((DriveTo((6.0, 0.0, 0.0)),)))
    drive.until(lambda: drive.rover.x_m > 3.5)
    assert drive.autopilot.motion.linear_m_s == pytest.approx(0.6)


def test_backing_up_keeps_the_heading() -> None:
    drive = Drive()
    drive.begin(SetReverse(reverse=True), DriveTo((-1.5, 0.0, 0.0)), SetReverse(reverse=False))
    drive.until(drive.complete)
    assert drive.rover.x_m == pytest.approx(-1.5, abs=0.3)
    assert drive.rover.yaw_rad == pytest.approx(0.0, abs=0.1)


def test_turning_in_place_absolute_and_relative() -> None:
    drive = Drive()
    drive.begin(TurnTo(np.pi / 2), TurnTo(-0.5, relative=True))
    drive.until(drive.complete)
    assert drive.rover.yaw_rad == pytest.approx(np.pi / 2 - 0.5, abs=0.3)
    assert np.hypot(drive.rover.x_m, drive.rover.y_m) < 0.01


def test_holding_and_waiting_take_their_time() -> None:
    drive = Drive()
    drive.begin(DriveTo((0.0, 0.0, 0.0), hold_s=2.0), Wait(3.0))
    start = drive.rover.time_s
    drive.until(drive.complete)
    assert drive.rover.time_s - start == pytest.approx(5.0, abs=0.1)


def test_return_home_item() -> None:
    drive = Drive()
    drive.begin(DriveTo((2.0, 1.0, 0.0)), ReturnHome())
    drive.until(drive.complete)
    assert np.hypot(drive.rover.x_m, drive.rover.y_m) < 0.4


def test_states_are_honest() -> None:
    drive = Drive()
    assert drive.state() is MissionState.NO_MISSION
    drive.autopilot.set_mission(Mission((DriveTo((3.0, 0.0, 0.0)),)))
    assert drive.state() is MissionState.NOT_STARTED
    drive.autopilot.arm()
    drive.autopilot.start_mission()
    assert drive.state() is MissionState.ACTIVE
    drive.until(lambda: drive.rover.x_m > 0.5)
    drive.autopilot.set_mode(Mode.HOLD)
    assert drive.state() is MissionState.PAUSED
    drive.until(lambda: drive.autopilot.motion.linear_m_s == 0.0)
    drive.autopilot.set_mode(Mode.AUTO)
    assert drive.state() is MissionState.ACTIVE
    drive.until(drive.complete)
    drive.autopilot.set_mission(Mission())
    assert drive.state() is MissionState.NO_MISSION


def test_a_new_mission_while_running_begins_with_its_first_item() -> None:
    drive = Drive()
    drive.begin(DriveTo((5.0, 0.0, 0.0)), DriveTo((9.0, 0.0, 0.0)))
    drive.until(lambda: drive.rover.x_m > 1.0)
    drive.autopilot.set_mission(Mission((Home(), DriveTo((1.0, 3.0, 0.0)))))
    assert drive.autopilot.auto.state is MissionState.ACTIVE
    assert drive.autopilot.auto.current == 1
    drive.until(drive.complete)
    assert drive.rover.y_m > 2.6


def test_a_new_mission_after_the_end_is_driven_at_once_in_auto_but_not_in_hold() -> None:
    drive = Drive()
    drive.begin(DriveTo((0.5, 0.0, 0.0)))
    drive.until(drive.complete)
    drive.autopilot.set_mission(Mission((DriveTo((1.5, 0.0, 0.0)),)))
    assert drive.state() is MissionState.ACTIVE
    drive.autopilot.set_mode(Mode.HOLD)
    drive.autopilot.set_mission(Mission((DriveTo((1.5, 0.0, 0.0)),)))
    assert drive.state() is MissionState.NOT_STARTED


def test_a_complete_mission_starts_over_on_demand() -> None:
    drive = Drive()
    drive.begin(DriveTo((0.6, 0.0, 0.0)), DriveTo((1.2, 0.0, 0.0)))
    drive.until(drive.complete)
    assert drive.autopilot.start_mission() is None
    assert drive.autopilot.auto.current == 0
    drive.until(drive.complete)
    assert drive.reached == [0, 1, 0, 1]


def test_jumping_to_an_item() -> None:
    drive = Drive()
    drive.begin(Home(), DriveTo((5.0, 0.0, 0.0)), DriveTo((0.0, 2.0, 0.0)))
    assert drive.autopilot.set_current(2)
    assert not drive.autopilot.set_current(3)
    assert not drive.autopilot.set_current(0)
    drive.until(drive.complete)
    assert drive.reached == [2]


def test_guided_drives_to_a_place_and_keeps_the_mission() -> None:
    drive = Drive()
    drive.begin(DriveTo((5.0, 0.0, 0.0)))
    assert drive.autopilot.goto((0.0, 2.0, 0.0)) is None
    assert drive.autopilot.mode is Mode.GUIDED
    assert drive.autopilot.auto.state is MissionState.PAUSED
    drive.until(lambda: drive.rover.y_m > 1.7)
    drive.until(lambda: drive.autopilot.motion.linear_m_s == 0.0)
    assert drive.autopilot.turn(0.0) is None
    drive.until(lambda: abs(drive.rover.yaw_rad) < 0.2)
    assert drive.reached == []


def test_return_mode_drives_home() -> None:
    drive = Drive()
    drive.begin(DriveTo((2.0, 0.0, 0.0)))
    drive.until(drive.complete)
    assert drive.autopilot.set_mode(11) is None
    drive.until(lambda: drive.rover.x_m < 0.3)


def test_a_jump_repeats_its_items_and_then_lets_the_mission_go_on() -> None:
    drive = Drive()
    drive.begin(Home(), DriveTo((0.5, 0.0, 0.0)), Wait(0.2), Jump(2, 2), Wait(0.2))
    drive.until(drive.complete)
    assert drive.reached == [1, 2, 2, 2, 4]
    drive.reached.clear()
    assert drive.autopilot.start_mission() is None  # begun anew, with all its jumps
    drive.until(drive.complete)
    assert drive.reached.count(2) == 3


def test_a_jump_without_end_and_one_in_a_circle_without_driving() -> None:
    drive = Drive()
    drive.begin(Wait(0.1), Jump(0, -1))
    drive.until(lambda: len(drive.reached) > 20)
    assert drive.state() is MissionState.ACTIVE
    drive.begin(SetSpeed(0.5), Jump(0, -1))
    drive.step()  # comes back
    assert drive.state() is MissionState.ACTIVE
    assert drive.autopilot.set_current(1)


def test_a_mission_may_set_home_and_switch_the_fence() -> None:
    drive = Drive()
    drive.begin(DriveTo((1.0, 0.0, 0.0)), SetHome(), SetFence(on=True), Wait(0.5), SetHome((0.5, 0.5, 0.0)))
    drive.until(lambda: drive.autopilot.auto.current == 3)
    assert drive.autopilot.home_w[0] == pytest.approx(drive.rover.x_m, abs=0.02)
    assert drive.autopilot.parameters["FENCE_ENABLE"] == 1.0
    drive.until(drive.complete)
    assert drive.autopilot.home_w == (0.5, 0.5, 0.0)
