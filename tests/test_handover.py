"""Plans in the hands of doubles of foreign autopilots, in simulated time: on board, driven, refused, taken over."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import pytest

from rover_sim.autopilot.modes import Mode
from rover_sim.handover import Ending, Handover, HandoverEnd, summary
from rover_sim.handover_plans import HandoverPlan
from rover_sim.mavlink.foreign_pursuit import Patience
from rover_sim.mavlink.memory import MemoryEnd
from tests.ardupilot_mavlink_double import AUTO, AUTO_S, HOLD, MANUAL, ArduRoverDouble
from tests.foreign_rig import ForeignPair
from tests.px4_mavlink_double import LOITER, Px4RoverDouble
from tests.vehicle_double import VehicleDouble

PLACES = ((5.0, 0.0), (5.0, 4.0))


class Handed:
    """A double, and a plan for it."""

    def __init__(
        self,
        double: Callable[[MemoryEnd], VehicleDouble] = ArduRoverDouble,
        *,
        start: bool = True,
        start_s: float = 60.0,
        limit_s: float = 300.0,
        places: tuple[tuple[float, float], ...] = PLACES,
        patience: Patience | None = None,
    ) -> None:
        self.pair = ForeignPair(double, start_s=start_s, patience=patience)
        plan = HandoverPlan(tuple(self.pair.items(*places, speed_m_s=0.8)), "a test")
        self.handover = Handover(self.pair.companion, plan, start=start, limit_s=limit_s)
        self.said: list[str] = []
        self.ending: Ending | None = None
        self.pair.tick = self._step

    def _step(self, time_s: float) -> None:
        self.ending = self.handover.step(time_s)
        if not self.said or self.said[-1] != self.handover.doing:
            self.said.append(self.handover.doing)

    def to_the_end(self, limit_s: float = 200.0) -> HandoverEnd:
        self.pair.until(lambda: self.ending is not None, limit_s)
        assert self.ending is not None
        return self.ending.end


def under_way(handed: Handed) -> ArduRoverDouble:
    """The vehicle drives somebody's mission already."""
    double = handed.pair.double
    assert isinstance(double, ArduRoverDouble)
    double.time_s, double.armed, double.missions.items = handed.pair.time_s, True, handed.pair.items((30.0, 0.0))
    assert double.set_mode(AUTO) == 0
    return double


def test_without_a_start_the_mission_is_on_board_and_nothing_moves() -> None:
    handed = Handed(start=False, start_s=0.0)
    assert handed.to_the_end(10.0) is HandoverEnd.UPLOADED  # long before the vehicle could drive
    assert handed.ending is not None
    assert handed.ending.detail == "2 waypoints are on board, read back as they were sent"
    handed.pair.run(80.0)
    assert not {400, 176, 300} & set(handed.pair.double.commands)
    assert (handed.pair.double.armed, handed.pair.double.custom_mode) == (False, MANUAL)


@pytest.mark.parametrize(("double", "held"), [(ArduRoverDouble, HOLD), (Px4RoverDouble, LOITER)])
def test_from_the_first_heartbeat_to_the_end_of_the_mission(
    double: Callable[[MemoryEnd], VehicleDouble], held: int
) -> None:
    handed = Handed(double, start_s=0.0)
    assert handed.to_the_end() is HandoverEnd.COMPLETE
    assert handed.ending is not None
    assert handed.pair.double.custom_mode == held  # in Auto the next mission would be driven at once
    table = summary(handed.handover, handed.ending, "memory")
    json.dumps(table, allow_nan=False)
    chosen = ("success", "reason", "items", "waypoints", "waypoints_reached", "started")
    assert [table[key] for key in chosen] == [True, "complete", 4, 2, 2, True]
    assert "ground rover" in table["autopilot"]
    motion = handed.pair.rover.motion
    assert (motion.east_m, motion.north_m) == pytest.approx((5.0, 4.0), abs=0.4)
    assert handed.said[0] == "waiting for the state of its estimator"
    assert any(text.startswith("waiting for a position") for text in handed.said)
    assert any(text.startswith("item 2 of 3") and "m to the end" in text for text in handed.said)


def test_a_vehicle_under_way_holds_for_the_new_mission() -> None:
    handed = Handed()
    double = under_way(handed)
    assert handed.to_the_end() is HandoverEnd.COMPLETE
    assert not double.started_torn


def test_without_a_start_a_vehicle_under_way_is_left_alone() -> None:
    handed = Handed(start=False)
    double = under_way(handed)
    assert handed.to_the_end() is HandoverEnd.MISSION_REFUSED
    assert (double.custom_mode, len(double.missions.items)) == (AUTO, 2)


def test_a_way_that_begins_far_from_the_vehicle_is_not_started() -> None:
    handed = Handed(places=((2000.0, 0.0), (2001.0, 0.0)))
    assert handed.to_the_end() is HandoverEnd.TOO_FAR
    assert handed.ending is not None
    assert handed.ending.detail == "the way begins 2000 m from the vehicle; allowed: 1000 m"
    assert not handed.pair.double.armed
    assert 176 not in handed.pair.double.commands


def test_a_refused_item_is_named() -> None:
    handed = Handed(Px4RoverDouble)
    plan = handed.handover.plan
    handed.handover.plan = replace(plan, items=(*plan.items[:3], replace(plan.items[3], command=31337)))
    assert handed.to_the_end() is HandoverEnd.MISSION_REFUSED
    assert handed.ending is not None
    assert "item 3 (command 31337): command not supported" in handed.ending.detail
    assert not handed.pair.double.armed


def test_a_refused_arming_is_told_with_the_vehicles_words() -> None:
    handed = Handed(
        lambda end: ArduRoverDouble(end, never_ready="Battery below minimum arming voltage"),
        patience=Patience(armed_s=10.0),
    )
    assert handed.to_the_end() is HandoverEnd.NOT_ARMED
    assert handed.ending is not None
    assert "PreArm: Battery below minimum arming" in handed.ending.detail


def test_a_vehicle_that_is_not_ready_in_time_is_told_with_what_it_lacks() -> None:
    handed = Handed(start_s=0.0, patience=Patience(ready_s=20.0))
    assert handed.to_the_end() is HandoverEnd.NOT_READY
    assert handed.pair.time_s < 22.0 < AUTO_S
    assert handed.ending is not None
    assert "within 20 s: it waits for a position (estimator flags 167)" in handed.ending.detail


def test_what_was_armed_for_nothing_is_disarmed() -> None:
    class Stubborn(ArduRoverDouble):
        """Refuses Auto."""

        def set_mode(self, number: int) -> int:
            return 4 if number == AUTO else super().set_mode(number)

    handed = Handed(Stubborn, patience=Patience(started_s=8.0))
    handed.pair.until(lambda: handed.pair.double.armed, 20.0)
    assert handed.to_the_end() is HandoverEnd.NOT_STARTED
    assert handed.ending is not None
    assert handed.ending.detail == "it does not change its mode: failed"
    assert not handed.pair.double.armed


def test_a_person_who_changes_the_mode_has_the_vehicle() -> None:
    handed = Handed()
    double = handed.pair.double
    handed.pair.until(lambda: handed.handover.begun_s is not None, 20.0)
    assert isinstance(double, ArduRoverDouble)
    double.set_mode(HOLD)
    double.say(4, "Mode changed by RC")
    assert handed.to_the_end() is HandoverEnd.TAKEN_OVER
    assert handed.ending is not None
    assert handed.ending.detail == "the vehicle is in Hold: Mode changed by RC"
    assert double.commands.count(176) == 1  # only the start was ours


def test_an_interrupted_drive_holds_and_so_does_one_that_takes_too_long() -> None:
    handed = Handed()
    handed.pair.until(lambda: handed.handover.begun_s is not None, 20.0)
    handed.pair.run(2.0)
    assert handed.handover.abort("interrupted") is None
    assert handed.to_the_end() is HandoverEnd.ABORTED
    assert handed.pair.double.custom_mode == HOLD

    slow = Handed(limit_s=5.0, places=((30.0, 0.0),))
    assert slow.to_the_end() is HandoverEnd.TIMEOUT
    assert slow.pair.double.custom_mode == HOLD
    assert slow.pair.companion.status.mode == Mode.HOLD


def test_a_vehicle_that_falls_silent_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    handed = Handed()
    handed.pair.until(lambda: handed.handover.begun_s is not None, 20.0)
    double = handed.pair.double
    monkeypatch.setattr(double, "send", lambda _message: None)
    assert handed.to_the_end(20.0) is HandoverEnd.LINK_LOST
