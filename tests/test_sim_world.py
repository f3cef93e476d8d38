from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.heightfield_body import add_heightfield
from rover_sim.sim.obstacle_index import ObstacleIndex
from rover_sim.sim.world import connect, mesh_tiles
from tests.prepared_shapes import NO_MESH
from tests.sim_factory import box_mesh
from worlds.errors import InputError
from worlds.heightfield import height_at
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


def test_tiles_keep_every_triangle_within_the_limits() -> None:
    mesh = _joined(*(box_mesh((k, 0, 0), (k + 0.5, 1, 1), k + 1) for k in range(20)))
    tiles = list(mesh_tiles(mesh, 50, 120))
    assert len(tiles) > 1
    assert all(len(vertices) <= 50 and faces.size <= 120 for vertices, faces in tiles)
    pieces = np.concatenate([vertices[faces] for vertices, faces in tiles]).reshape(-1, 9)
    whole = mesh.vertices_m[mesh.faces].reshape(-1, 9)
    assert np.array_equal(pieces[np.lexsort(pieces.T)], whole[np.lexsort(whole.T)])
    assert list(mesh_tiles(NO_MESH, 50, 120)) == []


def test_contacts_are_given_to_the_nearest_obstacle() -> None:
    index = ObstacleIndex(_joined(box_mesh((0, 0, 0), (1, 1, 1), 7), box_mesh((1.2, 0, 0), (2, 1, 1), 3)))
    assert index.nearest((0.9, 0.9, 0.9)) == 7
    assert index.nearest((1.19, 0.1, 0.1)) == 3
    assert index.nearest((50.0, 0.0, 0.0)) == 0
    assert ObstacleIndex(NO_MESH).nearest((0.0, 0.0, 0.0)) == 0
