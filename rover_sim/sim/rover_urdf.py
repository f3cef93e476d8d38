"""A rover model as a robot description for PyBullet."""

from __future__ import annotations

from math import radians
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from rover_sim.sim.rover import CHASSIS, Arm, ArmBox, Box, RoverModel
from worlds.types import Vector3

_QUARTER_TURN = "1.5707963267948966 0 0"  # a URDF cylinder lies along z, an axle along y
_ROWS = {2: ("front", "rear"), 3: ("front", "middle", "rear")}
_ORIGIN = (0.0, 0.0, 0.0)


def wheel_names(model: RoverModel) -> tuple[str, ...]:
    """Link names of the wheels, in the order of the rover file."""
    half = len(model.wheel.positions_m) // 2
    rows = _ROWS.get(half, tuple(str(row + 1) for row in range(half)))
    return tuple(f"wheel_{side}_{row}" for side in ("left", "right") for row in rows)


def urdf(model: RoverModel) -> str:
    """URDF text: link ``chassis``, the arms, and `wheel_names` on continuous joints; all joints turn about y."""
    robot = Element("robot", name=model.name)
    chassis, suspension = model.chassis, model.suspension
    _add_link(robot, CHASSIS, chassis.mass_kg, chassis.inertia_kg_m2, chassis.centre_of_mass_m, chassis.box, _ORIGIN)
    pivots = {CHASSIS: _ORIGIN, **{arm.name: arm.pivot_m for arm in suspension.arm}}
    for arm in suspension.arm:
        _add_arm(robot, arm, pivots[arm.parent])
    names = wheel_names(model)
    carriers = suspension.wheel_arms or (CHASSIS,) * len(names)
    for name, position, carrier in zip(names, model.wheel.positions_m, carriers, strict=True):
        _add_wheel(robot, name, model)
        _add_joint(robot, name, "continuous", carrier, _minus(position, pivots[carrier]))
    indent(robot)
    return tostring(robot, encoding="unicode")


def _add_arm(robot: Element, arm: Arm, parent_pivot: Vector3) -> None:
    _add_link(robot, arm.name, arm.mass_kg, arm.inertia_kg_m2, arm.centre_of_mass_m, arm.box, arm.pivot_m)
    joint = _add_joint(robot, arm.name, "revolute", arm.parent, _minus(arm.pivot_m, parent_pivot))
    low, high = (repr(radians(limit)) for limit in arm.limits_deg)
    SubElement(joint, "limit", lower=low, upper=high, effort="0", velocity="0")


def _add_link(
    robot: Element,
    name: str,
    mass_kg: float,
    inertia: Vector3,
    centre: Vector3,
    boxes: tuple[Box, ...],
    origin: Vector3,
) -> None:
    """A link with boxes; all places are in body axes, ``origin`` is that of the link."""
    link = SubElement(robot, "link", name=name)
    _add_inertial(link, mass_kg, inertia, _minus(centre, origin))
    for box in boxes:
        collision = SubElement(link, "collision")
        pitch = radians(box.pitch_deg) if isinstance(box, ArmBox) else 0.0
        SubElement(collision, "origin", xyz=_text(_minus(box.centre_m, origin)), rpy=f"0 {pitch!r} 0")
        SubElement(SubElement(collision, "geometry"), "box", size=_text(box.size_m))


def _add_wheel(robot: Element, name: str, model: RoverModel) -> None:
    wheel = model.wheel
    link = SubElement(robot, "link", name=name)
    across = wheel.mass_kg * (3.0 * wheel.radius_m**2 + wheel.width_m**2) / 12.0
    axial = 0.5 * wheel.mass_kg * wheel.radius_m**2 + model.motor.rotor_inertia_kg_m2
    # No body has one moment above the sum of the others; the rotor only matters about the axle.
    across = max(across, 0.5 * axial)
    _add_inertial(link, wheel.mass_kg, (across, axial, across), _ORIGIN)
    collision = SubElement(link, "collision")
    SubElement(collision, "origin", xyz="0 0 0", rpy=_QUARTER_TURN)
    geometry = SubElement(collision, "geometry")
    SubElement(geometry, "cylinder", radius=repr(wheel.radius_m), length=repr(wheel.width_m))


def _add_joint(robot: Element, child: str, kind: str, parent: str, position: Vector3) -> Element:
    joint = SubElement(robot, "joint", name=f"{child}_joint", type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=_text(position), rpy="0 0 0")
    SubElement(joint, "axis", xyz="0 1 0")
    return joint


def _add_inertial(link: Element, mass_kg: float, inertia: Vector3, centre: Vector3) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(mass_kg))
    ixx, iyy, izz = (repr(value) for value in inertia)
    SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")


def _minus(a: Vector3, b: Vector3) -> Vector3:
    x, y, z = np.subtract(a, b).tolist()
    return x, y, z


def _text(vector: Vector3) -> str:
    return " ".join(repr(float(value)) for value in vector)
