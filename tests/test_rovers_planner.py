"""What the planner makes of rovers with other than four wheels and of what they can climb."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner import monitor
from planner.mobility import Command, body_motion, rim_speeds, wheel_speeds
from planner.monitor import Advice, MonitorState
from planner.obstacle_map import DriveModel, obstacles
from planner.terrain_map import empty_memory, remember
from tests.planner_factory import FOOTPRINT, DiscWorld, look, pose_at

SIX = replace(FOOTPRINT, wheels=6)


@pytest.mark.parametrize("wheels", [4, 6, 8])
def test_speeds_of_any_even_number_of_wheels_give_back_the_motion(wheels: int) -> None:
    footprint = replace(FOOTPRINT, wheels=wheels)
    speeds = wheel_speeds(0.3, 0.2, footprint)
    assert len(speeds) == wheels
    assert len(set(speeds[: wheels // 2])) == len(set(speeds[wheels // 2 :])) == 1
    motion = body_motion(speeds, footprint)
    assert (motion.linear_m_s, motion.yaw_rate_rad_s) == pytest.approx((0.3, 0.2))


def test_sides_are_the_halves_of_the_tuple() -> None:
    # By hand: means 2 and 5 rad/s at a radius of 0.165 m.
    assert rim_speeds((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), SIX) == pytest.approx((0.33, 0.825))


def test_slip_stop_of_a_six_wheeler() -> None:
    state, advice = MonitorState(), Advice.NONE
    for tick in range(200):
        estimate = pose_at(0.0, 0.0, 0.0, tick / 20)
        state, advice = monitor.watch(state, estimate, (2.0,) * 6, Command(0.3, 0.0), SIX)
        if advice is Advice.SLIP_STOP:
            break
    assert advice is Advice.SLIP_STOP
    assert state.slip_left == pytest.approx(state.slip_right)


def test_a_rock_is_hard_for_the_rover_that_cannot_climb_it() -> None:
    world = DiscWorld.of([(3.0, 0.0, 0.2)], height_m=0.12)
    memory = empty_memory(np.zeros(2))
    for tick in range(3):
        memory = remember(memory, look(world, np.zeros(3), 0.5 * tick, None), np.zeros(2))
    low, high = (obstacles(memory.rocks, DriveModel(), climb) for climb in (0.08, 0.20))
    assert low[:, 6].tolist() == [1.0]
    assert high[:, 6].tolist() == [0.0]
    assert low[0, 5] > high[0, 5] > 0.0
