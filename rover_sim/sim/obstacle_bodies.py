"""Rocks and cylinders as static bodies: all of them in a small world, those around the rover in a large one.

PyBullet needs 0.4 ms and 26 kB for a rock and never frees a collision shape, so a large world is cut into square tiles:
a tile's shape is made when the rover first comes near, its body is there only while the rover is.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import floor, inf

import numpy as np

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.obstacle_index import ObstacleIndex
from worlds.rock_mesh import join
from worlds.types import FloatArray, IntArray, Shapes, TriangleMesh

MOST_IN_ONE = 5000  # so many things are one tile, whatever ground they cover
TILE_M = 8.0
REACH_M = 3.0  # the rover may touch what is so far from its middle
STEP_M = 1.0  # it may move so far before tiles are looked up anew

_MOST_VERTICES = 131_072  # of one mesh given to PyBullet
_MOST_INDICES = 524_288
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
        self._collision_shapes: dict[Tile, list[int]] = {}
        self._meshes: dict[Tile, TriangleMesh] = {}
        self._bodies: dict[Tile, list[int]] = {}
        self._looked_up = (inf, inf)
        self.index = ObstacleIndex(shapes.collision(np.zeros(0, dtype=np.int32)))

    @property
    def any(self) -> bool:
        """Whether the world has obstacles at all."""
        return bool(self._members)

    @property
    def bodies(self) -> tuple[int, ...]:
        """Body numbers of what is there now."""
        return tuple(body for tile in self._bodies.values() for body in tile)

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
            for body in self._bodies.pop(tile):
                pybullet.removeBody(body, physicsClientId=self._client)
        self._bodies = {tile: self._bodies.get(tile) or self._add(tile) for tile in needed}
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

    def _add(self, tile: Tile) -> list[int]:
        """Bodies of a tile; one, or several where PyBullet could not hold one."""
        if tile not in self._collision_shapes:
            mesh = self._shapes.collision(self._members[tile])
            self._meshes[tile] = mesh
            self._collision_shapes[tile] = [
                _collision_shape(self._client, *part) for part in mesh_tiles(mesh, _MOST_VERTICES, _MOST_INDICES)
            ]
        return [_static_body(self._client, shape) for shape in self._collision_shapes[tile]]


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


def _collision_shape(client: int, vertices: FloatArray, faces: IntArray) -> int:
    return int(
        pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=vertices.tolist(),
            indices=faces.ravel().tolist(),
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH | pybullet.GEOM_CONCAVE_INTERNAL_EDGE,
            physicsClientId=client,
        )
    )


def _static_body(client: int, shape: int) -> int:
    body = int(pybullet.createMultiBody(0.0, shape, physicsClientId=client))
    pybullet.changeDynamics(body, -1, lateralFriction=_ROCK_FRICTION, restitution=0.0, physicsClientId=client)
    return body


def mesh_tiles(mesh: TriangleMesh, most_vertices: int, most_indices: int) -> Iterator[tuple[FloatArray, IntArray]]:
    """Vertices (V, 3) and faces (F, 3) of pieces of a mesh that stay within both limits, by halving its longer side."""
    if not len(mesh.faces):
        return
    stack = [np.arange(len(mesh.faces))]
    centres = mesh.vertices_m[mesh.faces].mean(axis=1)
    while stack:
        chosen = stack.pop()
        used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
        if len(used) <= most_vertices and 3 * len(chosen) <= most_indices:
            yield mesh.vertices_m[used], faces.reshape(-1, 3).astype(np.int32)
            continue
        axis = int(np.argmax(np.ptp(centres[chosen, :2], axis=0)))
        order = chosen[np.argsort(centres[chosen, axis], kind="stable")]
        stack += [order[len(order) // 2 :], order[: len(order) // 2]]
