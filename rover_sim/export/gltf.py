"""A world for Blender and viewers: binary glTF with ground and rocks as meshes of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from rover_sim.export.part import Part, y_up
from rover_sim.files import atomic_path
from worlds.types import TriangleMesh

_SAND, _ROCK = (176, 144, 101, 255), (116, 112, 101, 255)


def write_gltf(part: Part, folder: Path) -> list[str]:
    """Write ``world.glb``, y up as glTF has it; the names of the files."""
    scene = trimesh.Scene()
    _add(scene, "ground", part.ground_mesh, _SAND)
    if len(part.which):
        _add(scene, "rocks", part.rocks, _ROCK)
    with atomic_path(folder / "world.glb") as path:
        path.write_bytes(bytes(scene.export(file_type="glb")))  # type: ignore[no-untyped-call]
    return ["world.glb"]


def _add(scene: trimesh.Scene, name: str, mesh: TriangleMesh, colour: tuple[int, int, int, int]) -> None:
    material = trimesh.visual.material.PBRMaterial(  # type: ignore[no-untyped-call]
        name=name, baseColorFactor=np.array(colour, np.uint8), metallicFactor=0.0, roughnessFactor=1.0
    )
    visual = trimesh.visual.TextureVisuals(material=material)  # type: ignore[no-untyped-call]
    shape = trimesh.Trimesh(y_up(mesh.vertices_m), mesh.faces, visual=visual, process=False)
    scene.add_geometry(shape, geom_name=name, node_name=name)
