from __future__ import annotations

import hashlib
import subprocess
import sys
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.sim import soil_kernels as kernel
from rover_sim.sim.motion_kernels import MOTION_COLUMNS
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.terramechanics import WheelSoil
from tests.sim_factory import box_mesh, field, make_world, slope
from worlds.geometry import euler_from_quaternion
from worlds.soil import soil_preset
from worlds.types import World

ROVER = load_rover("husky")
SHEAR_RADIUS = ROVER.wheel_shape().shear_radius_m
WEIGHT = ROVER.mass_kg * 9.81


def simulate(world: World) -> Simulation:
    return Simulation(world, ROVER, np.random.default_rng(0))


@pytest.mark.parametrize("soil", ["firm", "loose_sand", "dlr_mars_simulant"])
def test_wheels_of_a_rover_at_rest_carry_its_weight(soil: str) -> None:
    with simulate(make_world(slope(0.0), soil)) as simulation:
        state = simulation.state
        assert simulation.time_s == 0.0
        assert state.normal_force_N.sum() == pytest.approx(WEIGHT, rel=1e-3)
        assert state.normal_force_N == pytest.approx([WEIGHT / 4] * 4, rel=1e-2)
        assert state.stability_margin == pytest.approx(1.0, abs=0.02)
        assert np.abs(state.linear_velocity_w).max() < 1e-3
        # Body origin: wheel radius above the ground, less sinkage and tyre.
        height = ROVER.wheel.radius_m - state.sinkage_m.mean() - WEIGHT / 4 / ROVER.wheel.stiffness_N_m
        assert state.pose.position_w[2] == pytest.approx(height, abs=5e-4)


@pytest.mark.parametrize("soil", ["firm", "loose_sand"])
@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0])
def test_parked_for_a_minute_on_15_degrees(soil: str, azimuth_deg: float) -> None:
    with simulate(make_world(slope(15.0, azimuth_deg=azimuth_deg), soil)) as simulation:
        begin = simulation.state.pose.position_w
        for _ in range(60 * 240):
            simulation.step([0.0] * 4)
        assert np.linalg.norm(simulation.state.pose.position_w - begin) < 0.01


def climb(soil: str, slope_deg: float, speed: float = 0.1) -> float:
    world = make_world(slope(slope_deg, 10.0), soil, start=(-3.0, 0.0))
    with simulate(world) as simulation:
        while simulation.state.pose.position_w[0] < -2.2:  # the rear wheels run in the ruts of the front ones
            for _ in range(240):
                simulation.step([speed / SHEAR_RADIUS] * 4)
        begin = simulation.state.pose.position_w
        for _ in range(2 * 240):
            simulation.step([speed / SHEAR_RADIUS] * 4)
        way = simulation.state.pose.position_w - begin
    return 1.0 - float(way[0] * cos(radians(slope_deg)) + way[2] * sin(radians(slope_deg))) / (2 * speed)


@pytest.mark.parametrize(("slope_deg", "low", "high"), [(0, 0.02, 0.10), (10, 0.14, 0.24), (15, 0.28, 0.45)])
def test_slip_on_loose_sand_is_in_the_published_band(slope_deg: float, low: float, high: float) -> None:
    assert low <= climb("loose_sand", slope_deg) <= high


@pytest.mark.parametrize(("slope_deg", "low", "high"), [(0, -0.03, 0.03), (10, -0.04, 0.04), (20, 0.12, 0.28)])
def test_slip_on_firm_ground_is_in_the_published_band(slope_deg: float, low: float, high: float) -> None:
    assert low <= climb("firm", slope_deg) <= high


def test_a_rover_that_cannot_climb_stays_where_it_is() -> None:
    with simulate(make_world(slope(25.0), "loose_sand")) as simulation:
        begin = simulation.state.pose.position_w
        for _ in range(3 * 240):
            simulation.step([1.0] * 4)
        state = simulation.state
        assert np.linalg.norm(state.pose.position_w - begin) < 0.05
        assert state.slip == pytest.approx([1.0] * 4, abs=0.02)


def test_turning_in_place_needs_the_track_ratio_of_real_rovers() -> None:
    with simulate(make_world(slope(0.0))) as simulation:
        command = [-2.0, -2.0, 2.0, 2.0]
        for _ in range(240):
            simulation.step(command)
        before = simulation.state
        for _ in range(240):
            simulation.step(command)
        after = simulation.state
    turned = euler_from_quaternion(after.pose.quaternion_w)[2] - euler_from_quaternion(before.pose.quaternion_w)[2]
    ratio = 4.0 * SHEAR_RADIUS / ROVER.track_m / turned
    assert 1.3 <= ratio <= 2.0
    assert np.linalg.norm(after.pose.position_w - before.pose.position_w) < 0.005


def test_slip_angle_and_slip_have_the_signs_of_the_definition() -> None:
    with simulate(make_world(slope(0.0), "loose_sand")) as simulation:
        for _ in range(240):
            simulation.step([1.0, 1.0, 3.0, 3.0])  # left turn
        state = simulation.state
    assert (state.slip[:2] < 0).all()  # inner wheels are dragged along
    assert (state.slip[2:] > 0).all()
    # Turning left, front wheels move to their left and rear wheels to their right.
    assert (state.slip_angle_rad[[0, 2]] > 0).all()
    assert (state.slip_angle_rad[[1, 3]] < 0).all()


def test_energy_pays_for_height_and_motion() -> None:
    with simulate(make_world(slope(10.0, 10.0), "firm", start=(-3.0, 0.0))) as simulation:
        begin = simulation.state
        for _ in range(5 * 240):
            simulation.step([2.0] * 4)
        end = simulation.state
    lifted = WEIGHT * (end.pose.position_w[2] - begin.pose.position_w[2])
    moving = 0.5 * ROVER.mass_kg * float(end.linear_velocity_w @ end.linear_velocity_w)
    work = end.energy_J - begin.energy_J - 5.0 * ROVER.motor.idle_power_W
    assert lifted > 100.0
    assert 1.0 < work / (lifted + moving) < 1.35  # slip and compaction take the rest


def test_rough_ground_does_not_jolt() -> None:
    rng = np.random.default_rng(5)
    coarse = rng.normal(0.0, 0.03, (26, 26))
    fine = np.asarray(np.kron(coarse, np.ones((4, 4))), dtype=np.float64)
    for _ in range(3):
        fine = 0.25 * (np.roll(fine, 2, 0) + np.roll(fine, -2, 0) + np.roll(fine, 2, 1) + np.roll(fine, -2, 1))
    speeds = []
    with simulate(make_world(field(fine), "firm", start=(-2.0, 0.0))) as simulation:
        for _ in range(6 * 240):
            simulation.step([2.5] * 4)
            speeds.append(simulation._ground.raw[9])
    assert np.std(np.diff(speeds) * 240.0) < 1.0


def test_hull_and_wheels_report_what_they_touch() -> None:
    wall = box_mesh((0.9, -1.0, -0.2), (1.1, 1.0, 1.0), owner=42)
    with simulate(make_world(slope(0.0), mesh=wall)) as simulation:
        for _ in range(2 * 240):
            simulation.step([3.0] * 4)
        taken = simulation.take_contacts()
        assert [contact.obstacle_id for contact in taken] == [42]
        assert 0.2 < taken[0].impact_speed_m_s < 0.55
        assert simulation.take_contacts() == ()
        assert simulation.state.pose.position_w[0] < 0.45
    step = box_mesh((0.7, -1.0, -0.2), (2.5, 1.0, 0.08), owner=5)
    with simulate(make_world(slope(0.0), mesh=step)) as simulation:
        for _ in range(4 * 240):
            simulation.step([2.0] * 4)
        state = simulation.state
        assert state.wheel_contacts == (5,)
        assert state.pose.position_w[2] == pytest.approx(0.08 + ROVER.wheel.radius_m, abs=0.015)
        assert state.normal_force_N.sum() == pytest.approx(WEIGHT, rel=0.35)  # Bullet tilts normals at edges


def test_belly_carries_a_rover_on_a_ridge() -> None:
    heights = np.zeros((101, 101))
    heights[:, 49:52] = 0.25  # a wall across the rover, between the axles
    with simulate(make_world(field(heights), "firm")) as simulation:
        for _ in range(240):
            simulation.step([0.0] * 4)
        state = simulation.state
        assert state.belly_contact
        assert 0.2 < state.pose.position_w[2] < 0.35
        assert np.abs(state.linear_velocity_w).max() < 0.2


def test_leaving_the_map_is_said_and_harmless() -> None:
    with simulate(make_world(slope(0.0, 3.0), start=(1.0, 0.0))) as simulation:
        inside = simulation.state
        for _ in range(4 * 240):
            simulation.step([4.0] * 4)
        assert (inside.off_map, simulation.state.off_map) == (False, True)
        assert np.isfinite(simulation.state.pose.position_w).all()


def test_motors_keep_to_their_acceleration_and_speed() -> None:
    with simulate(make_world(slope(0.0))) as simulation:
        for _ in range(120):
            simulation.step([99.0] * 4)
        assert simulation.state.wheel_speed_rad_s == pytest.approx([3.0] * 4, abs=0.1)
        for _ in range(240):
            simulation.step([99.0] * 4)
        assert simulation.state.wheel_speed_rad_s == pytest.approx([6.0] * 4, abs=0.1)


def test_close_may_be_repeated() -> None:
    simulation = simulate(make_world(slope(0.0)))
    simulation.close()
    simulation.close()


def drive_digest() -> str:
    """Hash of all states of a short drive over a step, with sensor noise."""
    mesh = box_mesh((0.7, 0.0, -0.2), (1.5, 1.0, 0.06))
    digest = hashlib.sha256()
    with simulate(make_world(slope(3.0), "mars_sand", 3.71, mesh=mesh)) as simulation:
        for step in range(480):
            simulation.step([3.0, 3.0, 2.0, 2.5])
            if step % 12 == 0:
                state = simulation.state
                for values in (state.pose.position_w, state.pose.quaternion_w, state.slip, state.wheel_torque_Nm):
                    digest.update(values.tobytes())
                digest.update(repr(simulation.read_sensors()).encode())
    return digest.hexdigest()


def test_the_same_drive_has_the_same_bits_also_in_another_process() -> None:
    code = "from tests.test_sim_simulation import drive_digest; print(drive_digest())"
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1]
    )
    first = drive_digest()
    assert drive_digest() == first
    assert other.stdout.strip() == first


def _motion(height: float, vx: float, vy: float, vz: float, spin: float) -> np.ndarray:
    row = np.zeros((4, MOTION_COLUMNS))
    row[:, 2] = height
    row[:, 3:6] = vx, vy, vz
    row[:, 7] = 1.0  # axle to the left
    row[:, 12] = spin
    return row


SPEED = st.floats(-2.0, 2.0)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["firm", "loose_sand", "snow"]), SPEED, SPEED, SPEED, st.floats(-12.0, 12.0))
def test_soil_forces_are_finite_and_within_its_strength(
    name: str, vx: float, vy: float, vz: float, spin: float
) -> None:
    soil = soil_preset(name)
    wheels = WheelSoil(slope(0.0), soil, ROVER, 9.81)
    depth = wheels.settle(np.full(4, WEIGHT / 4), (0.0, 0.0))
    for _ in range(5):
        out = wheels.step(_motion(ROVER.wheel.radius_m - depth[0], vx, vy, vz, spin), 1 / 240)[0]
        assert np.isfinite(out).all()
        load, side = out[kernel.NORMAL], out[kernel.FORCE + 1]
        area = wheels.state[0, kernel.CONTACT] * ROVER.wheel.width_m
        limit = soil.cohesion_Pa * area + load * np.tan(soil.friction_angle_rad)
        assert load >= 0.0
        wall, _ = kernel._walls(wheels.constants[0], wheels.state[0], 0.0)
        assert np.hypot(out[kernel.THRUST], max(abs(side) - wall, 0.0)) <= limit * (1 + 1e-9)


@settings(max_examples=30, deadline=None)
@given(SPEED, SPEED, st.floats(-12.0, 12.0))
def test_soil_forces_mirror_with_the_motion(vx: float, vy: float, spin: float) -> None:
    results = []
    for sign in (1.0, -1.0):
        wheels = WheelSoil(slope(0.0), soil_preset("loose_sand"), ROVER, 9.81)
        depth = wheels.settle(np.full(4, WEIGHT / 4), (0.0, 0.0))
        for _ in range(20):
            motion = _motion(ROVER.wheel.radius_m - depth[0], sign * vx, sign * vy, 0.0, sign * spin)
            out = wheels.step(motion, 1 / 240)[0].copy()
        results.append(out)
    ahead, back = results
    assert back[kernel.FORCE : kernel.FORCE + 2] == pytest.approx(-ahead[kernel.FORCE : kernel.FORCE + 2], abs=1e-9)
    assert back[kernel.FORCE + 2] == pytest.approx(ahead[kernel.FORCE + 2], abs=1e-9)
