"""A user's own URDF, with a small TOML beside it, as a `RoverModel`."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees
from pathlib import Path

import numpy as np
import trimesh

from rover_sim.sim.rover import (
    CHASSIS,
    Arm,
    ArmBox,
    BatteryTable,
    Box,
    Chassis,
    Drive,
    Mast,
    Motor,
    RoverModel,
    Suspension,
    Table,
    Wheel,
)
from rover_sim.sim.urdf_reader import MOVABLE, Joint, Link, Robot, Shape, read_urdf
from worlds.errors import ScenarioError
from worlds.strict_toml import convert_table, read_table
from worlds.types import FloatArray, Vector3

_AXIS_TOLERANCE = 0.02  # rad between an axle and y
_SAME_WHEEL = 0.01  # share by which radius, width and mass of wheels may differ
_FREE_DEG = 120.0  # limits of a passive joint that has none


class UrdfWheels(Table, frozen=True, kw_only=True):
    """Which joints are wheels, and what a URDF does not say of them."""

    left: tuple[str, ...]  # joints, front to rear
    right: tuple[str, ...]
    stiffness_N_m: float
    grouser_m: float = 0.0
    radius_m: float | None = None  # None: of the collision cylinder
    width_m: float | None = None


class UrdfSuspension(Table, frozen=True, kw_only=True):
    """Which joints swing freely, and which are held where they are."""

    passive: tuple[str, ...] = ()
    differential: tuple[str, str] | None = None
    locked: tuple[str, ...] = ()  # steering, masts, manipulators


class UrdfHull(Table, frozen=True, kw_only=True):
    """What replaces the collision shapes of the chassis."""

    clearance_m: float | None = None  # None: down to the lowest box
    box: tuple[Box, ...] = ()


class RoverNotes(Table, frozen=True, kw_only=True):
    """The TOML beside a URDF."""

    wheel: UrdfWheels
    suspension: UrdfSuspension = UrdfSuspension()
    chassis: UrdfHull = UrdfHull()
    motor: Motor
    mast: Mast
    drive: Drive
    battery: BatteryTable = BatteryTable()


@dataclass(frozen=True, eq=False)
class _Part:
    """Links that move as one: the chassis, an arm or a wheel; places and inertia in body axes."""

    links: tuple[Link, ...]
    mass_kg: float
    centre: Vector3
    inertia: Vector3
    shapes: tuple[Shape, ...]


def import_urdf(path: Path) -> RoverModel:
    """The rover in a URDF file with its TOML beside it; raises `ScenarioError` with one line."""
    beside = path.with_suffix(".toml")
    if not beside.is_file():
        raise ScenarioError(f"{path}: needs {beside.name} beside it, which names its wheels, motors and mast")
    notes = convert_table(read_table(beside), RoverNotes, str(beside))
    return _Importer(path, beside, notes, read_urdf(path)).model()


class _Importer:
    """One import; keeps what every step needs."""

    def __init__(self, path: Path, beside: Path, notes: RoverNotes, robot: Robot) -> None:
        self._path, self._beside, self._notes, self._robot = path, beside, notes, robot
        self._wheels = notes.wheel.left + notes.wheel.right
        self._passive = notes.suspension.passive
        self._check_names()
        hubs = np.array([self._place(robot.joints[name])[:3, 3] for name in self._wheels])
        low, high = hubs.min(axis=0), hubs.max(axis=0)
        self._origin = np.array([*(low + high)[:2] / 2.0, hubs[:, 2].mean()])
        self._hubs = hubs - self._origin

    def model(self) -> RoverModel:
        notes = self._notes
        arms = [self._arm(joint) for joint in self._robot.joints.values() if joint.name in self._passive]
        wheel_arms = tuple(self._carrier(self._robot.joints[name].parent) for name in self._wheels)
        differential = notes.suspension.differential
        wheel = self._wheel()
        return RoverModel(
            name=self._robot.name,
            chassis=self._chassis(wheel.radius_m),
            wheel=wheel,
            suspension=Suspension(
                wheel_arms=wheel_arms if arms else (),
                differential=None if differential is None else self._arm_names(differential),
                arm=tuple(arms),
            ),
            motor=notes.motor,
            mast=notes.mast,
            drive=notes.drive,
            battery=notes.battery,
        )

    def _check_names(self) -> None:
        """Every joint that is named exists and turns about y."""
        suspension, joints = self._notes.suspension, self._robot.joints
        if len(self._notes.wheel.left) != len(self._notes.wheel.right) or not self._wheels:
            raise self._error("wheel.left and wheel.right must name as many joints each, and at least two")
        roles = {"wheel": self._wheels, "suspension.passive": self._passive, "suspension.locked": suspension.locked}
        for role, names in roles.items():
            for name in names:
                if name not in joints:
                    raise self._error(f"{role}: no joint {name!r} in {self._path.name}; it has {', '.join(joints)}")
                if role != "suspension.locked":
                    self._check_axis(role, joints[name])
        for name in suspension.differential or ():
            if name not in self._passive:
                raise self._error(f"suspension.differential: {name!r} is not among suspension.passive")
        self._check_all_named([name for names in roles.values() for name in names])

    def _check_all_named(self, named: list[str]) -> None:
        """Every joint that moves is named once."""
        if len(set(named)) != len(named):
            raise self._error("a joint is named twice in wheel.left, wheel.right, suspension.passive or .locked")
        for joint in self._robot.joints.values():
            if joint.kind in MOVABLE and joint.name not in named:
                raise self._error(
                    f"joint {joint.name!r} of {self._path.name} is {joint.kind} and named nowhere: add it to "
                    "wheel.left, wheel.right, suspension.passive or suspension.locked"
                )

    def _check_axis(self, role: str, joint: Joint) -> None:
        if not joint.turns or abs(joint.axis[1]) < np.cos(_AXIS_TOLERANCE):
            axis = ", ".join(f"{value:.3g}" for value in joint.axis)
            raise self._error(
                f"{role}: joint {joint.name!r} is {joint.kind} about ({axis}); it must turn about y (left), "
                "with x forward"
            )

    def _chassis(self, radius_m: float) -> Chassis:
        part, hull = self._part(None), self._notes.chassis
        boxes = hull.box or tuple(self._box(shape) for shape in part.shapes)
        if not boxes:
            raise self._error("chassis.box: needed, as the chassis of the URDF has no collision shape")
        lowest = min(box.centre_m[2] - 0.5 * box.size_m[2] for box in boxes)
        return Chassis(
            mass_kg=part.mass_kg,
            inertia_kg_m2=part.inertia,
            centre_of_mass_m=part.centre,
            clearance_m=radius_m + lowest if hull.clearance_m is None else hull.clearance_m,
            box=boxes,
        )

    def _arm(self, joint: Joint) -> Arm:
        part = self._part(joint.name)
        low, high = joint.limits or (-np.radians(_FREE_DEG), np.radians(_FREE_DEG))
        if joint.axis[1] < 0.0:
            low, high = -high, -low
        return Arm(
            name=joint.child,
            parent=self._carrier(joint.parent),
            pivot_m=_vector(self._place(joint)[:3, 3] - self._origin),
            mass_kg=part.mass_kg,
            inertia_kg_m2=part.inertia,
            centre_of_mass_m=part.centre,
            limits_deg=(round(degrees(low), 9), round(degrees(high), 9)),
            box=tuple(self._arm_box(shape) for shape in part.shapes),
        )

    def _wheel(self) -> Wheel:
        notes, parts = self._notes.wheel, [self._part(name) for name in self._wheels]
        sizes = np.array([self._wheel_size(name, part) for name, part in zip(self._wheels, parts, strict=True)])
        if np.ptp(sizes, axis=0).max() > _SAME_WHEEL * sizes.max():
            different = self._wheels[int(np.argmax(np.abs(sizes - sizes[0]).max(axis=1)))]
            raise self._error(f"wheel: {different!r} differs from {self._wheels[0]!r} in radius, width or mass")
        radius, width, mass = sizes[0].tolist()
        return Wheel(
            positions_m=tuple(_vector(hub) for hub in self._hubs),
            radius_m=radius,
            width_m=width,
            mass_kg=mass,
            grouser_m=notes.grouser_m,
            stiffness_N_m=notes.stiffness_N_m,
        )

    def _wheel_size(self, name: str, part: _Part) -> tuple[float, float, float]:
        """Radius, width and mass of one wheel."""
        notes = self._notes.wheel
        round_ones = [shape for shape in part.shapes if shape.kind == "cylinder"]
        if not round_ones and (notes.radius_m is None or notes.width_m is None):
            raise self._error(
                f"wheel.radius_m and wheel.width_m: needed, as {name!r} of {self._path.name} has no collision cylinder"
            )
        radius, width = round_ones[0].size if round_ones else (0.0, 0.0)
        return notes.radius_m or radius, notes.width_m or width, part.mass_kg

    def _part(self, joint: str | None) -> _Part:
        """What hangs rigidly on a joint; None for the chassis."""
        links = tuple(link for link in self._robot.links.values() if self._moves_with(link.name) == joint)
        mass = sum(link.mass_kg for link in links)
        if mass <= 0.0:
            raise ScenarioError(f"{self._path}: link {links[0].name!r}: mass {mass:g}: must be more than zero")
        centre = sum((link.mass_kg * link.centre for link in links), np.zeros(3)) / mass
        inertia = sum((link.inertia + _shifted(link, centre) for link in links), np.zeros((3, 3)))
        shapes = tuple(shape for link in links for shape in link.shapes)
        return _Part(links, mass, _vector(centre - self._origin), _vector(np.diag(inertia)), shapes)

    def _moves_with(self, link: str) -> str | None:
        """The wheel or passive joint that a link hangs on, however far up; None for the chassis."""
        joint = self._robot.links[link].joint
        while joint is not None and joint not in self._wheels and joint not in self._passive:
            joint = self._robot.links[self._robot.joints[joint].parent].joint
        return joint

    def _carrier(self, link: str) -> str:
        """Name of the arm that a link belongs to."""
        joint = self._moves_with(link)
        if joint in self._wheels:
            raise self._error(f"joint on link {link!r}: hangs on a wheel")
        return CHASSIS if joint is None else self._robot.joints[joint].child

    def _arm_names(self, pair: tuple[str, str]) -> tuple[str, str]:
        return self._robot.joints[pair[0]].child, self._robot.joints[pair[1]].child

    def _place(self, joint: Joint) -> FloatArray:
        return self._robot.links[joint.child].place

    def _box(self, shape: Shape) -> Box:
        """The level box round a collision shape, in body axes."""
        low, high = self._bounds(shape)
        rotation = shape.place[:3, :3]
        centre = shape.place[:3, 3] + rotation @ ((low + high) / 2.0) - self._origin
        return Box(size_m=_vector(np.abs(rotation) @ (high - low)), centre_m=_vector(centre))

    def _arm_box(self, shape: Shape) -> ArmBox:
        """The box round a collision shape, turned with it where it is turned about y only."""
        level, (low, high), rotation = self._box(shape), self._bounds(shape), shape.place[:3, :3]
        pitch = degrees(np.arctan2(rotation[0, 2], rotation[0, 0]))
        if rotation[1, 1] < np.cos(_AXIS_TOLERANCE) or abs(pitch) > 90.0:
            return ArmBox(size_m=level.size_m, centre_m=level.centre_m)
        return ArmBox(size_m=_vector(high - low), centre_m=level.centre_m, pitch_deg=round(pitch, 9))

    def _bounds(self, shape: Shape) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,) of a shape in its own axes."""
        match shape.kind:
            case "box":
                half = np.array(shape.size) / 2.0
            case "cylinder":
                half = np.array([shape.size[0], shape.size[0], shape.size[1] / 2.0])
            case "sphere":
                half = np.full(3, shape.size[0])
            case _:
                return self._mesh_bounds(shape)
        return -half, half

    def _mesh_bounds(self, shape: Shape) -> tuple[FloatArray, FloatArray]:
        path = _mesh_path(self._path, shape.mesh)
        try:
            bounds = np.asarray(trimesh.load(path, force="mesh").bounds) * shape.size
        except (OSError, ValueError, TypeError, KeyError, NotImplementedError, ImportError) as error:
            raise ScenarioError(
                f"{self._path}: collision mesh {shape.mesh!r} cannot be read ({error}); use simple shapes, or give "
                f"[[chassis.box]] in {self._beside.name}"
            ) from error
        return bounds.min(axis=0), bounds.max(axis=0)

    def _error(self, text: str) -> ScenarioError:
        return ScenarioError(f"{self._beside}: {text}")


def _mesh_path(urdf: Path, name: str) -> Path:
    """A mesh beside its URDF; ``package://NAME/...`` is looked up in the folder NAME above the URDF."""
    if not name.startswith("package://"):
        return urdf.parent / name.removeprefix("file://")
    package, _, rest = name.removeprefix("package://").partition("/")
    above = next((folder for folder in urdf.resolve().parents if folder.name == package), urdf.parent)
    return above / rest


def _shifted(link: Link, centre: FloatArray) -> FloatArray:
    """What the distance of a link's centre of mass from ``centre`` adds to the inertia (Steiner)."""
    x, y, z = link.centre - centre
    return link.mass_kg * np.array(
        [[y * y + z * z, -x * y, -x * z], [-x * y, x * x + z * z, -y * z], [-x * z, -y * z, x * x + y * y]]
    )


def _vector(values: FloatArray) -> Vector3:
    x, y, z = (round(float(value), 9) + 0.0 for value in values)
    return x, y, z
