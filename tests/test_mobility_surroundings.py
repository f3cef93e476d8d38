from __future__ import annotations

from math import radians

import numpy as np
import pytest

from rover_sim.sim.obstacle_index import ObstacleIndex
from rover_sim.sim.rover import load_rover
from rover_sim.sim.rut_kernels import Ruts
from rover_sim.sim.ruts import RutField, no_ruts
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.surroundings import Surface, Surroundings
from tests.sim_factory import box_mesh, field, make_world, slope
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion
from worlds.types import FloatArray, HeightField, TriangleMesh

ROVER = load_rover("husky")
RADIUS = ROVER.wheel.radius_m
AXLE = np.array([0.0, 0.0, RADIUS])
LEVEL = np.eye(3)
FLAT = slope(0.0)


def around(mesh: TriangleMesh) -> Surroundings:
    return Surroundings(ObstacleIndex(mesh), ROVER)


def surface(ground: HeightField, ruts: Ruts | None = None) -> Surface:
    x0, y0 = ground.origin_m
    return ground.heights_m, (x0, y0, 1.0 / ground.resolution_m), no_ruts() if ruts is None else ruts


def clearance(ground: HeightField, mesh: TriangleMesh, position: FloatArray, rotation: FloatArray = LEVEL) -> float:
    return around(mesh).belly_clearance(surface(ground), position, rotation)


def pit(ground: HeightField, mesh: TriangleMesh, hub: tuple[float, float, float], yaw: float = 0.0) -> float:
    ahead = np.array([[np.cos(yaw), np.sin(yaw)]])
    return float(around(mesh).pit_depths(surface(ground), np.array([hub]), ahead)[0])


FAR = box_mesh((3.0, 3.0, 0.0), (3.2, 3.2, 0.2))


def test_on_level_ground_the_clearance_is_that_of_the_rover_file() -> None:
    assert clearance(FLAT, FAR, AXLE) == pytest.approx(ROVER.chassis.clearance_m, abs=5e-4)


def test_a_rock_under_the_hull_takes_its_height() -> None:
    rock = box_mesh((0.05, -0.1, -0.1), (0.15, 0.1, 0.08))
    assert clearance(FLAT, rock, AXLE) == pytest.approx(ROVER.chassis.clearance_m - 0.08, abs=5e-4)
    beside = box_mesh((0.05, 0.23, -0.1), (0.15, 0.27, 0.12))  # under the deck, beside the hull
    assert clearance(FLAT, beside, AXLE) == pytest.approx(ROVER.chassis.clearance_m, abs=5e-4)


def test_clearance_is_measured_along_the_body_for_rocks_and_upright_for_ground() -> None:
    rolled = rotation_from_quaternion(quaternion_from_euler(0.0, radians(10.0), 0.0))
    nose = 0.4 * np.sin(radians(10.0))  # half the hull's length, nose down
    bottom = (0.0327 * np.cos(radians(10.0))) + nose
    assert clearance(FLAT, FAR, AXLE, rolled) == pytest.approx(RADIUS - bottom, abs=1e-3)


@pytest.mark.parametrize("yaw_deg", [0.0, 37.0, 90.0])
def test_no_pit_on_planes_whatever_their_slope(yaw_deg: float) -> None:
    for slope_deg in (0.0, 10.0, 30.0):
        tilted = slope(slope_deg)
        assert pit(tilted, FAR, (0.0, 0.0, RADIUS / np.cos(radians(slope_deg))), radians(yaw_deg)) < 1e-9


def test_a_ditch_is_as_deep_as_its_lower_rim() -> None:
    heights = np.zeros((101, 101))
    heights[:, 48:53] = -0.12  # 0.32 m wide at the bottom
    heights[:, 53:] = 0.05
    ditch = field(heights)
    assert pit(ditch, FAR, (0.0, 0.0, -0.12 + RADIUS)) == pytest.approx(0.12, abs=1e-6)
    assert pit(ditch, FAR, (0.0, 0.0, -0.12 + RADIUS), radians(90.0)) == pytest.approx(0.0, abs=1e-6)  # along it


def test_a_pit_wider_than_two_wheels_is_a_valley() -> None:
    heights = np.zeros((101, 101))
    heights[:, 40:61] = -0.12  # 1.6 m
    assert pit(field(heights), FAR, (0.0, 0.0, -0.12 + RADIUS)) == pytest.approx(0.0, abs=1e-6)


def test_a_gap_between_two_rocks_is_a_pit_and_one_rock_is_none() -> None:
    ahead = box_mesh((0.18, -0.3, -0.1), (0.5, 0.3, 0.10), owner=1)
    behind = box_mesh((-0.5, -0.3, -0.1), (-0.18, 0.3, 0.07), owner=2)
    faces = np.concatenate([ahead.faces, behind.faces + len(ahead.vertices_m)])
    both = TriangleMesh(
        np.concatenate([ahead.vertices_m, behind.vertices_m]),
        np.asarray(faces, dtype=np.int32),
        np.concatenate([ahead.owner, behind.owner]),
    )
    assert pit(FLAT, both, (0.0, 0.0, RADIUS)) == pytest.approx(0.07, abs=1e-6)
    assert pit(FLAT, ahead, (0.0, 0.0, RADIUS)) == pytest.approx(0.0, abs=1e-6)


def test_a_rut_is_no_pit_along_it_and_gives_the_belly_room() -> None:
    """A rut of 8 cm through the whole map, along x, under the left wheels; a tile has 64 texels of 2 cm."""
    field_of_ruts = RutField(FLAT)
    field_of_ruts.directory[:] = 0
    field_of_ruts.depth_m[0] = 0.08
    ahead, hub = np.array([[1.0, 0.0]]), np.array([[0.0, 0.3, RADIUS - 0.08]])
    rutted, smooth = surface(FLAT, field_of_ruts.view), surface(FLAT)
    assert around(FAR).pit_depths(rutted, hub, ahead)[0] == pytest.approx(0.0, abs=1e-6)
    assert around(FAR).pit_depths(smooth, hub, ahead)[0] == pytest.approx(0.08, abs=1e-6)
    gained = around(FAR).belly_clearance(rutted, AXLE, LEVEL) - around(FAR).belly_clearance(smooth, AXLE, LEVEL)
    assert gained == pytest.approx(0.08, abs=1e-6)


def test_a_wheel_between_two_walls_is_wedged() -> None:
    """Two ridges closer than a wheel is wide: each touches it on its own side."""
    low = box_mesh((0.256 - 0.5, -1.0, -0.2), (0.256 - 0.13, 1.0, 0.10), owner=1)
    high = box_mesh((0.256 + 0.13, -1.0, -0.2), (0.256 + 0.5, 1.0, 0.10), owner=2)
    faces = np.concatenate([low.faces, high.faces + len(low.vertices_m)])
    mesh = TriangleMesh(
        np.concatenate([low.vertices_m, high.vertices_m]),
        np.asarray(faces, dtype=np.int32),
        np.repeat([1, 2], 12).astype(np.int32),
    )
    with Simulation(make_world(FLAT, mesh=mesh), ROVER, np.random.default_rng(0)) as simulation:
        for _ in range(120):
            simulation.step([0.0] * 4)
        state = simulation.state
    assert state.wedged[[0, 2]].all()
    assert not state.wedged[[1, 3]].any()
    assert (state.pit_depth_m[[0, 2]] > 0.0).all()


def test_the_power_of_the_wheels_adds_up_to_that_of_the_rover() -> None:
    with Simulation(make_world(slope(10.0), "firm"), ROVER, np.random.default_rng(0)) as simulation:
        for _ in range(240):
            simulation.step([2.0] * 4)
        state = simulation.state
    assert state.wheel_power_W == pytest.approx(state.wheel_torque_Nm * state.wheel_speed_rad_s)
    assert state.power_W == pytest.approx(state.wheel_power_W.sum() + ROVER.motor.idle_power_W)
    assert 0.05 < state.belly_clearance_m < ROVER.chassis.clearance_m


@pytest.mark.parametrize(("heading_deg", "rim_m"), [(0.0, 0.05), (90.0, 0.0), (180.0, 0.05)])
def test_a_pit_counts_along_the_way_that_the_wheels_roll(heading_deg: float, rim_m: float) -> None:
    """Furrows along y, as far apart as the axles, 8 cm deep."""
    x = (np.arange(121) - 60) * 0.04
    furrows = 0.04 * (1.0 + np.cos(2.0 * np.pi * x / ROVER.wheelbase_m))
    ground = field(np.tile(furrows, (121, 1)), 0.04)
    with Simulation(make_world(ground, heading_deg=heading_deg), ROVER, np.random.default_rng(0)) as simulation:
        depths = simulation.state.pit_depth_m
    if rim_m > 0.0:
        assert depths.max() > rim_m
    else:
        assert depths.max() < 0.02
