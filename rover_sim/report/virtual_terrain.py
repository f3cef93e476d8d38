"""The paper's virtual terrain model (section 4): perceived rocks as lofted solids on a ground plane, as binary glTF."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from perception.pipeline import ImageRock
from worlds.rock_mesh import PICTURE_LEVELS, rock_meshes
from worlds.types import FloatArray, HeightField, PerceivedRock, Rock, RockShape, RockTable

_SAND, _ROCK = (196, 160, 112, 255), (112, 104, 96, 255)
_CELL_M = 0.5


def terrain_glb(rocks: Sequence[ImageRock], reach_m: float) -> bytes:
    """Binary glTF of the placed ``rocks`` on the level plane z = 0, the camera over the origin looking along x."""
    ground = _ground(reach_m)
    scene = trimesh.Scene()
    _add(scene, "ground", *_sheet(ground), _SAND)
    solids = [rock_of(rock, rock.placed) for rock in rocks if rock.placed is not None]
    if solids:
        mesh = rock_meshes(RockTable.of(solids), ground, PICTURE_LEVELS)
        _add(scene, "rocks", mesh.vertices_m, np.asarray(mesh.faces), _ROCK)
    return bytes(scene.export(file_type="glb"))  # type: ignore[no-untyped-call]


def rock_of(seen: ImageRock, placed: PerceivedRock) -> Rock:
    """The perceived rock as a solid: sections A0..A8 give its profile along the longer axis."""
    widest = max(*seen.sections_px, 1e-6)
    profile = tuple(float(np.clip(section / widest, 0.05, 1.0)) for section in seen.sections_px)
    x, y, _ = placed.position_w
    return Rock(
        id=seen.id,
        position_w=(x, y, 0.0),
        length_m=placed.length_m,
        width_m=placed.width_m,
        height_m=placed.height_m,
        yaw_rad=placed.yaw_rad,
        shape=RockShape(seen.formation, profile),
    )


def _ground(reach_m: float) -> HeightField:
    """Level ground from behind the camera to somewhat beyond the reach."""
    ahead, side = int(np.ceil((reach_m + 2.0) / _CELL_M)), int(np.ceil((reach_m + 1.0) / _CELL_M))
    return HeightField(np.zeros((2 * side + 1, ahead + 3)), _CELL_M, (-2.0 * _CELL_M, -side * _CELL_M))


def _sheet(ground: HeightField) -> tuple[FloatArray, FloatArray]:
    (x0, x1), (y0, y1) = ground.x_limits_m, ground.y_limits_m
    corners = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
    return corners, np.array([[0, 1, 2], [0, 2, 3]])


def _add(
    scene: trimesh.Scene, name: str, vertices: FloatArray, faces: FloatArray, colour: tuple[int, int, int, int]
) -> None:
    vertices = vertices[:, [0, 2, 1]] * (1.0, 1.0, -1.0)  # glTF has y up
    mesh = trimesh.Trimesh(
        vertices, faces, process=False, vertex_colors=np.tile(np.array(colour, np.uint8), (len(vertices), 1))
    )
    scene.add_geometry(mesh, geom_name=name, node_name=name)
