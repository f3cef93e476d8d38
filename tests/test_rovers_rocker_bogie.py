"""The rocker-bogie on the ground: loads, steps, differential, arms, repeatability."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from math import asin
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from rover_sim.sim.rover import RoverModel, Suspension, load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.support_polygon import outline
from tests.sim_factory import box_mesh, field, make_world, slope
from worlds.geometry import rotation_from_quaternion
from worlds.types import FloatArray, TriangleMesh, World

ROVER = load_rover("rocker_bogie")
WEIGHT = ROVER.mass_kg * 9.81
RADIUS = ROVER.wheel.radius_m


def rigid() -> RoverModel:
    """A rover of the same mass on four of the same wheels without arms."""
    corners = tuple(ROVER.wheel.positions_m[place] for place in (0, 2, 3, 5))
    chassis = replace(ROVER.chassis, mass_kg=ROVER.mass_kg - 4 * ROVER.wheel.mass_kg)
    return replace(ROVER, wheel=replace(ROVER.wheel, positions_m=corners), suspension=Suspension(), chassis=chassis)


def simulate(world: World, rover: RoverModel = ROVER) -> Simulation:
    return Simulation(world, rover, np.random.default_rng(0))


def arm_angles(simulation: Simulation) -> FloatArray:
    """Angles (4,) of left rocker, left bogie, right rocker, right bogie."""
    return simulation._ground.raw[19:23].copy()


def drive(simulation: Simulation, seconds: float) -> FloatArray:
    """Wheel loads (T, n) as shares of an equal load, twenty times a second, while all wheels turn at 2 rad/s."""
    wheels = len(simulation.rover.wheel.positions_m)
    loads = []
    for step in range(round(240 * seconds)):
        simulation.step([2.0] * wheels)
        if step % 12 == 0:
            loads.append(simulation.state.normal_force_N * wheels / WEIGHT)
    return np.array(loads)


def longest_loss_s(loads: FloatArray) -> float:
    """Longest time that any wheel carried less than 5 % of its share."""
    longest, now = 0, np.zeros(loads.shape[1], dtype=int)
    for row in loads < 0.05:
        now = np.where(row, now + 1, 0)
        longest = max(longest, int(now.max()))
    return longest / 20


@pytest.mark.parametrize("soil", ["firm", "loose_sand"])
def test_all_six_wheels_of_a_rover_at_rest_carry_the_same(soil: str) -> None:
    with simulate(make_world(slope(0.0), soil)) as simulation:
        state = simulation.state
        assert state.normal_force_N.sum() == pytest.approx(WEIGHT, rel=1e-3)
        assert state.normal_force_N == pytest.approx([WEIGHT / 6] * 6, rel=0.02)
        assert state.stability_margin == pytest.approx(1.0, abs=0.02)


def ramp(height_m: float) -> TriangleMesh:
    """A block under the left wheels only, with a ramp of 0.3 m to its top."""
    mesh = box_mesh((0.7, 0.1, -0.3), (4.0, 1.0, height_m))
    vertices = mesh.vertices_m.copy()
    vertices[[4, 7], 0] += 0.3
    vertices[[4, 7, 5, 6], 2] = height_m
    vertices[[0, 3], 2] = 0.0
    return TriangleMesh(vertices, mesh.faces, mesh.owner)


def test_it_climbs_a_step_under_one_side_with_every_wheel_loaded() -> None:
    world = make_world(slope(0.0), mesh=box_mesh((0.7, 0.1, -0.3), (4.0, 1.0, 0.9 * RADIUS)))
    with simulate(world) as simulation:
        assert longest_loss_s(drive(simulation, 8.0)) <= 0.05
        assert simulation.state.pose.position_w[0] > 1.3  # all wheels of the left side are up


def test_it_keeps_all_wheels_loaded_where_a_rigid_rover_lifts_one() -> None:
    world = make_world(slope(0.0), mesh=ramp(RADIUS))
    for rover, least_s, most_s in ((ROVER, 0.0, 0.05), (rigid(), 2.0, 8.0)):
        with simulate(world, rover) as simulation:
            loads = drive(simulation, 8.0)
            assert simulation.state.pose.position_w[0] > 1.3
            assert least_s <= longest_loss_s(loads) <= most_s


def test_it_climbs_a_step_across_that_stops_a_rigid_rover() -> None:
    mesh = box_mesh((0.7, -1.0, -0.3), (4.0, 1.0, 0.85 * RADIUS))
    reached = []
    for rover in (ROVER, rigid()):
        with simulate(make_world(slope(0.0), mesh=mesh), rover) as simulation:
            drive(simulation, 8.0)
            reached.append(simulation.state.pose.position_w)
    assert reached[0][0] > 1.0
    assert reached[0][2] == pytest.approx(0.85 * RADIUS + RADIUS, abs=0.02)
    assert reached[1][0] < 0.4


def test_the_chassis_keeps_the_mean_pitch_of_the_rockers() -> None:
    """Rockers' pitch in the world, from their wheels and bogie pivots, against the chassis'; knocks included."""
    mesh = box_mesh((0.7, 0.1, -0.3), (4.0, 1.0, 0.07))
    with simulate(make_world(slope(0.0), mesh=mesh)) as simulation:
        worst = 0.0
        for _ in range(6 * 240):
            simulation.step([2.0] * 6)
            left, _, right, _ = arm_angles(simulation)
            worst = max(worst, abs(left + right))
        assert worst < np.deg2rad(0.05)
        left, _, right, _ = arm_angles(simulation)
        forward = rotation_from_quaternion(simulation.state.pose.quaternion_w)[:, 0]
        chassis = -asin(float(forward[2]))
        assert (chassis + left + chassis + right) / 2 == pytest.approx(chassis, abs=1e-3)
        assert simulation.state.normal_force_N.min() > 0.3 * WEIGHT / 6


def test_arms_lie_along_the_ground_they_stand_on() -> None:
    """A ramp of 0.06 m under the left front wheel: rocker, bogie and roll follow from the geometry."""
    heights = np.zeros((101, 101))
    heights[50:, 52:] = 0.06  # y >= 0, x >= 0.16
    with simulate(make_world(field(heights), "firm")) as simulation:
        for _ in range(240):
            simulation.step([0.0] * 6)
        hubs, _ = simulation._ground.locate()
        left, left_bogie, right, right_bogie = arm_angles(simulation)
    assert hubs[0, 2] - hubs[3, 2] == pytest.approx(0.06, abs=0.01)
    assert hubs[1, 2] - hubs[4, 2] == pytest.approx(0.0, abs=0.01)
    # The left rocker turns nose up by 0.06 m over front wheel to bogie pivot, half of it against the chassis.
    assert left == pytest.approx(-right, abs=1e-3)
    assert left == pytest.approx(-0.5 * 0.06 / (0.425 + 0.2125), rel=0.15)
    # Bogies stay level in the world: they turn back by what chassis and rocker pitch.
    pitch = -asin(float(rotation_from_quaternion(simulation.state.pose.quaternion_w)[2, 0]))
    assert pitch + left + left_bogie == pytest.approx(0.0, abs=0.02)
    assert pitch + right + right_bogie == pytest.approx(0.0, abs=0.02)


def test_turning_on_the_spot_skids() -> None:
    with simulate(make_world(slope(0.0))) as simulation:
        for _ in range(480):
            simulation.step([-2.0] * 3 + [2.0] * 3)
        rate = float(simulation.state.angular_velocity_w[2])
    ratio = 4.0 * ROVER.wheel_shape().shear_radius_m / ROVER.track_m / rate
    assert 1.6 <= ratio <= 2.0


def test_the_polygon_of_support_is_the_outer_wheels_clockwise() -> None:
    places = np.array(ROVER.wheel.positions_m)[:, :2]
    corners = outline(places)
    assert sorted(corners) == [0, 2, 3, 5]  # the middle wheels lie on its sides
    x, y = places[list(corners)].T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0
    assert sorted(outline(np.vstack([places, [[0.0, 0.6]]]))) == [0, 2, 3, 5, 6]


def drive_digest() -> str:
    """Hash of the states of a short drive over a step on one side."""
    digest = hashlib.sha256()
    mesh = box_mesh((0.6, 0.1, -0.2), (2.0, 1.0, 0.06))
    with simulate(make_world(slope(3.0), "mars_sand", 3.71, mesh=mesh)) as simulation:
        for step in range(480):
            simulation.step([3.0, 3.0, 3.0, 2.5, 2.5, 2.5])
            if step % 24 == 0:
                state = simulation.state
                for values in (state.pose.position_w, state.slip, state.wheel_torque_Nm, arm_angles(simulation)):
                    digest.update(values.tobytes())
                digest.update(repr(simulation.read_sensors()).encode())
    return digest.hexdigest()


def test_the_same_drive_has_the_same_bits_also_in_another_process() -> None:
    code = "from tests.test_rovers_rocker_bogie import drive_digest; print(drive_digest())"
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1]
    )
    assert other.stdout.strip() == drive_digest()
