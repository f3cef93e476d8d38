"""Meshes made by hand as the shapes of a world."""

from __future__ import annotations

import numpy as np

from worlds.types import FloatArray, IntArray, TriangleMesh

NO_MESH = TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))


class PreparedShapes:
    """Two meshes, fine and coarse, as `worlds.types.Shapes`; a thing is all faces of one owner."""

    def __init__(self, picture: TriangleMesh, collision: TriangleMesh | None = None) -> None:
        self._meshes = (picture, picture if collision is None else collision)
        self.ids: IntArray = np.unique(picture.owner)
        corners = [picture.vertices_m[picture.faces[picture.owner == owner]].reshape(-1, 3) for owner in self.ids]
        self.bounds_w: tuple[FloatArray, FloatArray] = (
            np.array([part.min(axis=0) for part in corners]).reshape(-1, 3),
            np.array([part.max(axis=0) for part in corners]).reshape(-1, 3),
        )

    def picture(self, which: IntArray) -> TriangleMesh:
        return self._part(self._meshes[0], which)

    def collision(self, which: IntArray) -> TriangleMesh:
        return self._part(self._meshes[1], which)

    def face_counts(self) -> tuple[int, int]:
        return len(self._meshes[0].faces), len(self._meshes[1].faces)

    def _part(self, mesh: TriangleMesh, which: IntArray) -> TriangleMesh:
        vertices, faces, owners, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int32)], [np.zeros(0, np.int32)], 0
        for owner in self.ids[which]:
            used, corner = np.unique(mesh.faces[mesh.owner == owner], return_inverse=True)
            vertices.append(mesh.vertices_m[used])
            faces.append(corner.reshape(-1, 3).astype(np.int32) + count)
            owners.append(np.full(len(faces[-1]), owner, np.int32))
            count += len(used)
        return TriangleMesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32), np.concatenate(owners))
