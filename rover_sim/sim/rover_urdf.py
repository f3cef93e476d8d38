"""A rover model as a robot description for PyBullet."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from rover_sim.sim.rover import Box, RoverModel
from worlds.types import Vector3

WHEEL_NAMES = ("wheel_left_front", "wheel_left_rear", "wheel_right_front", "wheel_right_rear")
_QUARTER_TURN = "1.5707963267948966 0 0"  # a URDF cylinder lies along z, an axle along y


def urdf(model: RoverModel) -> str:
    """URDF text: link ``chassis`` and four wheels on continuous joints about y, in the order of `WHEEL_NAMES`."""
    robot = Element("robot", name=model.name)
    _add_chassis(robot, model)
    for name, position in zip(WHEEL_NAMES, model.wheel.positions_m, strict=True):
        _add_wheel(robot, name, position, model)
    indent(robot)
    return tostring(robot, encoding="unicode")


def _add_chassis(robot: Element, model: RoverModel) -> None:
    chassis = model.chassis
    link = SubElement(robot, "link", name="chassis")
    _add_inertial(link, chassis.mass_kg, chassis.inertia_kg_m2, chassis.centre_of_mass_m)
    for box in chassis.box:
        _add_box(link, box)


def _add_box(link: Element, box: Box) -> None:
    collision = SubElement(link, "collision")
    SubElement(collision, "origin", xyz=_text(box.centre_m), rpy="0 0 0")
    SubElement(SubElement(collision, "geometry"), "box", size=_text(box.size_m))


def _add_wheel(robot: Element, name: str, position: Vector3, model: RoverModel) -> None:
    wheel = model.wheel
    link = SubElement(robot, "link", name=name)
    across = wheel.mass_kg * (3.0 * wheel.radius_m**2 + wheel.width_m**2) / 12.0
    axial = 0.5 * wheel.mass_kg * wheel.radius_m**2 + model.motor.rotor_inertia_kg_m2
    # No body has one moment above the sum of the others; the rotor only matters about the axle.
    across = max(across, 0.5 * axial)
    _add_inertial(link, wheel.mass_kg, (across, axial, across), (0.0, 0.0, 0.0))
    collision = SubElement(link, "collision")
    SubElement(collision, "origin", xyz="0 0 0", rpy=_QUARTER_TURN)
    geometry = SubElement(collision, "geometry")
    SubElement(geometry, "cylinder", radius=repr(wheel.radius_m), length=repr(wheel.width_m))
    joint = SubElement(robot, "joint", name=f"{name}_joint", type="continuous")
    SubElement(joint, "parent", link="chassis")
    SubElement(joint, "child", link=name)
    SubElement(joint, "origin", xyz=_text(position), rpy="0 0 0")
    SubElement(joint, "axis", xyz="0 1 0")


def _add_inertial(link: Element, mass_kg: float, inertia: Vector3, centre: Vector3) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(mass_kg))
    ixx, iyy, izz = (repr(value) for value in inertia)
    SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")


def _text(vector: Vector3) -> str:
    return " ".join(repr(float(value)) for value in vector)
