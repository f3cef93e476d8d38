from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import trimesh

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.heightfield_body import add_heightfield
from rover_sim.sim.obstacle_bodies import REACH_M, ObstacleBodies
from rover_sim.sim.obstacle_index import ObstacleIndex
from rover_sim.sim.world import connect
from tests.prepared_shapes import NO_MESH, PreparedShapes
from tests.sim_factory import box_mesh
from worlds.build import build_world
from worlds.errors import InputError
from worlds.heightfield import height_at
from worlds.scenario import Goal, Rocks, Scenario, Terrain
from worlds.types import HeightField, TriangleMesh


@pytest.fixture
def client() -> Iterator[int]:
    number = connect(9.81)
    yield number
    pybullet.disconnect(physicsClientId=number)


def test_heightfield_body_lies_where_the_heights_say(client: int) -> None:
    rng = np.random.default_rng(3)
    ground = HeightField(1.0 + 0.2 * rng.random((31, 51)), 0.1, (2.0, -7.0))
    add_heightfield(client, ground)
    (x0, x1), (y0, y1) = ground.x_limits_m, ground.y_limits_m
    # Rays just inside the corners and in the middle: wrong axis order or offset misses or differs.
    spots = [(x, y) for x in (x0 + 0.01, x1 - 0.01) for y in (y0 + 0.01, y1 - 0.01)]
    for x, y in [*spots, (0.5 * (x0 + x1), 0.5 * (y0 + y1)), (x0 + 1.234, y0 + 0.567)]:
        hit = pybullet.rayTest([x, y, 9.0], [x, y, -9.0], physicsClientId=client)[0]
        expected = float(height_at(ground, np.array(x), np.array(y)))
        assert hit[3][2] == pytest.approx(expected, abs=0.05)
    x, y = x0 + 20 * 0.1, y0 + 10 * 0.1
    hit = pybullet.rayTest([x, y, 9.0], [x, y, -9.0], physicsClientId=client)[0]
    assert hit[3][2] == pytest.approx(ground.heights_m[10, 20], abs=1e-4)


def test_heightfield_too_large_for_pybullet_is_refused(client: int) -> None:
    with pytest.raises(InputError, match="1500 x 1500"):
        add_heightfield(client, HeightField(np.zeros((1500, 1500)), 0.1, (0.0, 0.0)))


def _joined(*meshes: TriangleMesh) -> TriangleMesh:
    offsets = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes[:-1])])
    return TriangleMesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]).astype(np.int32),
        np.concatenate([mesh.owner for mesh in meshes]),
    )


def test_every_rock_stands_as_its_own_convex_hull(client: int) -> None:
    rocks = Rocks(cfa=0.1, min_diameter_m=0.2, max_diameter_m=1.2, clear_radius_m=0.5)
    goal = Goal(position_m=(4.0, 0.0))
    world = build_world(Scenario(name="w", terrain=Terrain(size_m=(12.0, 12.0)), rocks=rocks, goal=goal), 3)
    bodies = ObstacleBodies(client, world.shapes)
    bodies.follow(0.0, 0.0)
    mesh = world.collision_mesh
    hulls = [
        trimesh.convex.convex_hull(mesh.vertices_m[np.unique(mesh.faces[mesh.owner == number])])
        for number in world.shapes.ids
    ]
    rng = np.random.default_rng(0)
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    spots = rng.uniform(low[:2], high[:2], (400, 2))
    for x, y in spots:
        found = pybullet.rayTest([x, y, 9.0], [x, y, -9.0], physicsClientId=client)[0]
        tops = [_top(hull, x, y) for hull in hulls]
        expected = max(tops)
        assert (found[0] >= 0) == (expected > -9.0)
        if found[0] >= 0:
            assert found[3][2] == pytest.approx(expected, abs=5e-3)  # a margin of 1 mm, more on steep sides


def _top(hull: trimesh.Trimesh, x: float, y: float) -> float:
    """Height at which a vertical line enters a convex body; -9 where it misses."""
    normals, offsets = hull.face_normals, (hull.face_normals * hull.triangles_center).sum(axis=1)
    level = offsets - normals[:, 0] * x - normals[:, 1] * y
    upward = normals[:, 2] > 1e-9
    downward = normals[:, 2] < -1e-9
    sides = ~upward & ~downward
    high = (level[upward] / normals[upward, 2]).min()
    low = (level[downward] / normals[downward, 2]).max()
    return float(high) if high > low and (level[sides] > 0.0).all() else -9.0


def test_contacts_are_given_to_the_nearest_obstacle() -> None:
    index = ObstacleIndex(_joined(box_mesh((0, 0, 0), (1, 1, 1), 7), box_mesh((1.2, 0, 0), (2, 1, 1), 3)))
    assert index.nearest((0.9, 0.9, 0.9)) == 7
    assert index.nearest((1.19, 0.1, 0.1)) == 3
    assert index.nearest((50.0, 0.0, 0.0)) == 0
    assert ObstacleIndex(NO_MESH).nearest((0.0, 0.0, 0.0)) == 0


def cubes(places: list[tuple[float, float]]) -> PreparedShapes:
    """A cube of 0.4 m at each place, ids from 1."""
    return PreparedShapes(
        _joined(*(box_mesh((x - 0.2, y - 0.2, 0), (x + 0.2, y + 0.2, 0.4), k) for k, (x, y) in enumerate(places, 1)))
    )


def hit(client: int, x: float, y: float) -> bool:
    return bool(pybullet.rayTest([x, y, 5.0], [x, y, -5.0], physicsClientId=client)[0][0] >= 0)


def test_few_obstacles_are_all_there_from_the_start(client: int) -> None:
    bodies = ObstacleBodies(client, cubes([(0.0, 0.0), (300.0, 0.0)]))
    assert (bodies.any, bodies.bodies) == (True, ())
    bodies.follow(0.0, 0.0)
    assert len(bodies.bodies) == 1
    assert hit(client, 0.0, 0.0)
    assert hit(client, 300.0, 0.0)
    before = bodies.bodies
    bodies.follow(300.0, 0.0)
    assert bodies.bodies == before


def test_many_obstacles_are_there_where_the_rover_is(client: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rover_sim.sim.obstacle_bodies.MOST_IN_ONE", 2)
    places = [(0.5, 0.5), (-3.9, 0.0), (20.0, 0.0), (44.0, 44.0)]
    bodies = ObstacleBodies(client, cubes(places))
    bodies.follow(0.0, 0.0)
    assert [hit(client, *place) for place in places] == [True, True, False, False]
    assert bodies.index.nearest((0.5, 0.5, 0.4)) == 1
    assert bodies.index.nearest((20.0, 0.0, 0.4)) == 0
    bodies.follow(44.0, 40.0)
    assert [hit(client, *place) for place in places] == [False, False, False, True]
    assert bodies.index.nearest((44.0, 44.0, 0.4)) == 4
    bodies.follow(200.0, 0.0)
    assert bodies.bodies == ()
    assert bodies.index.nearest((44.0, 44.0, 0.4)) == 0
    bodies.follow(0.0, 0.0)
    assert [hit(client, *place) for place in places] == [True, True, False, False]


def test_whatever_the_rover_may_reach_is_there(client: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rover_sim.sim.obstacle_bodies.MOST_IN_ONE", 0)
    grid = [(float(x), float(y)) for x in range(-20, 21, 2) for y in range(-20, 21, 2)]
    bodies = ObstacleBodies(client, cubes(grid))
    rng = np.random.default_rng(0)
    place = np.zeros(2)
    for _ in range(40):
        place = np.clip(place + rng.uniform(-2.0, 2.0, 2), -15.0, 15.0)
        bodies.follow(*place.tolist())
        # The largest distance at which the last look-up may have been made is part of the reach.
        for x, y in grid:
            if max(abs(x - place[0]), abs(y - place[1])) < REACH_M:
                assert bodies.index.nearest((x, y, 0.4)) > 0


def test_no_obstacles_no_bodies(client: int) -> None:
    bodies = ObstacleBodies(client, PreparedShapes(NO_MESH))
    bodies.follow(0.0, 0.0)
    assert (bodies.any, bodies.bodies) == (False, ())
