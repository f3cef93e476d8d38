"""Rovers as strict TOML files: what they weigh, where their wheels sit, what their motors can do."""

from __future__ import annotations

from math import radians, tan
from pathlib import Path

import msgspec

from rover_sim.sim.rover_checks import check_rover
from worlds.errors import ScenarioError
from worlds.scenario import Camera
from worlds.strict_toml import Limits, check_limits, convert_table, read_table
from worlds.types import CameraModel, Footprint, LaserModel, RigidBody, Vector3
from worlds.wong_reece import WheelShape

_FOLDER = Path(__file__).parent / "rovers"
CHASSIS = "chassis"  # what wheels and arms sit on if on no arm
# Of the wheel radius. In this simulator rocks of 0.7 pass under Husky, of 1.2 under the rocker-bogie; vertical steps
# of 0.6 and 0.9.
_RIGID_CLIMB = 0.6
_ARTICULATED_CLIMB = 1.2
_BELLY_SPARE_M = 0.026  # of the clearance: sinking in and pitching take as much
_SCANNER_ABOVE_M = 0.05
_LENGTH = (0.001, 20.0)
_OFFSET = (-20.0, 20.0)
_LIMITS: Limits = {
    "chassis.mass_kg": (0.1, 1e5),
    "chassis.inertia_kg_m2": (1e-4, 1e6),
    "chassis.centre_of_mass_m": _OFFSET,
    "chassis.clearance_m": (0.0, 5.0),
    "chassis.box.size_m": _LENGTH,
    "chassis.box.centre_m": _OFFSET,
    "wheel.positions_m": _OFFSET,
    "wheel.radius_m": (0.01, 5.0),
    "wheel.width_m": (0.005, 5.0),
    "wheel.mass_kg": (0.01, 1e4),
    "wheel.grouser_m": (0.0, 0.5),
    "wheel.stiffness_N_m": (100.0, 1e6),
    "motor.max_torque_Nm": (0.01, 1e5),
    "motor.max_speed_rad_s": (0.01, 100.0),
    "motor.max_acceleration_rad_s2": (0.01, 1e4),
    "motor.rotor_inertia_kg_m2": (0.0, 1e3),
    "motor.idle_power_W": (0.0, 1e5),
    "suspension.arm.pivot_m": _OFFSET,
    "suspension.arm.mass_kg": (0.01, 1e5),
    "suspension.arm.inertia_kg_m2": (1e-6, 1e6),
    "suspension.arm.centre_of_mass_m": _OFFSET,
    "suspension.arm.limits_deg": (-120.0, 120.0),
    "suspension.arm.box.size_m": _LENGTH,
    "suspension.arm.box.centre_m": _OFFSET,
    "suspension.arm.box.pitch_deg": (-90.0, 90.0),
    "mast.forward_m": _OFFSET,
    "mast.height_m": (0.1, 10.0),
    "scanner.forward_m": _OFFSET,
    "scanner.height_m": (0.02, 10.0),
    "battery.capacity_Ah": (0.01, 1e4),
    "battery.resistance_ohm": (1e-4, 10.0),
    "battery.efficiency": (0.05, 1.0),
    "drive.max_yaw_rate_rad_s": (0.01, 20.0),
    "drive.effective_track_ratio": (1.0, 10.0),
}


class Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a rover file: a mistyped key is an error."""


class Box(Table, frozen=True, kw_only=True):
    """One box of the hull, in body axes."""

    size_m: Vector3
    centre_m: Vector3


class ArmBox(Box, frozen=True, kw_only=True):
    """One box of an arm, in body axes with every arm level."""

    pitch_deg: float = 0.0  # turned about y, nose down positive


class Body(Table, frozen=True, kw_only=True):
    """A rigid part with mass, in body axes with every arm level."""

    mass_kg: float
    inertia_kg_m2: Vector3  # Ixx, Iyy, Izz about the centre of mass
    centre_of_mass_m: Vector3


class Chassis(Body, frozen=True, kw_only=True):
    """The rover without arms and wheels."""

    clearance_m: float  # belly above level ground
    box: tuple[Box, ...]


class Wheel(Table, frozen=True, kw_only=True):
    """Equal wheels on axles along y; the left ones from front to rear, then the right ones."""

    positions_m: tuple[Vector3, ...]  # with every arm level
    radius_m: float
    width_m: float
    mass_kg: float
    grouser_m: float = 0.0
    stiffness_N_m: float  # of tyre and ground in series, beside the plastic sinkage


class Arm(Body, frozen=True, kw_only=True):
    """A passive arm that swings about y between rover and wheels: a rocker or a bogie."""

    name: str
    parent: str = CHASSIS  # or the name of an arm further up in the list
    pivot_m: Vector3  # on its parent
    limits_deg: tuple[float, float]  # of its angle to its parent, nose down positive
    box: tuple[ArmBox, ...] = ()  # what rocks may touch


class Suspension(Table, frozen=True, kw_only=True):
    """Passive arms; empty for wheels that sit on the chassis."""

    wheel_arms: tuple[str, ...] = ()  # what each wheel sits on
    differential: tuple[str, str] | None = None  # arms whose angles sum to zero: the chassis keeps their mean pitch
    arm: tuple[Arm, ...] = ()

    def arm_numbers(self) -> dict[str, int]:
        """Place in the list of every arm, -1 for the chassis."""
        return {CHASSIS: -1, **{arm.name: number for number, arm in enumerate(self.arm)}}


class Motor(Table, frozen=True, kw_only=True):
    """One geared motor a wheel."""

    max_torque_Nm: float
    max_speed_rad_s: float
    max_acceleration_rad_s2: float
    rotor_inertia_kg_m2: float = 0.0  # as the wheel feels it, through the gear
    idle_power_W: float = 0.0  # electronics, whole rover


class BatteryTable(Table, frozen=True, kw_only=True):
    """Six lithium-ion cells in a row."""

    capacity_Ah: float = 20.0
    resistance_ohm: float = 0.05  # of the pack with its wires
    efficiency: float = 0.7  # from the battery to the axle


class Mast(Table, frozen=True, kw_only=True):
    """Where the camera stands."""

    forward_m: float
    height_m: float  # of the lens above level ground, where the scenario gives none


class Scanner(Table, frozen=True, kw_only=True):
    """Where a 2-D laser scanner sits, if the scenario has one."""

    forward_m: float
    height_m: float  # of its plane above level ground


class Drive(Table, frozen=True, kw_only=True):
    """What the planner is told beside the geometry."""

    max_yaw_rate_rad_s: float
    effective_track_ratio: float


class RoverModel(Table, frozen=True, kw_only=True):
    """One rover; body origin in the middle of the axles at their height, x forward, y left, z up."""

    name: str
    chassis: Chassis
    wheel: Wheel
    suspension: Suspension = Suspension()
    motor: Motor
    mast: Mast
    drive: Drive
    battery: BatteryTable = BatteryTable()
    scanner: Scanner | None = None  # None: on top of the hull's foremost box, at its front edge

    @property
    def mass_kg(self) -> float:
        """Chassis, arms and wheels."""
        return sum(mass for mass, _ in self._parts())

    @property
    def centre_of_mass_b(self) -> Vector3:
        """Centre of mass of chassis, arms and wheels, with every arm level."""
        x, y, z = (sum(mass * place[axis] for mass, place in self._parts()) / self.mass_kg for axis in range(3))
        return x, y, z

    @property
    def climb_height_m(self) -> float:
        """Height of rocks that may be driven over: what the wheels climb and the belly clears, with room to spare."""
        share = _ARTICULATED_CLIMB if self.suspension.arm else _RIGID_CLIMB
        return min(share * self.wheel.radius_m, self.chassis.clearance_m - _BELLY_SPARE_M)

    @property
    def track_m(self) -> float:
        """Distance between the middles of left and right wheels."""
        return self._span(1)

    @property
    def wheelbase_m(self) -> float:
        """Distance between the first and the last axle."""
        return self._span(0)

    def wheel_shape(self) -> WheelShape:
        """What the soil feels of a wheel."""
        return WheelShape(self.wheel.radius_m, self.wheel.width_m, self.wheel.grouser_m)

    def footprint(self) -> Footprint:
        """What the planner must know; the wheel radius is the one at which the soil is sheared."""
        radius = self.wheel_shape().shear_radius_m
        return Footprint(
            length_m=self._extent(0, 2.0 * self.wheel.radius_m),
            width_m=self._extent(1, self.wheel.width_m),
            wheel_radius_m=radius,
            track_m=self.track_m,
            wheelbase_m=self.wheelbase_m,
            clearance_m=self.chassis.clearance_m,
            max_speed_m_s=radius * self.motor.max_speed_rad_s,
            max_yaw_rate_rad_s=self.drive.max_yaw_rate_rad_s,
            effective_track_ratio=self.drive.effective_track_ratio,
            wheels=len(self.wheel.positions_m),
            climb_height_m=self.climb_height_m,
            body=self.rigid_body(),
        )

    def rigid_body(self) -> RigidBody | None:
        """Hull and wheels as one rigid body; None unless they are four at the corners of a rectangle, without arms."""
        corners = {(x, y, 0.0) for x in self._ends(0) for y in self._ends(1)}
        if self.suspension.arm or len(self.wheel.positions_m) != 4 or set(self.wheel.positions_m) != corners:
            return None
        if any(sum(self._ends(axis)) != 0.0 for axis in (0, 1)):
            return None
        undersides = tuple(
            (x - length / 2, x + length / 2, y - width / 2, y + width / 2, z - height / 2)
            for (length, width, height), (x, y, z) in ((box.size_m, box.centre_m) for box in self.chassis.box)
        )
        wheel, sizes = self.wheel, (self.wheelbase_m, self.track_m)
        return RigidBody(*sizes, wheel.radius_m, wheel.width_m, self.centre_of_mass_b, undersides)

    def camera(self, camera: Camera) -> CameraModel:
        """The scenario's camera on this rover, on its mast unless the scenario has a height of its own."""
        height = self.mast.height_m if camera.height_m is None else camera.height_m
        focal = 0.5 * camera.width / tan(radians(camera.fov_deg) / 2.0)
        position = (self.mast.forward_m, 0.0, height - self.wheel.radius_m)
        return CameraModel(camera.width, camera.height, focal, position, radians(camera.pitch_deg))

    def laser(self) -> LaserModel:
        """The 2-D scanner on this rover."""
        if self.scanner is not None:
            return LaserModel((self.scanner.forward_m, 0.0, self.scanner.height_m - self.wheel.radius_m))
        front = max(self.chassis.box, key=lambda box: box.centre_m[0] + box.size_m[0] / 2)
        return LaserModel(
            (front.centre_m[0] + front.size_m[0] / 2, 0.0, front.centre_m[2] + front.size_m[2] / 2 + _SCANNER_ABOVE_M)
        )

    def _parts(self) -> list[tuple[float, Vector3]]:
        """Mass and place of every part."""
        parts = [(self.chassis.mass_kg, self.chassis.centre_of_mass_m)]
        parts += [(arm.mass_kg, arm.centre_of_mass_m) for arm in self.suspension.arm]
        return parts + [(self.wheel.mass_kg, position) for position in self.wheel.positions_m]

    def _span(self, axis: int) -> float:
        low, high = self._ends(axis)
        return high - low

    def _ends(self, axis: int) -> tuple[float, float]:
        values = [position[axis] for position in self.wheel.positions_m]
        return min(values), max(values)

    def _extent(self, axis: int, wheel_size: float) -> float:
        boxes = [2.0 * abs(box.centre_m[axis]) + box.size_m[axis] for box in self.chassis.box]
        return max(self._span(axis) + wheel_size, *boxes)


def rover_names() -> list[str]:
    """Names of the rovers that ship."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def load_rover(name_or_path: str | Path) -> RoverModel:
    """A shipped rover by name, or one's own by the path of its TOML or URDF file.

    Raises `ScenarioError` for an unknown name, an unknown key or a value that no rover can have.
    """
    path = _FOLDER / f"{name_or_path}.toml"
    if not path.is_file():
        path = Path(name_or_path)
    if not path.is_file():
        known = ", ".join(rover_names())
        raise ScenarioError(
            f"rover.model = {str(name_or_path)!r}: no such rover; allowed: {known}, or a TOML or URDF file"
        )
    model = _read_rover(path)
    check_limits(model, _LIMITS, str(path))
    check_rover(model, str(path))
    return model


def _read_rover(path: Path) -> RoverModel:
    if path.suffix == ".urdf":
        from rover_sim.sim.rover_import import import_urdf

        return import_urdf(path)
    return convert_table(read_table(path), RoverModel, str(path))
