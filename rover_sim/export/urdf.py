"""A world as one fixed body for PyBullet and other readers of URDF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from rover_sim.export.obj_file import Solid, file_names, write_solids
from rover_sim.export.part import Part
from rover_sim.files import write_text


def write_urdf(part: Part, folder: Path) -> list[str]:
    """Write ``world.urdf`` and the meshes that it names; the names of the files.

    A link of mass zero does not move. PyBullet takes meshes as they are (its attribute ``concave``); programs that
    take the convex hull of each mesh, as MuJoCo does, need the height map for the ground.
    """
    root = ET.Element("robot", name=part.world.scenario.name)
    solids = write_solids(part, folder)
    for solid in solids:
        _add_link(root, solid)
    for solid in solids[1:]:
        joint = ET.SubElement(root, "joint", name=f"{solid.name}_on_{solids[0].name}", type="fixed")
        ET.SubElement(joint, "parent", link=solids[0].name)
        ET.SubElement(joint, "child", link=solid.name)
    ET.indent(root)
    write_text(folder / "world.urdf", '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n")
    return ["world.urdf", *file_names(solids)]


def _add_link(root: ET.Element, solid: Solid) -> None:
    link = ET.SubElement(root, "link", name=solid.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "mass", value="0")
    ET.SubElement(inertial, "inertia", ixx="0", ixy="0", ixz="0", iyy="0", iyz="0", izz="0")
    for kind, file in (("visual", solid.visual), ("collision", solid.collision)):
        item = ET.SubElement(link, kind, {"concave": "yes"} if kind == "collision" else {})
        ET.SubElement(ET.SubElement(item, "geometry"), "mesh", filename=file)
        if kind == "visual":
            material = ET.SubElement(item, "material", name=solid.name)
            ET.SubElement(material, "color", rgba=solid.colour)
