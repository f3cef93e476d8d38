from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from worlds.build import build_world, random_rocks
from worlds.errors import ScenarioError
from worlds.geometry import euler_from_quaternion
from worlds.heightfield import height_at, slope_deg
from worlds.rock_field import MESH_MIN_DIAMETER_M, RockField, imprint
from worlds.scenario import Goal, Obstacle, Rocks, RoverChoice, Scenario, Terrain, load_scenario, shipped_scenarios
from worlds.truth import obstacle_discs, reachable
from worlds.types import HeightField, World

SMALL_MAP = Terrain(size_m=(16.0, 12.0), resolution_m=0.1)


def scenario(**keys: Any) -> Scenario:
    settings: dict[str, Any] = {"terrain": SMALL_MAP, "goal": Goal(position_m=(8.0, 0.0)), **keys}
    return Scenario(name="small", **settings)


def cylinder(x: float, y: float, radius: float = 0.1) -> Obstacle:
    return Obstacle(kind="cylinder", position_m=(x, y), radius_m=radius, height_m=1.0)


@pytest.mark.parametrize("name", shipped_scenarios())
def test_shipped_worlds_build_and_their_goal_can_be_reached(name: str) -> None:
    world = build_world(load_scenario(name), 0)
    assert reachable(world, footprint_radius_m=0.6, max_height_m=0.10)
    assert world.start.position_w[2] == pytest.approx(float(height_at(world.ground, *world.start.position_w[:2])))
    assert world.goal_w[2] == pytest.approx(float(height_at(world.ground, *world.goal_w[:2])))


def test_the_slope_rises_ten_degrees_towards_the_goal() -> None:
    world = build_world(load_scenario("slope"), 0)
    assert np.median(slope_deg(world.ground)) == pytest.approx(10.0, abs=0.2)
    assert world.goal_w[2] - world.start.position_w[2] == pytest.approx(12.0 * np.tan(np.radians(10.0)), abs=0.02)


def arrays_of(world: World) -> list[Any]:
    meshes = (world.picture_mesh, world.collision_mesh)
    return [world.ground.heights_m, *(getattr(mesh, name) for mesh in meshes for name in ("vertices_m", "faces"))]


def test_same_seed_same_world_to_the_bit() -> None:
    one, two, other = (build_world(scenario(), seed) for seed in (4, 4, 5))
    assert all(np.array_equal(a, b) for a, b in zip(arrays_of(one), arrays_of(two), strict=True))
    assert list(one.rocks) == list(two.rocks)
    assert list(one.rocks) != list(other.rocks)


def test_other_rocks_leave_the_ground_and_other_ground_leaves_the_rocks() -> None:
    none = build_world(scenario(rocks=Rocks(cfa=0.0)), 1)
    many = build_world(scenario(rocks=Rocks(cfa=0.10, min_diameter_m=0.1)), 1)
    assert np.array_equal(none.ground.heights_m, many.ground.heights_m)
    flat = build_world(scenario(terrain=Terrain(kind="flat", size_m=(16.0, 12.0), resolution_m=0.1)), 1)
    hills = build_world(scenario(), 1)
    assert [rock.position_w[:2] for rock in flat.rocks] == [rock.position_w[:2] for rock in hills.rocks]


def test_an_obstacle_or_a_clear_radius_only_takes_rocks_away() -> None:
    plain = {rock.position_w for rock in build_world(scenario(rocks=Rocks(min_diameter_m=0.1)), 1).rocks}
    wide = scenario(rocks=Rocks(min_diameter_m=0.1, clear_radius_m=2.5), obstacle=(cylinder(4.0, 2.0, 0.5),))
    left = build_world(wide, 1).rocks
    assert {rock.position_w for rock in left} < plain
    for rock in left:
        x, y, _ = rock.position_w
        assert np.hypot(x, y) >= 2.5 + rock.length_m / 2
        assert np.hypot(x - 8.0, y) >= 2.5 + rock.length_m / 2
        assert np.hypot(x - 4.0, y - 2.0) >= 0.5 + rock.length_m / 2


def test_ids_are_unique_and_cylinders_come_after_rocks() -> None:
    explicit = Obstacle(kind="rock", position_m=(3.0, 3.0), radius_m=0.4, height_m=0.3, formation=6, yaw_deg=30.0)
    world = build_world(scenario(obstacle=(cylinder(4.0, -3.0), explicit)), 2)
    assert [rock.id for rock in world.rocks] == list(range(1, len(world.rocks) + 1))
    assert [item.id for item in world.cylinders] == [len(world.rocks) + 1]
    first = world.rocks[0]
    assert first.position_w[:2] == (3.0, 3.0)
    assert (first.shape.formation, first.height_m) == (6, 0.3)
    assert first.diameter_m == pytest.approx(0.8)
    for mesh in (world.picture_mesh, world.collision_mesh):
        assert set(mesh.owner.tolist()) == set(range(1, len(world.rocks) + 2))
        assert mesh.faces.max() == len(mesh.vertices_m) - 1
    counts = (len(world.picture_mesh.faces), len(world.collision_mesh.faces))
    assert counts[0] > counts[1]
    assert world.shapes.face_counts() == counts


def test_only_asked_formations_appear() -> None:
    world = build_world(scenario(rocks=Rocks(formations=(3, 8), min_diameter_m=0.1)), 0)
    assert {rock.shape.formation for rock in world.rocks} == {3, 8}


def test_rocks_stand_on_the_ground() -> None:
    world = build_world(scenario(), 3)
    for rock in world.rocks:
        assert rock.position_w[2] == pytest.approx(float(height_at(world.ground, *rock.position_w[:2])))
        assert rock.diameter_m >= MESH_MIN_DIAMETER_M


def bump(diameter_m: float, resolution_m: float) -> HeightField:
    level = HeightField(np.zeros((61, 61)), resolution_m, (0.0, 0.0))
    one = RockField(
        centres_m=np.full((1, 2), 30.4 * resolution_m),
        diameters_m=np.array([diameter_m]),
        formations=np.zeros(1, np.int32),
        yaws_rad=np.zeros(1),
        aspects=np.ones(1),
        profiles=np.ones((1, 9)),
    )
    return imprint(one, level)


@pytest.mark.parametrize("resolution_m", [0.02, 0.08, 0.2])
def test_a_small_rock_is_a_bump_of_its_volume_and_no_spike(resolution_m: float) -> None:
    field = bump(0.06, resolution_m)
    half_ball = 2 / 3 * np.pi * 0.03**3
    assert field.heights_m.sum() * resolution_m**2 == pytest.approx(half_ball, rel=1e-3)
    assert field.heights_m.max() <= 0.03
    assert np.abs(np.diff(field.heights_m)).max() <= 0.5 * resolution_m


def test_small_rocks_change_the_ground_a_little() -> None:
    bare = build_world(scenario(rocks=Rocks(cfa=0.10, min_diameter_m=0.08)), 1).ground.heights_m
    rough = build_world(scenario(rocks=Rocks(cfa=0.10, min_diameter_m=0.04)), 1).ground.heights_m
    assert 0.0 < (rough - bare).max() < 0.01
    assert (rough - bare).min() >= 0.0


def test_the_start_is_turned_to_its_heading() -> None:
    world = build_world(scenario(rover=RoverChoice(heading_deg=35.0)), 0)
    assert np.degrees(euler_from_quaternion(world.start.quaternion_w)) == pytest.approx([0.0, 0.0, 35.0])


@pytest.mark.parametrize(
    ("keys", "seed", "expected"),
    [
        (
            {"obstacle": (cylinder(9.0, 3.0), cylinder(0.2, 0.0, 0.5))},
            0,
            r"rover.start_m = \[0.0, 0.0\]: lies inside obstacle\[1\], a cylinder of radius 0.5 m at \[0.2, 0.0\]",
        ),
        (
            {"obstacle": (Obstacle(kind="rock", position_m=(8.2, 0.0), radius_m=0.4, height_m=0.3),)},
            0,
            r"goal.position_m = \[8.0, 0.0\]: lies inside obstacle\[0\], a rock",
        ),
        ({"obstacle": (cylinder(99.0, 0.0),)}, 0, r"obstacle\[0\].position_m = \[99.0, 0.0\]: off the map; allowed"),
        ({"goal": Goal(position_m=(15.0, 0.0))}, 0, r"goal.position_m = \[15.0, 0.0\]: 15 m from rover.start_m"),
        (
            {"rocks": Rocks(cfa=0.3, min_diameter_m=0.01), "terrain": Terrain(size_m=(200.0, 200.0))},
            0,
            r"rocks.min_diameter_m = 0.01: would make about",
        ),
        ({"rocks": Rocks(cfa=-0.1)}, 0, r"rocks.cfa = -0.1: allowed are 0 to 0.3"),
        ({}, -1, r"seed = -1: allowed are whole numbers"),
    ],
)
def test_what_cannot_be_built_names_key_and_value(keys: dict[str, Any], seed: int, expected: str) -> None:
    with pytest.raises(ScenarioError, match=f"^scenario small: {expected}"):
        build_world(scenario(**keys), seed)


def test_elevation_paths_start_at_the_base_folder(tmp_path: Path) -> None:
    np.save(tmp_path / "flat.npy", np.full((201, 201), 2.5))
    terrain = Terrain(kind="dem", path="flat.npy", resolution_m=0.1)
    world = build_world(scenario(terrain=terrain, rocks=Rocks(cfa=0.0)), 0, base_dir=tmp_path)
    assert world.scenario.terrain.path == str(tmp_path / "flat.npy")
    assert world.goal_w == (8.0, 0.0, 2.5)
    off = scenario(terrain=terrain, goal=Goal(position_m=(9.5, 0.0)))
    with pytest.raises(
        ScenarioError, match=r"goal.position_m = \[9.5, 0.0\]: off the map; allowed are x -9.00 to 9.00"
    ):
        build_world(off, 0, base_dir=tmp_path, source="yard.toml")


def test_a_wall_with_a_gap_can_be_passed_only_by_the_narrow() -> None:
    # Cylinders of radius 0.3 m every 0.5 m along x = 4, with a free gap of 1.4 m around y = 0.
    wall = tuple(cylinder(4.0, sign * (1.0 + 0.5 * step), 0.3) for sign in (-1, 1) for step in range(11))
    world = build_world(scenario(obstacle=wall, rocks=Rocks(cfa=0.0)), 0)
    assert obstacle_discs(world).shape == (22, 4)
    assert obstacle_discs(world)[0] == pytest.approx([4.0, -1.0, 0.3, 1.0])
    assert reachable(world, 0.6, 0.1)
    assert not reachable(world, 0.8, 0.1)
    assert reachable(world, 0.8, 1.5)


def test_random_rocks_count_the_bumps_too() -> None:
    small = scenario()
    world = build_world(small, 6)
    field = random_rocks(small, world.ground, 6, "test")
    assert np.count_nonzero(field.diameters_m >= MESH_MIN_DIAMETER_M) == len(world.rocks)
    assert field.diameters_m.min() < MESH_MIN_DIAMETER_M


def test_a_world_without_rocks_has_empty_meshes() -> None:
    world = build_world(msgspec.structs.replace(scenario(), rocks=Rocks(cfa=0.0)), 0)
    assert len(world.rocks) == 0
    assert len(world.picture_mesh.faces) == 0
    assert obstacle_discs(world).shape == (0, 4)
