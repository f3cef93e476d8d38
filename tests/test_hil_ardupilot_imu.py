from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec

from rover_sim.hil.ardupilot_imu import ToldMotion
from rover_sim.sim.ned_state import NedState
from tests.sim_factory import make_world, slope
from worlds.fault_events import Event
from worlds.sensor_tables import Imu


def told(**keys: Any) -> ToldMotion:
    plain = make_world(slope(0.0))
    return ToldMotion(replace(plain, scenario=msgspec.structs.replace(plain.scenario, **keys)))


def turning(time_s: float) -> NedState:
    return NedState(
        time_s, (1.0, 2.0, 3.0), (0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, time_s), (0.0, 0.0, -9.8)
    )


def test_without_a_table_the_truth_is_told() -> None:
    assert told().of(turning(1.0)) == turning(1.0)


def test_the_unit_of_a_table_is_told_and_the_rest_stays_true() -> None:
    heard = told(imu=Imu()).of(turning(1.0))
    assert heard.rate_rad_s != turning(1.0).rate_rad_s
    assert replace(heard, rate_rad_s=(0.0, 0.0, 1.0), specific_force_m_s2=(0.0, 0.0, -9.8)) == turning(1.0)


def test_a_silent_unit_repeats_itself() -> None:
    motion = told(event=(Event(kind="sensor_loss", sensor="imu", time_s=1.0, duration_s=1.0),))
    heard = [motion.of(turning(0.5 * step)) for step in range(6)]
    assert [state.rate_rad_s[2] for state in heard] == [0.0, 0.5, 0.5, 0.5, 2.0, 2.5]
    assert [state.time_s for state in heard] == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
