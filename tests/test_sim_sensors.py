from __future__ import annotations

import numpy as np
import pytest

from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import make_world, slope

ROVER = load_rover("husky")


def test_gnss_comes_five_times_a_second_and_near_the_truth() -> None:
    with Simulation(make_world(slope(0.0)), ROVER, np.random.default_rng(1)) as simulation:
        fixes, errors = 0, []
        for step in range(480):
            simulation.step([1.0] * 4)
            if step % 6 == 5:
                reading = simulation.read_sensors()
                if reading.gnss is not None:
                    fixes += 1
                    errors.append(np.array(reading.gnss.position_w) - simulation.state.pose.position_w)
        assert fixes == 11  # one at the first reading, then on 0.2 s, 0.4 s ... 2.0 s
        assert np.abs(errors).max() < 0.15


def test_no_gnss_where_the_scenario_has_none() -> None:
    with Simulation(make_world(slope(0.0), gnss=False), ROVER, np.random.default_rng(1)) as simulation:
        for _ in range(100):
            simulation.step([0.0] * 4)
            assert simulation.read_sensors().gnss is None


def test_accelerometer_of_a_parked_rover_feels_gravity() -> None:
    with Simulation(make_world(slope(10.0), "firm", 3.71), ROVER, np.random.default_rng(2)) as simulation:
        felt = []
        for step in range(240):
            simulation.step([0.0] * 4)
            if step % 12 == 11:
                imu = simulation.read_sensors().imu
                assert imu is not None
                felt.append(imu.acceleration_b)
        mean = np.mean(felt, axis=0)
        pitch = np.radians(10.0)  # nose up: gravity's reaction has a forward part
        assert mean == pytest.approx([3.71 * np.sin(pitch), 0.0, 3.71 * np.cos(pitch)], abs=0.12)


def test_encoders_count_what_the_wheels_turn() -> None:
    with Simulation(make_world(slope(0.0)), ROVER, np.random.default_rng(3)) as simulation:
        for _ in range(240):
            simulation.step([2.0, 2.0, 1.0, 1.0])
        simulation.read_sensors()
        for _ in range(24):
            simulation.step([2.0, 2.0, 1.0, 1.0])
        speeds = simulation.read_sensors().wheel_speed_rad_s
        assert speeds == pytest.approx([2.0, 2.0, 1.0, 1.0], abs=2 * np.pi / 16384 / 0.1 + 1e-3)


def test_second_reading_of_an_instant_repeats_the_first() -> None:
    with Simulation(make_world(slope(0.0)), ROVER, np.random.default_rng(3)) as simulation:
        simulation.step([0.0] * 4)
        assert simulation.read_sensors() is simulation.read_sensors()
