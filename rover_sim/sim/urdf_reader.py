"""Robot descriptions (URDF) as links and joints with their places in the frame of the root link, joints at zero."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from worlds.errors import ScenarioError
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion
from worlds.types import FloatArray

if TYPE_CHECKING:
    from collections.abc import Iterator

MOVABLE = ("revolute", "continuous", "prismatic", "planar", "floating")
_ROTATING = ("revolute", "continuous")
_MOST_LINKS = 500


@dataclass(frozen=True, eq=False)
class Shape:
    """A collision shape: ``size`` is that of a box, (radius, length) of a cylinder along z, (radius,) of a sphere."""

    kind: str  # box, cylinder, sphere, mesh
    size: tuple[float, ...]  # the scale of a mesh
    place: FloatArray  # (4, 4) in the root frame
    mesh: str = ""


@dataclass(frozen=True, eq=False)
class Link:
    """One rigid part; centre of mass and inertia (about it) are in the axes of the root frame."""

    name: str
    place: FloatArray  # (4, 4)
    mass_kg: float
    centre: FloatArray  # (3,)
    inertia: FloatArray  # (3, 3)
    shapes: tuple[Shape, ...]
    joint: str | None  # that it hangs on


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint; ``axis`` is in the axes of the root frame, ``limits`` are radians."""

    name: str
    kind: str
    parent: str
    child: str
    axis: FloatArray  # (3,) unit
    limits: tuple[float, float] | None

    @property
    def turns(self) -> bool:
        """Whether it has one axis to turn about."""
        return self.kind in _ROTATING


@dataclass(frozen=True)
class Robot:
    """A tree of links."""

    name: str
    links: dict[str, Link]  # the root first, every link after its parent
    joints: dict[str, Joint]


def read_urdf(path: Path) -> Robot:
    """The robot in a URDF file; raises `ScenarioError` with one line that names file, element and fault."""
    try:
        root = ET.fromstring(path.read_text(encoding="utf-8"))  # noqa: S314 - expat limits entity expansion itself
    except (ET.ParseError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not valid XML: {error}") from error
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from error
    if root.tag != "robot":
        raise ScenarioError(f"{path}: the outermost element is <{root.tag}>; a URDF has <robot>")
    if any("xacro" in element.tag for element in root.iter()):
        raise ScenarioError(f"{path}: holds xacro macros; expand it first: xacro {path.name} > rover.urdf")
    return _Reader(path, root).robot()


class _Reader:
    """Walks the tree of one file."""

    def __init__(self, path: Path, root: ET.Element) -> None:
        self._path, self._root = path, root
        self._links = {link.get("name", ""): link for link in root.findall("link")}
        self._joints = root.findall("joint")

    def robot(self) -> Robot:
        self._check_names()
        children = {self._end(joint, "child") for joint in self._joints}
        roots = [name for name in self._links if name not in children]
        if len(roots) != 1:
            raise self._error(f"{len(roots)} root links ({', '.join(roots) or 'none'}); a rover is one tree")
        links: dict[str, Link] = {}
        joints: dict[str, Joint] = {}
        for name, joint, place in self._walk(roots[0], None, np.eye(4)):
            if name in links:
                raise self._error(f"link {name!r} hangs on two joints")
            links[name] = self._link(name, joint, place)
            if joint is not None:
                found = self._joint(joint, place)
                joints[found.name] = found
        lost = [name for name in self._links if name not in links]
        if lost:
            raise self._error(f"links {', '.join(lost)} hang on each other; a rover is one tree")
        return Robot(self._root.get("name", self._path.stem), links, joints)

    def _check_names(self) -> None:
        if len(self._links) > _MOST_LINKS:
            raise self._error(f"{len(self._links)} links; at most {_MOST_LINKS}")
        joints = {joint.get("name", "") for joint in self._joints}
        if len(self._links) != len(self._root.findall("link")) or len(joints) != len(self._joints):
            raise self._error("two links or two joints of one name")

    def _walk(
        self, name: str, joint: ET.Element | None, place: FloatArray
    ) -> Iterator[tuple[str, ET.Element | None, FloatArray]]:
        """Links with the joint that they hang on and their place (4, 4), parents first."""
        yield name, joint, place
        for below in self._joints:
            if self._end(below, "parent") == name:
                yield from self._walk(self._end(below, "child"), below, place @ self._origin(below))

    def _end(self, joint: ET.Element, side: str) -> str:
        element = joint.find(side)
        name = "" if element is None else element.get("link", "")
        if name not in self._links:
            raise self._error(f"joint {joint.get('name')!r}: its {side} link {name!r} does not exist")
        return name

    def _joint(self, element: ET.Element, place: FloatArray) -> Joint:
        name, axis = element.get("name", ""), element.find("axis")
        direction = place[:3, :3] @ self._numbers(axis, "xyz", (1.0, 0.0, 0.0), name)
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            raise self._error(f"joint {name!r}: axis of no length")
        limit, limits = element.find("limit"), None
        if limit is not None and element.get("type") == "revolute":
            limits = tuple(float(self._numbers(limit, key, (0.0,), name)[0]) for key in ("lower", "upper"))
            if limits[0] >= limits[1]:
                raise self._error(f"joint {name!r}: limits {limits[0]:g} to {limits[1]:g}: lower must be below upper")
        return Joint(
            name,
            element.get("type", ""),
            self._end(element, "parent"),
            self._end(element, "child"),
            np.asarray(direction / length),
            None if limits is None else (limits[0], limits[1]),
        )

    def _link(self, name: str, joint: ET.Element | None, place: FloatArray) -> Link:
        element = self._links[name]
        shapes = tuple(self._shape(collision, place, name) for collision in element.findall("collision"))
        hangs_on = None if joint is None else joint.get("name", "")
        inertial = element.find("inertial")
        if inertial is None:
            return Link(name, place, 0.0, place[:3, 3], np.zeros((3, 3)), shapes, hangs_on)
        own = place @ self._origin(inertial)
        mass = float(self._numbers(inertial.find("mass"), "value", (0.0,), name)[0])
        if mass < 0.0:
            raise self._error(f"link {name!r}: mass {mass:g}: must not be negative")
        keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        table = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (float(self._numbers(table, key, (0.0,), name)[0]) for key in keys)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Link(name, place, mass, own[:3, 3], own[:3, :3] @ tensor @ own[:3, :3].T, shapes, hangs_on)

    def _shape(self, collision: ET.Element, place: FloatArray, name: str) -> Shape:
        own = place @ self._origin(collision)
        geometry = collision.find("geometry")
        shape = None if geometry is None or not len(geometry) else geometry[0]
        if shape is None:
            raise self._error(f"link {name!r}: a collision without geometry")
        match shape.tag:
            case "box":
                return Shape("box", tuple(self._numbers(shape, "size", (0.0,) * 3, name)), own)
            case "cylinder":
                size = [float(self._numbers(shape, key, (0.0,), name)[0]) for key in ("radius", "length")]
                return Shape("cylinder", tuple(size), own)
            case "sphere":
                return Shape("sphere", tuple(self._numbers(shape, "radius", (0.0,), name)), own)
            case "mesh":
                scale = tuple(self._numbers(shape, "scale", (1.0,) * 3, name))
                return Shape("mesh", scale, own, shape.get("filename", ""))
        raise self._error(f"link {name!r}: collision shape <{shape.tag}>; allowed are box, cylinder, sphere, mesh")

    def _origin(self, element: ET.Element) -> FloatArray:
        """Place (4, 4) of an element with an <origin>; rpy turns about the fixed axes x, y, z."""
        origin, matrix = element.find("origin"), np.eye(4)
        matrix[:3, 3] = self._numbers(origin, "xyz", (0.0,) * 3, element.tag)
        roll, pitch, yaw = self._numbers(origin, "rpy", (0.0,) * 3, element.tag)
        matrix[:3, :3] = rotation_from_quaternion(quaternion_from_euler(roll, pitch, yaw))
        return matrix

    def _numbers(self, element: ET.Element | None, key: str, usual: tuple[float, ...], owner: str) -> FloatArray:
        """The numbers of an attribute, ``usual`` where it is left out."""
        text = None if element is None else element.get(key)
        if element is None or text is None:
            return np.array(usual)
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != len(usual) or not all(isfinite(value) for value in values):
            raise self._error(f"{owner!r}: <{element.tag} {key}={text!r}>: expected {len(usual)} finite number(s)")
        return np.array(values)

    def _error(self, text: str) -> ScenarioError:
        return ScenarioError(f"{self._path}: {text}")
