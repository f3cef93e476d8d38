from __future__ import annotations

from dataclasses import replace
from math import exp

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.sim.actuator import Actuators, answer
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import make_world, slope
from worlds.sensor_tables import Actuator


def test_small_commands_do_nothing_and_full_ones_everything() -> None:
    table = Actuator(dead_band=0.2)
    assert [answer(command, 1.0, table) for command in (0.0, 0.2, -0.2, 0.6, 1.0, -1.0)] == pytest.approx(
        [0.0, 0.0, 0.0, 0.5, 1.0, -1.0]
    )


def test_commands_beyond_the_limit_are_clipped() -> None:
    table = Actuator(dead_band=0.0, limit=0.5)
    assert answer(3.0, 1.0, table) == answer(0.5, 1.0, table) == 0.5
    assert answer(-3.0, 0.8, table) == -0.4


@given(st.floats(-2.0, 2.0), st.floats(0.0, 0.5))
def test_an_answer_has_the_sign_of_its_command_and_is_odd(command: float, dead_band: float) -> None:
    table = Actuator(dead_band=dead_band)
    assert answer(-command, 1.0, table) == -answer(command, 1.0, table)
    assert answer(command, 1.0, table) * command >= 0.0


def test_the_lag_is_of_first_order_whatever_the_step() -> None:
    table = Actuator(lag_s=0.5, dead_band=0.0)
    for steps in (10, 100):
        actuators = Actuators(table, 4, 6.0)
        for _ in range(steps):
            speeds = actuators.step([3.0] * 4, 0.5 / steps)
        assert speeds == pytest.approx([3.0 * (1.0 - exp(-1.0))] * 4)


def test_the_sides_have_gains_of_their_own() -> None:
    actuators = Actuators(Actuator(lag_s=0.0, dead_band=0.0, left_gain=0.9, right_gain=1.1), 4, 6.0)
    assert actuators.step([1.0] * 4, 0.01) == pytest.approx([0.9, 0.9, 1.1, 1.1])


def test_a_mismatch_of_the_sides_turns_a_rover_that_is_told_to_drive_ahead() -> None:
    plain = make_world(slope(0.0))
    table = Actuator(left_gain=0.8)
    world = replace(plain, scenario=msgspec.structs.replace(plain.scenario, actuator=table))
    with Simulation(world, load_rover("husky"), np.random.default_rng(1)) as simulation:
        for _ in range(360):
            simulation.step([2.0] * 4)
        state = simulation.state
        assert state.wheel_speed_rad_s[2:] == pytest.approx([6.0 * (2.0 / 6.0 - 0.02) / 0.98] * 2, abs=0.02)
        assert state.wheel_speed_rad_s[:2] == pytest.approx(0.8 * state.wheel_speed_rad_s[2:], abs=0.02)
        assert state.angular_velocity_w[2] > 0.05  # to the left, the slower side
