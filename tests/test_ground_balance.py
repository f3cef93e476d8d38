"""Where the energy goes, and that neither parking nor climbing depends on the time step."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sin

import numpy as np
import pytest

from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation, Work
from rover_sim.sim.vehicle_state import VehicleState
from rover_sim.slope.rig import Setup, plane_world, slope_drive, travel_slip
from tests.sim_factory import make_world, slope
from worlds.geometry import rotation_from_quaternion
from worlds.soil import PRESETS

ROVER = load_rover("husky")


@dataclass(frozen=True)
class Climb:
    work_J: Work
    potential_J: float
    kinetic_J: float
    way_m: float

    @property
    def missing_share(self) -> float:
        accounted = self.potential_J + self.kinetic_J + self.work_J.shear + self.work_J.drag + self.work_J.normal
        return (self.work_J.motors - accounted) / self.work_J.motors


def kinetic_J(state: VehicleState) -> float:
    spin = 0.5 * ROVER.wheel.mass_kg * ROVER.wheel.radius_m**2 + ROVER.motor.rotor_inertia_kg_m2
    speed = state.linear_velocity_w
    return float(0.5 * ROVER.mass_kg * speed @ speed + 0.5 * spin * np.sum(state.wheel_speed_rad_s**2))


def height_m(state: VehicleState) -> float:
    rotation = rotation_from_quaternion(state.pose.quaternion_w)
    return float((state.pose.position_w + rotation @ np.array(ROVER.centre_of_mass_b))[2])


def climb(soil: str, slope_deg: float, gravity: float, step_s: float, length_m: float = 20.0) -> Climb:
    world = make_world(slope(slope_deg, 2.0 * length_m + 6.0), soil, gravity, start=(-length_m, 0.0))
    with Simulation(world, ROVER, np.random.default_rng(0), time_step_s=step_s) as simulation:
        begin = simulation.state
        way = 0.0
        while way < length_m:
            for _ in range(round(0.5 / step_s)):
                simulation.step([2.5] * 4)
            way = float(np.linalg.norm(simulation.state.pose.position_w - begin.pose.position_w))
            assert simulation.time_s < 200.0
        end = simulation.state
        lifted = ROVER.mass_kg * gravity * (height_m(end) - height_m(begin))
        return Climb(simulation.work_J, lifted, kinetic_J(end) - kinetic_J(begin), way)


@pytest.mark.parametrize(
    ("soil", "slope_deg", "gravity"),
    [("loose_sand", 15.0, 9.81), ("firm", 20.0, 9.81), ("mars_sand", 10.0, 3.71), ("dry_sand", 0.0, 3.71)],
)
def test_the_work_of_the_wheels_is_accounted_for_over_a_climb_of_20_m(
    soil: str, slope_deg: float, gravity: float
) -> None:
    done = climb(soil, slope_deg, gravity, 1 / 240)
    assert done.way_m >= 20.0
    assert abs(done.missing_share) < 0.03
    assert abs(done.missing_share) < 0.002  # what we reach; the figure above is what is promised
    assert done.potential_J == pytest.approx(
        ROVER.mass_kg * gravity * done.way_m * sin(radians(slope_deg)), rel=0.01, abs=3.0
    )
    assert done.work_J.shear > 0.0
    assert done.work_J.drag > 0.0


def test_turning_on_the_spot_is_all_loss() -> None:
    with Simulation(make_world(slope(0.0), "loose_sand"), ROVER, np.random.default_rng(0)) as simulation:
        for _ in range(4 * 240):
            simulation.step([-2.0, -2.0, 2.0, 2.0])
        work = simulation.work_J
    assert work.shear + work.drag + work.normal == pytest.approx(work.motors, rel=0.03)
    assert work.shear > work.drag > 0.0


def climbing_slip(soil: str, step_s: float) -> float:
    setup = Setup(soil, 9.81, "husky", 0.0, 0.1)
    return travel_slip(slope_drive(ROVER, setup, "up", 15.0, PRESETS[soil], step_s)[1])


@pytest.mark.parametrize("soil", ["loose_sand", "firm"])
def test_slip_at_15_degrees_does_not_depend_on_the_time_step(soil: str) -> None:
    assert climbing_slip(soil, 1 / 960) == pytest.approx(climbing_slip(soil, 1 / 240), abs=0.01)


def parked_drift_m(soil: str, azimuth_deg: float, step_s: float, seconds: float) -> float:
    world = plane_world(PRESETS[soil], 9.81, 20.0, azimuth_deg, 8.0)
    with Simulation(world, ROVER, np.random.default_rng(0), time_step_s=step_s) as simulation:
        begin = simulation.state.pose.position_w
        for _ in range(round(seconds / step_s)):
            simulation.step([0.0] * 4)
        return float(np.linalg.norm(simulation.state.pose.position_w - begin))


@pytest.mark.parametrize(
    ("soil", "azimuth_deg", "steps_per_s"),
    [("loose_sand", 0.0, 120), ("loose_sand", 90.0, 240), ("firm", 90.0, 120), ("mars_sand", 45.0, 240)],
)
def test_parked_at_20_degrees_for_half_a_minute(soil: str, azimuth_deg: float, steps_per_s: int) -> None:
    assert parked_drift_m(soil, azimuth_deg, 1 / steps_per_s, 30.0) < 0.001


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("steps_per_s", [120, 240, 480, 1000])
@pytest.mark.parametrize(("soil", "azimuth_deg"), [("loose_sand", 0.0), ("loose_sand", 90.0), ("firm", 30.0)])
def test_parked_at_20_degrees_for_ten_minutes(soil: str, azimuth_deg: float, steps_per_s: int) -> None:
    assert parked_drift_m(soil, azimuth_deg, 1 / steps_per_s, 600.0) < 0.01
