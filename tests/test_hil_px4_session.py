"""Our physics as the simulator of a PX4 in memory: who drives, who restarts, who never comes."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from msgspec import structs

from rover_sim.errors import LinkError
from rover_sim.hil.session import Watchers
from tests.px4_checks import Checks
from tests.px4_double import MemoryPx4, Outputs, Px4Double, armed_from
from tests.px4_rig import Drive, session
from tests.sim_factory import make_world, slope
from worlds.fault_events import Event


def paced(link: MemoryPx4) -> float:
    """Nothing: time in memory passes with the steps."""
    link.now_s += 0.004
    return 0.0


def steered(checks: Checks) -> Outputs:
    """Straight on for two seconds, then a turn to the right: the left side ahead."""
    if checks.elapsed_usec < 1_000_000:
        return Outputs()
    return Outputs(True, 0.5, 0.5) if checks.elapsed_usec < 3_000_000 else Outputs(True, -0.3, 0.3)


def test_px4_drives_the_rover_by_what_it_is_told_of_it() -> None:
    px4 = Px4Double(steered)
    link, drive = MemoryPx4(px4, latency_s=0.001), Drive(make_world(slope(0.0, 16.0), heading_deg=90.0), 5.0)
    summary = session(drive, link, link.wait, left_s=lambda _: paced(link)).run()
    truth = px4.checks.believed.truth
    assert truth is not None
    north, east, _ = drive.simulation.chassis_motion[[1, 0, 2]]
    assert north > 0.7
    assert abs(east) < 0.2
    w, x, y, z = truth.attitude_quaternion
    assert 0.1 < np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) < 1.5, "clockwise from north"
    assert (summary["hil"]["steps"], summary["hil"]["restarts"]) == (1250, 0)
    assert summary["hil"]["lockstep"]["most_steps"] <= 1
    assert summary["hil"]["lockstep"]["given_up"] == 0


@pytest.mark.slow
def test_a_minute_of_physics_in_lockstep() -> None:
    px4 = Px4Double(lambda checks: Outputs(checks.elapsed_usec >= 1_000_000, 0.1, 0.1))
    link, drive = MemoryPx4(px4, latency_s=0.001), Drive(make_world(slope(0.0, 24.0)), 60.0)
    summary = session(drive, link, link.wait, left_s=lambda _: paced(link)).run()
    assert px4.checks.believed.sensors == summary["hil"]["steps"] == 15_000
    assert summary["hil"]["lockstep"]["most_steps"] <= 1
    assert summary["hil"]["lockstep"]["given_up"] == 0


def test_px4_restarts_and_the_traverse_with_it() -> None:
    """The world stands still without a PX4, and begins anew for the next one: time, place and sensors."""
    link = MemoryPx4(Px4Double(armed_from(0.0, 0.5, 0.5)))
    anew, said = Px4Double(armed_from(1.0, 0.2, 0.2)), list[str]()
    world = make_world(slope(0.0, 16.0))
    first = Drive(world, 4.0, lambda step: link.disconnect() if step == 500 else None)
    second = Drive(world, 2.0)

    def wait(handles: tuple[int, ...], seconds: float) -> float:
        if not link.peers(0.0):
            assert first.outputs.wheel_speed_rad_s == (0.0,) * 4
            link.connect(anew)
        return link.wait(handles, seconds)

    served = session([first, second], link, wait, left_s=lambda _: paced(link), watchers=Watchers(say=said.append))
    summary = served.run()
    assert said == ["waiting for PX4 at the link", "PX4 began anew, and the traverse with it"]
    assert (first.steps, second.steps) == (501, 500)
    assert (summary["hil"]["restarts"], summary["hil"]["steps"]) == (1, 500)
    assert anew.checks.believed.sensors == 500
    assert anew.checks.believed.clock_usec == 500 * 4000


def test_without_px4_it_says_what_it_waits_for() -> None:
    link, drive = MemoryPx4(), Drive(make_world(slope(0.0)), 1.0)
    said: list[str] = []
    watchers = Watchers(say=said.append)
    with pytest.raises(LinkError, match="waited 3 s for PX4 at the link"):
        session(drive, link, link.wait, patience_s=3.0, watchers=watchers).run()
    assert said == ["waiting for PX4 at the link"]
    assert sum(link.waited_s) == pytest.approx(3.0)


def test_who_connects_and_says_nothing_is_no_px4() -> None:
    link, drive = MemoryPx4(Px4Double()), Drive(make_world(slope(0.0)), 1.0)
    link.receive(0.0)  # what it said is lost
    with pytest.raises(LinkError, match="a HEARTBEAT of PX4"):
        session(drive, link, link.wait, patience_s=3.0).run()


def test_a_px4_that_does_not_come_back_is_a_lost_link() -> None:
    link = MemoryPx4(Px4Double(armed_from(0.0, 0.5, 0.5)))
    drive = Drive(make_world(slope(0.0)), 4.0, lambda step: link.disconnect() if step == 250 else None)
    summary = session(drive, link, link.wait, left_s=lambda _: paced(link)).run()
    assert (summary["reason"], summary["detail"]) == ("link_lost", "waited 5 s for PX4 at the link")


def test_a_wish_to_stop_is_seen_while_waiting_and_while_driving() -> None:
    link, drive = MemoryPx4(), Drive(make_world(slope(0.0)), 2.0)
    with pytest.raises(KeyboardInterrupt):
        session(drive, link, link.wait, watchers=Watchers(stopped=lambda: True)).run()
    link.connect(Px4Double())
    looks = count()
    watchers = Watchers(stopped=lambda: next(looks) >= 1)
    assert session(drive, link, link.wait, watchers=watchers).run()["reason"] == "aborted"
    assert drive.steps == 250


def test_a_late_physics_is_late_once() -> None:
    """PX4 gives the simulator up after no silence at all: it goes on where it was."""
    event = Event(kind="late_physics", time_s=1.0, stall_s=1.5)
    world = make_world(slope(0.0))
    world = replace(world, scenario=structs.replace(world.scenario, event=(event,)))
    link, drive = MemoryPx4(Px4Double(armed_from(0.0, 0.1, 0.1))), Drive(world, 2.0)
    summary = session(drive, link, link.wait, left_s=lambda _: paced(link)).run()
    assert [seconds for seconds in link.waited_s if seconds > 0.1] == [1.5]
    assert summary["hil"]["steps"] == 500
    assert summary["hil"]["lockstep"]["most_steps"] <= 1
