"""The virtual terrain model as binary glTF: ground in the colours of its classes, lofted rocks, paths as ribbons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from perception.pipeline import Perception
from perception.rock_placement import View
from rover_sim.export.part import y_up
from rover_sim.report.perceived_overlay import CLASS_COLOURS
from rover_sim.virtual_terrain import placed_rocks, window_corners
from worlds.rock_mesh import PICTURE_LEVELS, rock_meshes
from worlds.types import ByteArray, FloatArray, HeightField, IntArray, RockTable

Colour = tuple[int, int, int, int]

_SAND, _ROCK, _PATH = (196, 160, 112, 255), (112, 104, 96, 255), (0, 230, 230, 255)
_CELL_M = 0.5
_LIFT_M = 0.005  # between ground, classes and paths, so that viewers can tell which lies on top
_RIBBON_M = 0.12
_TINT = 0.6


def terrain_glb(found: Perception, view: View, paths_w: Sequence[FloatArray], reach_m: float) -> bytes:
    """Binary glTF, y up, of what a picture showed on the level plane z = 0, the camera over the origin.

    Meshes: ``ground`` (whole plane), ``classes`` (the windows in view out to ``reach_m``), ``rocks``, ``paths``; those
    that would be empty are left out.
    """
    ground = _ground(reach_m)
    scene = trimesh.Scene()
    _add(scene, "ground", *_sheet(ground), _SAND)
    _add_classes(scene, found, window_corners(view, (found.classes.shape[0], found.classes.shape[1]), reach_m))
    rocks = list(placed_rocks(found, view))
    if rocks:
        mesh = rock_meshes(RockTable.of(rocks), ground, PICTURE_LEVELS)
        _add(scene, "rocks", mesh.vertices_m, mesh.faces, _ROCK)
    ribbons = [_ribbon(path) for path in paths_w if len(path) > 1]
    if ribbons:
        shifts = np.cumsum([0, *(len(vertices) for vertices, _ in ribbons[:-1])])
        faces = np.concatenate([part + shift for (_, part), shift in zip(ribbons, shifts, strict=True)])
        _add(scene, "paths", np.concatenate([vertices for vertices, _ in ribbons]), faces, _PATH)
    return bytes(scene.export(file_type="glb"))  # type: ignore[no-untyped-call]


def _ground(reach_m: float) -> HeightField:
    """Level ground from behind the camera to somewhat beyond the reach."""
    ahead, side = int(np.ceil((reach_m + 2.0) / _CELL_M)), int(np.ceil((reach_m + 1.0) / _CELL_M))
    return HeightField(np.zeros((2 * side + 1, ahead + 3)), _CELL_M, (-2.0 * _CELL_M, -side * _CELL_M))


def _sheet(ground: HeightField) -> tuple[FloatArray, IntArray]:
    (x0, x1), (y0, y1) = ground.x_limits_m, ground.y_limits_m
    corners = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
    return corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def _add_classes(scene: trimesh.Scene, found: Perception, corners: FloatArray) -> None:
    """One quadrilateral a window that lies within reach, in the colour of its class over sand."""
    quads = np.stack([corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:], corners[:-1, :-1]], axis=2)
    seen = ~np.isnan(quads).any(axis=(2, 3))
    count = int(seen.sum())
    if not count:
        return
    points = np.concatenate([quads[seen].reshape(-1, 2), np.full((4 * count, 1), _LIFT_M)], axis=1)
    faces = (np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(count)[:, None, None]).reshape(-1, 3)
    letters = np.array([[*CLASS_COLOURS[letter], 255] for letter in found.classes[seen].tolist()])
    mixed = np.round(_TINT * letters + (1.0 - _TINT) * np.array(_SAND)).astype(np.uint8)
    _add(scene, "classes", points, faces.astype(np.int32), np.repeat(mixed, 4, axis=0))


def _ribbon(path_w: FloatArray) -> tuple[FloatArray, IntArray]:
    """A flat band along a path (N, 2), facing up."""
    along = np.gradient(path_w, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    left = np.column_stack([-along[:, 1], along[:, 0]]) * _RIBBON_M / 2.0
    height = np.full((len(path_w), 1), 2.0 * _LIFT_M)
    vertices = np.concatenate([np.hstack([path_w + left, height]), np.hstack([path_w - left, height])])
    n = np.arange(len(path_w) - 1)
    right = n + len(path_w)
    faces = np.concatenate([np.stack([n, right, right + 1], axis=1), np.stack([n, right + 1, n + 1], axis=1)])
    return vertices, faces.astype(np.int32)


def _add(scene: trimesh.Scene, name: str, vertices: FloatArray, faces: IntArray, colours: Colour | ByteArray) -> None:
    """Add a mesh in one colour, or in one (V, 4) a vertex."""
    shades = np.broadcast_to(np.asarray(colours, dtype=np.uint8), (len(vertices), 4))
    mesh = trimesh.Trimesh(y_up(vertices), faces, process=False, vertex_colors=shades)
    scene.add_geometry(mesh, geom_name=name, node_name=name)
