"""Triangle meshes as Wavefront OBJ, which Gazebo, PyBullet, MuJoCo and Blender read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rover_sim.export.part import Part
from rover_sim.files import atomic_path
from worlds.types import TriangleMesh

_ROWS = 20_000  # written at a time


@dataclass(frozen=True)
class Solid:
    """A thing of an exported world: the file to look at, the one to touch, and its colour."""

    name: str
    visual: str
    collision: str
    colour: str  # red, green, blue and alpha, 0 to 1


def write_solids(part: Part, folder: Path) -> tuple[Solid, ...]:
    """Write ground and rocks as OBJ files, and remove those of rocks that an earlier world left."""
    ground = Solid("ground", "ground.obj", "ground.obj", "0.69 0.56 0.40 1")
    rocks = Solid("rocks", "rocks.obj", "rocks_contact.obj", "0.45 0.44 0.40 1")
    if len(part.which):  # first, as there may be too many
        write_obj(folder / rocks.visual, part.rocks)
        write_obj(folder / rocks.collision, part.rocks_for_contact)
    else:
        for name in (rocks.visual, rocks.collision):
            (folder / name).unlink(missing_ok=True)
    write_obj(folder / ground.visual, part.ground_mesh)
    return (ground, rocks) if len(part.which) else (ground,)


def file_names(solids: tuple[Solid, ...]) -> list[str]:
    """The files of some things, each once."""
    return list(dict.fromkeys(name for solid in solids for name in (solid.visual, solid.collision)))


def write_obj(path: Path, mesh: TriangleMesh) -> None:
    """Write vertices to a tenth of a millimetre and faces; z is up, as in the world."""
    with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as file:
        for first in range(0, len(mesh.vertices_m), _ROWS):
            rows = mesh.vertices_m[first : first + _ROWS]
            file.write("v %.4f %.4f %.4f\n" * len(rows) % tuple(rows.ravel().tolist()))
        for first in range(0, len(mesh.faces), _ROWS):
            corners = mesh.faces[first : first + _ROWS] + 1
            file.write("f %d %d %d\n" * len(corners) % tuple(corners.ravel().tolist()))
