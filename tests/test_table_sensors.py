"""Sensors of a scenario's tables in the place of those of the built-in autopilot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import radians
from typing import Any

import msgspec
import numpy as np
import pytest

from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import make_world, slope
from tests.test_fault_runs import drive, plain
from worlds.geometry import euler_from_quaternion, wrap_angle
from worlds.sensor_tables import Actuator, Encoder, Gnss, Imu, Magnetometer
from worlds.types import FloatArray, SensorReadings

ROVER = load_rover("husky")
Look = Callable[[SensorReadings, FloatArray, FloatArray], Any]  # readings, true place and quaternion


def looks(
    look: Look, heading_deg: float = 0.0, slope_deg: float = 0.0, seconds: float = 2.0, **tables: Any
) -> list[Any]:
    """What ``look`` makes of the readings, 48 a second, of a rover that drives ahead."""
    plain_world = make_world(slope(slope_deg, 16.0), heading_deg=heading_deg)
    world = replace(plain_world, scenario=msgspec.structs.replace(plain_world.scenario, **tables))
    with Simulation(world, ROVER, np.random.default_rng(1)) as simulation:
        found = []
        for step in range(int(240 * seconds)):
            if step % 5 == 0:
                pose = simulation.state.pose
                found.append(look(simulation.read_sensors(), pose.position_w, pose.quaternion_w))
            simulation.step([3.0] * 4)
        return found


@pytest.mark.parametrize("heading_deg", [-170.0, -60.0, 0.0, 135.0])
def test_the_compass_of_a_table_tells_the_heading_on_a_slope_too(heading_deg: float) -> None:
    def error(readings: SensorReadings, _: FloatArray, quaternion: FloatArray) -> float:
        assert readings.imu is not None
        assert readings.imu.heading_rad is not None
        return wrap_angle(readings.imu.heading_rad - euler_from_quaternion(quaternion)[2])

    ideal = looks(error, heading_deg, 10.0, 0.5, magnetometer=Magnetometer(noise_uT=0.0, bias_uT=0.0))
    assert np.abs(ideal).max() < 1e-6
    iron = looks(error, heading_deg, 0.0, 0.5, magnetometer=Magnetometer(hard_iron_uT=(2.0, 0.0, 0.0)))
    assert np.abs(iron).max() < 0.25


def test_the_inertial_unit_of_a_table_has_its_own_bias_and_saturates() -> None:
    def felt(readings: SensorReadings, *_: FloatArray) -> tuple[float, ...]:
        assert readings.imu is not None
        return *readings.imu.rate_b, *readings.imu.acceleration_b

    told = np.array(looks(felt, imu=Imu(gyro_bias_deg_s=5.0, accel_range_g=1.1, accel_bias_mg=0.0)))
    assert np.abs(told[:, :3].mean(axis=0)).max() > radians(1.0)
    assert np.abs(told[:, 3:]).max() <= 1.1 * 9.80665
    assert told[0, 5] == pytest.approx(9.81, abs=0.1)  # upward, as the built-in autopilot has it


def test_the_receiver_of_a_table_tells_where_the_rover_was() -> None:
    def place(readings: SensorReadings, position: FloatArray, _: FloatArray) -> tuple[float, Any, float]:
        return readings.time_s, readings.gnss, float(position[0])

    table = Gnss(rate_hz=4.0, delay_s=0.25, horizontal_m=0.0, wander_m=0.0, vertical_m=0.0, velocity_m_s=0.0)
    rows = looks(place, seconds=2.0, gnss=table)
    true_x = {round(time_s, 3): x for time_s, _, x in rows}
    fixes = [(round(time_s, 3), fix) for time_s, fix, _ in rows if fix is not None]
    assert [time_s for time_s, _ in fixes] == [0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75]
    for time_s, fix in fixes:
        assert fix.position_w[0] == pytest.approx(true_x[round(time_s - 0.25, 3)], abs=1e-9)
    outage = msgspec.structs.replace(table, outages_s=((0.5, 1.5),))
    assert [round(time_s, 3) for time_s, fix, _ in looks(place, gnss=outage) if fix is not None] == [0.25, 0.5, 1.75]


def test_coarse_encoders_tell_whole_ticks() -> None:
    speeds = looks(lambda readings, *_: readings.wheel_speed_rad_s[0], encoder=Encoder(counts_per_turn=100))
    ticks = np.array(speeds) / (2.0 * np.pi / 100 * 48)
    assert ticks == pytest.approx(np.round(ticks), abs=1e-9)
    assert {1.0, 2.0} & set(np.round(ticks).tolist())


def test_a_run_with_every_table_reaches_its_goal() -> None:
    tables: dict[str, Any] = {
        "imu": Imu(),
        "magnetometer": Magnetometer(),
        "gnss": Gnss(),
        "encoder": Encoder(counts_per_turn=2000),
        "actuator": Actuator(left_gain=0.97),
    }
    summary = drive(msgspec.structs.replace(plain(), **tables))
    assert summary["reason"] == "goal"
    assert summary["goal_distance_m"] < 0.6
