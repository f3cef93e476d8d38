"""Rocks and cylinders as the renderer draws them: meshes made as the camera comes near, in three levels of detail.

A large world has hundreds of thousands of rocks, of which a camera sees a few thousand as more than a dot. What a
place of the camera, and every place within some metres of it, can need is made when the camera gets there, and kept.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rover_sim.sim.raster_kernels import GROUND_TAG, NEAR
from rover_sim.sim.raster_scene import View
from worlds.types import FloatArray, IntArray, Shapes, TriangleMesh

COARSE_BELOW_PX = 12.0  # things narrower than this are drawn with the collision mesh
OCTAHEDRON_BELOW_PX = 2.5  # those narrower than this as octahedra
INVISIBLE_BELOW_PX = 0.35  # and those narrower than this not at all
STEP_M = 4.0  # the camera may move so far before it is asked anew what it can see
MOST_FACES = 4_000_000  # kept; when there are more, all are forgotten: about 160 MB

T = TypeVar("T", bound=np.generic)

FINE, COARSE, OCTAHEDRON = 0, 1, 2


class StoneStore:
    """The meshes that were made so far, one after another in shared arrays."""

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes
        self.owner = shapes.ids
        self._low_w, self._high_w = shapes.bounds_w
        self.centre_w: FloatArray = (self._low_w + self._high_w) / 2
        self.radius_m: FloatArray = np.linalg.norm(self._high_w - self._low_w, axis=1) / 2
        self._seen_from: FloatArray | None = None
        self._focal_px = 0.0
        self._near: IntArray = np.zeros(0, dtype=np.int32)  # what may be seen from around there
        self._forget()

    @property
    def vertices_w(self) -> FloatArray:
        """Vertices (V, 3) of all meshes."""
        return self._vertices[: self._used[0]]

    @property
    def faces(self) -> IntArray:
        """Faces (F, 3) of all meshes."""
        return self._faces[: self._used[1]]

    @property
    def normals(self) -> NDArray[np.float32]:
        """Outward unit normals (F, 3)."""
        return self._normals[: self._used[1]]

    @property
    def face_block(self) -> IntArray:
        """Place (F,) in ``owner`` of what each face belongs to."""
        return self._block[: self._used[1]]

    def choose(self, view: View) -> IntArray:
        """Ranges (K, 4), first and past-last vertex and face, of what to draw."""
        self._follow(view)
        centre, radius = self._near_centre_w, self._near_radius_m
        distance = np.linalg.norm(centre - view.eye_w, axis=1) - radius
        width_px = 2 * radius * view.focal_px / np.maximum(distance, NEAR)
        seen = np.flatnonzero(view.sees(centre, radius) & (width_px >= INVISIBLE_BELOW_PX))
        level = (width_px[seen] < COARSE_BELOW_PX).astype(int) + (width_px[seen] < OCTAHEDRON_BELOW_PX)
        return np.asarray(self._ranges[level, self._near[seen]])

    def at(self, level: int, which: IntArray) -> IntArray:
        """Ranges (K, 4) of the meshes of ``which`` (K,) in one level of detail."""
        self._load(level, which)
        return np.asarray(self._ranges[level, which])

    def ids(self, tags: IntArray) -> IntArray:
        """Owner ids of a tag buffer; sky and ground stay what they are."""
        ids = tags.copy()
        stone = tags > GROUND_TAG
        ids[stone] = self.owner[self.face_block[tags[stone] - 1]]
        return ids

    def _follow(self, view: View) -> None:
        """Make what can be seen from within `STEP_M` of the camera, whichever way it looks."""
        if (
            self._seen_from is not None
            and view.focal_px == self._focal_px
            and float(np.linalg.norm(view.eye_w - self._seen_from)) <= STEP_M
        ):
            return
        if self._used[1] > MOST_FACES:
            self._forget()
        self._seen_from, self._focal_px = view.eye_w.copy(), view.focal_px
        distance = np.linalg.norm(self.centre_w - view.eye_w, axis=1) - self.radius_m
        size = 2 * self.radius_m * view.focal_px
        widest = size / np.maximum(distance - STEP_M, NEAR)
        narrowest = size / np.maximum(distance + STEP_M, NEAR)
        self._near = np.flatnonzero(widest >= INVISIBLE_BELOW_PX).astype(np.int32)
        self._near_centre_w, self._near_radius_m = self.centre_w[self._near], self.radius_m[self._near]
        widest, narrowest = widest[self._near], narrowest[self._near]
        self._load(FINE, self._near[widest >= COARSE_BELOW_PX])
        self._load(COARSE, self._near[(widest >= OCTAHEDRON_BELOW_PX) & (narrowest < COARSE_BELOW_PX)])
        self._load(OCTAHEDRON, self._near[narrowest < OCTAHEDRON_BELOW_PX])

    def _forget(self) -> None:
        self._used = (0, 0)
        self._vertices: FloatArray = np.zeros((0, 3))
        self._faces: IntArray = np.zeros((0, 3), dtype=np.int32)
        self._normals: NDArray[np.float32] = np.zeros((0, 3), dtype=np.float32)
        self._block: IntArray = np.zeros(0, dtype=np.int32)
        self._ranges: IntArray = np.zeros((3, len(self.owner), 4), dtype=np.int32)

    def _load(self, level: int, which: IntArray) -> None:
        """Make those of ``which`` (K,) that are not there yet."""
        missing = which[self._ranges[level, which, 1] == 0]
        if not len(missing):
            return
        if level == OCTAHEDRON:
            self._add(level, octahedra(self._low_w[missing], self._high_w[missing], self.owner[missing]))
        else:
            self._add(level, (self._shapes.picture if level == FINE else self._shapes.collision)(missing))

    def _add(self, level: int, mesh: TriangleMesh) -> None:
        """Append a mesh; each owner has a run of vertices and one of faces in it."""
        start = np.flatnonzero(np.diff(mesh.owner, prepend=-1))
        block = np.searchsorted(self.owner, mesh.owner).astype(np.int32)
        runs = np.column_stack(
            [
                np.minimum.reduceat(mesh.faces.min(axis=1), start),
                np.maximum.reduceat(mesh.faces.max(axis=1), start) + 1,
                start,
                np.append(start[1:], len(mesh.faces)),
            ]
        )
        vertex, face = self._used
        self._ranges[level, block[start]] = runs + np.array([vertex, vertex, face, face])
        self._used = (vertex + len(mesh.vertices_m), face + len(mesh.faces))
        self._vertices = _with_room(self._vertices, self._used[0])
        self._faces = _with_room(self._faces, self._used[1])
        self._normals = _with_room(self._normals, self._used[1])
        self._block = _with_room(self._block, self._used[1])
        self._vertices[vertex : self._used[0]] = mesh.vertices_m
        self._faces[face : self._used[1]] = mesh.faces + vertex
        self._normals[face : self._used[1]] = face_normals(mesh)
        self._block[face : self._used[1]] = block


def _with_room(array: NDArray[T], length: int) -> NDArray[T]:
    """The array, or a copy at least half as long again that holds ``length`` rows."""
    if length <= len(array):
        return array
    longer = np.zeros((max(length, 3 * len(array) // 2), *array.shape[1:]), dtype=array.dtype)
    longer[: len(array)] = array
    return longer


def face_normals(mesh: TriangleMesh) -> FloatArray:
    """Outward unit normals (F, 3); upwards for a face without area."""
    corner = mesh.vertices_m[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    up = np.tile([0.0, 0.0, 1.0], (len(normal), 1))
    return np.asarray(np.divide(normal, length, out=up, where=length > 0))


def octahedra(lower_w: FloatArray, upper_w: FloatArray, owner: IntArray) -> TriangleMesh:
    """One octahedron a box, as large on the screen as the ellipsoid in that box."""
    # A rhombus in an ellipse covers 2 / pi of it.
    half = (upper_w - lower_w) / 2 * np.sqrt(np.pi / 2)
    tips = np.concatenate([np.eye(3), -np.eye(3)])
    vertices = ((lower_w + upper_w)[:, None] / 2 + tips * half[:, None]).reshape(-1, 3)
    upper_faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]])
    lower_faces = np.array([[1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    faces = np.concatenate([upper_faces, lower_faces]) + 6 * np.arange(len(owner))[:, None, None]
    return TriangleMesh(vertices, faces.reshape(-1, 3).astype(np.int32), np.repeat(owner, 8))
