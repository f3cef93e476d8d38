"""Which obstacle a point in the world belongs to."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from worlds.types import FloatArray, TriangleMesh, Vector3

_REACH_M = 0.25  # a contact may lie this far outside the box around an obstacle's vertices


class ObstacleIndex:
    """The obstacles of a mesh one by one; finds the one whose vertices are nearest to a point.

    Obstacle i has ``vertices[starts[i] : starts[i + 1]]`` and ``faces[face_starts[i] : face_starts[i + 1]]`` (into
    ``mesh_vertices``), and lies ``_REACH_M`` inside the box ``low[i]`` to ``high[i]``.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.take(mesh)

    def take(self, mesh: TriangleMesh) -> None:
        """Hold the obstacles of ``mesh`` instead of those before."""
        count = max(len(mesh.vertices_m), 1)
        # Each vertex once per obstacle, as one number: sorting pairs of columns takes ten times as long.
        pairs = np.unique(np.repeat(mesh.owner, 3).astype(np.int64) * count + mesh.faces.ravel())
        self._ids, starts = np.unique(pairs // count, return_index=True)
        self.starts = np.append(starts, len(pairs)).astype(np.int64)
        self.mesh_vertices = np.ascontiguousarray(mesh.vertices_m, dtype=np.float64).reshape(-1, 3)
        self.vertices = self.mesh_vertices[pairs % count].reshape(-1, 3) if len(pairs) else self.mesh_vertices[:0]
        self.low, self.high = _boxes(self.vertices, self.starts)
        order = np.argsort(mesh.owner, kind="stable")
        self.faces = np.ascontiguousarray(mesh.faces[order], dtype=np.int32).reshape(-1, 3)
        self.face_starts = np.append(np.searchsorted(mesh.owner[order], self._ids), len(order)).astype(np.int64)

    def nearest(self, point_w: Vector3) -> int:
        """Id of the obstacle at a point of contact; 0 if there is none within reach."""
        if not len(self._ids):
            return 0
        place = _nearest(self.vertices, self.starts, self.low, self.high, *point_w)
        return int(self._ids[place]) if place >= 0 else 0


def _boxes(vertices: FloatArray, starts: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corners (n, 3) of the boxes around each obstacle's vertices, widened by the reach."""
    if not len(vertices):
        return np.zeros((0, 3)), np.zeros((0, 3))
    low = np.minimum.reduceat(vertices, starts[:-1]) - _REACH_M
    high = np.maximum.reduceat(vertices, starts[:-1]) + _REACH_M
    return low, high


@njit(cache=True)
def _nearest(
    vertices: FloatArray, starts: NDArray[np.int64], low: FloatArray, high: FloatArray, x: float, y: float, z: float
) -> int:
    best, place = 1e300, -1
    for i in range(low.shape[0]):
        if x < low[i, 0] or x > high[i, 0] or y < low[i, 1] or y > high[i, 1] or z < low[i, 2] or z > high[i, 2]:
            continue
        for k in range(starts[i], starts[i + 1]):
            dx, dy, dz = vertices[k, 0] - x, vertices[k, 1] - y, vertices[k, 2] - z
            distance = dx * dx + dy * dy + dz * dz
            if distance < best:
                best, place = distance, i
    return place
