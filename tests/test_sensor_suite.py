from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from rover_sim.sim.sensed import FixType, GnssSample, Sensed
from rover_sim.sim.sensor_suite import SensorSuite
from tests.sim_factory import make_world, slope
from worlds.sensor_tables import Gnss
from worlds.types import World

WORLD = make_world(slope(0.0))


def still(time_s: float) -> NedState:
    return NedState(
        time_s, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0, 0.0, -STANDARD_GRAVITY_M_S2)
    )


def with_gnss(table: Gnss) -> World:
    return replace(WORLD, scenario=msgspec.structs.replace(WORLD.scenario, gnss=table))


def record(world: World, seconds: float, hz: int = 240) -> list[Sensed]:
    suite = SensorSuite(world)
    return [suite.read(still(step / hz)) for step in range(int(seconds * hz))]


def fixes(world: World, seconds: float, hz: int = 240) -> list[tuple[float, GnssSample]]:
    return [(sensed.time_s, sensed.gnss) for sensed in record(world, seconds, hz) if sensed.gnss is not None]


def test_each_sensor_comes_at_its_own_rate() -> None:
    samples = record(WORLD, 2.0)
    assert all(sample.imu is not None for sample in samples)
    assert sum(sample.magnetometer is not None for sample in samples) == 100
    assert sum(sample.barometer is not None for sample in samples) == 100
    assert sum(sample.gnss is not None for sample in samples) == 10


def test_the_same_seed_gives_the_same_samples_and_another_gives_others() -> None:
    assert record(WORLD, 0.5) == record(WORLD, 0.5)
    assert record(WORLD, 0.1) != record(replace(WORLD, seed=1), 0.1)


def test_a_second_reading_of_an_instant_repeats_the_first() -> None:
    suite = SensorSuite(WORLD)
    assert suite.read(still(0.1)) is suite.read(still(0.1))


def test_a_report_comes_its_delay_after_its_measurement() -> None:
    reports = fixes(with_gnss(Gnss(delay_s=0.25, rate_hz=10.0)), 1.0)
    assert [round(240 * report.time_s) for _, report in reports] == [24 * number for number in range(8)]
    assert all(round(240 * (told_s - report.time_s)) == 60 for told_s, report in reports)


def test_no_fix_within_an_outage_and_a_fix_at_its_end() -> None:
    reports = fixes(with_gnss(Gnss(delay_s=0.0, outages_s=((1.0, 2.0),))), 3.0)
    lost = [round(report.time_s, 6) for _, report in reports if report.fix is FixType.NONE]
    assert lost == [1.0, 1.2, 1.4, 1.6, 1.8]
    assert all(report.satellites == (0 if report.fix is FixType.NONE else 18) for _, report in reports)


def test_no_reports_where_the_scenario_has_no_receiver() -> None:
    assert not fixes(make_world(slope(0.0), gnss=False), 1.0)


def test_spread_of_the_fixes_is_what_they_claim() -> None:
    table = Gnss(delay_s=0.0, rate_hz=20.0, horizontal_m=0.3, wander_m=0.4, wander_time_s=2.0, vertical_m=1.0)
    reports = fixes(with_gnss(table), 400.0, hz=20)
    places = np.array([report.position_m for _, report in reports])
    claimed = np.array([reports[0][1].horizontal_sd_m] * 2 + [reports[0][1].vertical_sd_m])
    assert claimed[0] == 0.5
    assert np.abs(places.std(axis=0) / claimed - 1.0).max() < 0.12
    assert np.abs(np.std([report.velocity_m_s for _, report in reports], axis=0) / 0.05 - 1.0).max() < 0.05
