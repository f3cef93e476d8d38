"""The formats by their name on the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rover_sim.export.gltf import write_gltf
from rover_sim.export.heightmap import write_heightmap
from rover_sim.export.part import Part
from rover_sim.export.sdf import write_sdf
from rover_sim.export.urdf import write_urdf

WRITERS: dict[str, Callable[[Part, Path], list[str]]] = {
    "sdf": write_sdf,
    "urdf": write_urdf,
    "gltf": write_gltf,
    "heightmap": write_heightmap,
}
