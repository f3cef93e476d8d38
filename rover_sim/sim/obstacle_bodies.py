"""Rocks and cylinders as static bodies: all of them in a small world, those around the rover in a large one.

All rocks of a tile are one body, a compound of convex hulls: against the triangles of the rocks a step among big
rocks took nearly twice as long, and with a body for each rock three times. PyBullet never frees a collision shape, so a
large world is cut into square tiles: a tile's shape is made when the rover first comes near, its body is there only
while the rover is.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import floor, inf
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.obstacle_index import ObstacleIndex
from worlds.rock_mesh import join
from worlds.types import FloatArray, IntArray, Shapes, TriangleMesh

MOST_IN_ONE = 5000  # so many things are one tile, whatever ground they cover
TILE_M = 8.0
REACH_M = 3.0  # the rover may touch what is so far from its middle
STEP_M = 1.0  # it may move so far before tiles are looked up anew

_ROCK_FRICTION = 0.7  # PyBullet multiplies the coefficients of both bodies

Tile = tuple[int, int]


class ObstacleBodies:
    """The static bodies of a physics client; ``index`` knows the things that are there now, one by one."""

    def __init__(self, client: int, shapes: Shapes) -> None:
        self._client, self._shapes = client, shapes
        low, high = shapes.bounds_w
        self._side_m = TILE_M if len(shapes.ids) > MOST_IN_ONE else inf
        self._reach_m = REACH_M + STEP_M + float(((high - low)[:, :2].max(axis=1) / 2).max(initial=0.0))
        self._members = _by_tile((low + high)[:, :2] / 2, self._side_m)
        self._collision_shapes: dict[Tile, int] = {}
        self._meshes: dict[Tile, TriangleMesh] = {}
        self._bodies: dict[Tile, int] = {}
        self._looked_up = (inf, inf)
        self.index = ObstacleIndex(shapes.collision(np.zeros(0, dtype=np.int32)))

    @property
    def any(self) -> bool:
        """Whether the world has obstacles at all."""
        return bool(self._members)

    @property
    def bodies(self) -> tuple[int, ...]:
        """Body numbers of what is there now."""
        return tuple(self._bodies.values())

    def follow(self, x_m: float, y_m: float) -> None:
        """Have everything there that a rover at world x, y may touch; cheap while it has not moved far."""
        at_x, at_y = self._looked_up
        if abs(x_m - at_x) <= STEP_M and abs(y_m - at_y) <= STEP_M:
            return
        self._looked_up = (x_m, y_m)
        needed = [tile for tile in self._around(x_m, y_m) if tile in self._members]
        if needed == list(self._bodies):
            return
        for tile in [tile for tile in self._bodies if tile not in needed]:
            pybullet.removeBody(self._bodies.pop(tile), physicsClientId=self._client)
        self._bodies = {tile: self._bodies[tile] if tile in self._bodies else self._add(tile) for tile in needed}
        self.index.take(join([self._meshes[tile] for tile in needed]))

    def _around(self, x_m: float, y_m: float) -> Iterator[Tile]:
        if self._side_m == inf:
            yield (0, 0)
            return
        spans = [
            range(floor((at - self._reach_m) / self._side_m), floor((at + self._reach_m) / self._side_m) + 1)
            for at in (x_m, y_m)
        ]
        for column in spans[0]:
            for row in spans[1]:
                yield (column, row)

    def _add(self, tile: Tile) -> int:
        if tile not in self._collision_shapes:
            self._meshes[tile] = self._shapes.collision(self._members[tile])
            self._collision_shapes[tile] = _collision_shape(self._client, self._meshes[tile])
        return _static_body(self._client, self._collision_shapes[tile])


def _by_tile(places_m: FloatArray, side_m: float) -> dict[Tile, IntArray]:
    """Which of the places (N, 2) lie in which tile, ascending."""
    if not len(places_m):
        return {}
    if side_m == inf:
        return {(0, 0): np.arange(len(places_m), dtype=np.int32)}
    tiles, number = np.unique(np.floor(places_m / side_m).astype(np.int64), axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable").astype(np.int32)
    ends = np.cumsum(np.bincount(number.ravel()))[:-1]
    return {(int(tile[0]), int(tile[1])): part for tile, part in zip(tiles, np.split(order, ends), strict=True)}


def _collision_shape(client: int, mesh: TriangleMesh) -> int:
    """One shape of the convex hulls of all things in a mesh; PyBullet makes one of each object in a file."""
    with TemporaryDirectory(prefix="rover-sim-") as folder:
        path = Path(folder) / "obstacles.obj"
        path.write_text("".join(_hull_objects(mesh)), encoding="ascii")
        return int(pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(path), physicsClientId=client))


def _hull_objects(mesh: TriangleMesh) -> Iterator[str]:
    """The vertices of each thing as an object of a Wavefront file, with just so many faces that each is named once."""
    owners = np.empty(len(mesh.vertices_m), dtype=np.int32)
    owners[mesh.faces] = mesh.owner[:, None]
    first = 1
    for points in np.split(mesh.vertices_m, np.flatnonzero(np.diff(owners)) + 1):
        yield "o thing\n" + "v %.6f %.6f %.6f\n" * len(points) % tuple(points.ravel().tolist())
        # A support point is sought among the corners of all faces: named as in the mesh, each would be there six times.
        corners = first + np.resize(np.arange(len(points)), (-(-len(points) // 3), 3))
        yield "f %d %d %d\n" * len(corners) % tuple(corners.ravel().tolist())
        first += len(points)


def _static_body(client: int, shape: int) -> int:
    # With a picture of its own PyBullet does not look for one in the file, which is gone.
    dot = pybullet.createVisualShape(pybullet.GEOM_SPHERE, radius=1e-3, physicsClientId=client)
    body = int(pybullet.createMultiBody(0.0, shape, dot, physicsClientId=client))
    pybullet.changeDynamics(body, -1, lateralFriction=_ROCK_FRICTION, restitution=0.0, physicsClientId=client)
    return body
