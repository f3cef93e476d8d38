"""The simulated laser scanner against distances worked out by hand."""

from __future__ import annotations

from math import radians, sin

import numpy as np
import pytest

from rover_sim.sim.laser import LaserScanner
from rover_sim.sim.rover import load_rover
from worlds.build import build_world
from worlds.geometry import quaternion_from_euler
from worlds.scenario import Goal, Obstacle, Rocks, Scenario, Terrain
from worlds.types import FloatArray, LaserModel, Pose

HEIGHT_M = 0.3
LASER = LaserModel((0.2, 0.0, 0.2))
EXACT = LaserModel((0.2, 0.0, 0.2), range_sd_m=0.0)
AHEAD, LEFT = 540, 900  # beams: 0 and 90 degrees


def _scenario(*obstacles: Obstacle) -> Scenario:
    return Scenario(
        name="x",
        terrain=Terrain(kind="flat", size_m=(30.0, 30.0), resolution_m=0.1),
        rocks=Rocks(cfa=0.0),
        obstacle=obstacles,
        goal=Goal(position_m=(5.0, 0.0)),
    )


def _pillar(x: float, y: float, radius_m: float = 0.3, height_m: float = 1.0) -> Obstacle:
    return Obstacle(kind="cylinder", position_m=(x, y), radius_m=radius_m, height_m=height_m)


def _ranges(scenario: Scenario, pose: Pose, laser: LaserModel = EXACT, seed: int = 0) -> FloatArray:
    return LaserScanner(build_world(scenario, 0), laser, np.random.default_rng(seed)).scan(pose)


def _pose(x: float = 0.0, y: float = 0.0, *, pitch: float = 0.0, yaw: float = 0.0) -> Pose:
    return Pose(np.array([x, y, HEIGHT_M - 0.2]), quaternion_from_euler(0.0, pitch, yaw))


def test_beams_are_those_of_the_contract() -> None:
    angles = LASER.angles_rad
    assert len(angles) == 1081
    assert angles[[0, AHEAD, -1]] == pytest.approx(np.radians([-135.0, 0.0, 135.0]))


def test_pillars_ahead_and_beside_are_where_they_are() -> None:
    ranges = _ranges(_scenario(_pillar(4.0, 0.0), _pillar(0.2, 3.0)), _pose())
    # The collision mesh has flat sides, up to a few millimetres inside the circle.
    assert ranges[AHEAD] == pytest.approx(4.0 - 0.2 - 0.3, abs=0.01)
    assert ranges[LEFT] == pytest.approx(2.7, abs=0.01)
    assert np.isinf(ranges[LEFT - 180])
    width = np.count_nonzero(np.isfinite(ranges[:700])) * LASER.step_rad
    assert width == pytest.approx(2 * np.arcsin(0.3 / 3.8), abs=0.015)


def test_the_scanner_turns_with_the_rover() -> None:
    ranges = _ranges(_scenario(_pillar(0.0, 4.0)), _pose(yaw=radians(90.0)))
    assert ranges[AHEAD] == pytest.approx(3.5, abs=0.01)


def test_the_nearer_of_two_hides_the_farther() -> None:
    ranges = _ranges(_scenario(_pillar(6.0, 0.0), _pillar(3.0, 0.0)), _pose())
    assert ranges[AHEAD] == pytest.approx(2.5, abs=0.01)


def test_what_is_lower_than_the_plane_or_out_of_reach_is_not_seen() -> None:
    low, far = _pillar(3.0, 0.0, height_m=HEIGHT_M - 0.05), _pillar(11.0, 3.0)
    assert np.isinf(_ranges(_scenario(low, far), _pose())).all()


def test_a_nose_down_scanner_sees_the_ground_in_front() -> None:
    pitch = radians(5.0)
    ranges = _ranges(_scenario(), _pose(pitch=pitch))
    height = HEIGHT_M - 0.2 + 0.2 * np.cos(pitch) - 0.2 * sin(pitch)  # of the scanner, turned with the body
    assert ranges[AHEAD] == pytest.approx(height / sin(pitch), abs=1e-3)
    assert np.isinf(ranges[[0, -1]]).all()


def test_noise_has_its_size_and_its_seed() -> None:
    scenario = _scenario(_pillar(0.0, 7.0, radius_m=4.0))
    exact = _ranges(scenario, _pose())
    noisy = _ranges(scenario, _pose(), LASER)
    seen = np.isfinite(exact)
    assert np.array_equal(seen, np.isfinite(noisy))
    assert np.std(noisy[seen] - exact[seen]) == pytest.approx(0.01, rel=0.3)
    assert np.array_equal(noisy, _ranges(scenario, _pose(), LASER))
    assert not np.array_equal(noisy, _ranges(scenario, _pose(), LASER, seed=1))


def test_obstacles_come_into_reach_as_the_rover_moves() -> None:
    scenario = Scenario(
        name="long",
        terrain=Terrain(kind="flat", size_m=(60.0, 20.0), resolution_m=0.2),
        rocks=Rocks(cfa=0.0),
        obstacle=(_pillar(30.0, 0.0),),
        goal=Goal(position_m=(40.0, 0.0)),
    )
    scanner = LaserScanner(build_world(scenario, 0), EXACT, np.random.default_rng(0))
    assert np.isinf(scanner.scan(_pose())).all()
    assert scanner.scan(_pose(25.0))[AHEAD] == pytest.approx(30.0 - 25.2 - 0.3, abs=0.01)


@pytest.mark.parametrize("name", ["husky", "jackal", "rocker_bogie"])
def test_every_rover_has_a_place_for_it_in_front_of_its_body(name: str) -> None:
    rover = load_rover(name)
    x, y, z = rover.laser().position_b
    assert y == 0.0
    assert x == max(box.centre_m[0] + box.size_m[0] / 2 for box in rover.chassis.box)
    assert z + rover.wheel.radius_m > rover.chassis.clearance_m
