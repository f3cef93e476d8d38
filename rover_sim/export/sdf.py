"""A world for Gazebo: SDF 1.7 with ground and rocks as static models, gravity, sun and geographic place."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from rover_sim.export.obj_file import Solid, file_names, write_solids
from rover_sim.export.part import Part
from rover_sim.files import write_text
from worlds.geometry import euler_from_quaternion
from worlds.scenario import Sun


def write_sdf(part: Part, folder: Path) -> list[str]:
    """Write ``world.sdf`` and the meshes that it names; the names of the files."""
    world = part.world
    root = ET.Element("sdf", version="1.7")
    top = ET.SubElement(root, "world", name=world.scenario.name)
    _text(top, "gravity", f"0 0 {-world.scenario.gravity_m_s2:g}")
    _add_place(top, part)
    _add_sun(top, world.scenario.sun)
    solids = write_solids(part, folder)
    for solid in solids:
        _add_model(top, solid)
    _add_frame(top, "start", (*world.start.position_w, *euler_from_quaternion(world.start.quaternion_w)))
    _add_frame(top, "goal", (*world.goal_w, 0.0, 0.0, 0.0))
    ET.indent(root)
    write_text(folder / "world.sdf", '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n")
    return ["world.sdf", *file_names(solids)]


def _text(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, tag).text = text


def _add_place(top: ET.Element, part: Part) -> None:
    origin = part.world.origin
    place = ET.SubElement(top, "spherical_coordinates")
    _text(place, "surface_model", "EARTH_WGS84")
    _text(place, "world_frame_orientation", "ENU")
    _text(place, "latitude_deg", repr(origin.latitude_deg))
    _text(place, "longitude_deg", repr(origin.longitude_deg))
    _text(place, "elevation", f"{origin.altitude_m:g}")
    _text(place, "heading_deg", "0")


def _add_sun(top: ET.Element, sun: Sun) -> None:
    azimuth, elevation = np.radians([sun.azimuth_deg, sun.elevation_deg])
    down = -np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    light = ET.SubElement(top, "light", name="sun", type="directional")
    _text(light, "cast_shadows", "true")
    _text(light, "diffuse", "0.97 0.95 0.91 1")
    _text(light, "specular", "0.1 0.1 0.1 1")
    _text(light, "direction", " ".join(f"{value:.6f}" for value in down))


def _add_model(top: ET.Element, solid: Solid) -> None:
    """A static model with a mesh to look at and one to touch."""
    model = ET.SubElement(top, "model", name=solid.name)
    _text(model, "static", "true")
    link = ET.SubElement(model, "link", name=solid.name)
    for kind, file in (("visual", solid.visual), ("collision", solid.collision)):
        item = ET.SubElement(link, kind, name=kind)
        _text(ET.SubElement(ET.SubElement(item, "geometry"), "mesh"), "uri", file)
        if kind == "visual":
            material = ET.SubElement(item, "material")
            _text(material, "ambient", solid.colour)
            _text(material, "diffuse", solid.colour)


def _add_frame(top: ET.Element, name: str, pose: tuple[float, ...]) -> None:
    frame = ET.SubElement(top, "frame", name=name)
    _text(frame, "pose", " ".join(f"{value:.6g}" for value in pose))
