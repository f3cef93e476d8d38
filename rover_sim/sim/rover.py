"""Rovers as strict TOML files: what they weigh, where their wheels sit, what their motors can do."""

from __future__ import annotations

from math import radians, tan
from pathlib import Path

import msgspec

from rover_sim.sim.wong_reece import WheelShape
from worlds.errors import ScenarioError
from worlds.scenario import Camera
from worlds.strict_toml import Limits, check_limits, convert_table, read_table
from worlds.types import CameraModel, Footprint, Vector3

_FOLDER = Path(__file__).parent / "rovers"
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
    "mast.forward_m": _OFFSET,
    "drive.max_yaw_rate_rad_s": (0.01, 20.0),
    "drive.effective_track_ratio": (1.0, 10.0),
}


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a rover file: a mistyped key is an error."""


class Box(_Table, frozen=True, kw_only=True):
    """One box of the hull, in body axes."""

    size_m: Vector3
    centre_m: Vector3


class Chassis(_Table, frozen=True, kw_only=True):
    """The rover without its wheels."""

    mass_kg: float
    inertia_kg_m2: Vector3  # Ixx, Iyy, Izz about the centre of mass
    centre_of_mass_m: Vector3
    clearance_m: float  # belly above level ground
    box: tuple[Box, ...]


class Wheel(_Table, frozen=True, kw_only=True):
    """Equal wheels on axles along y; left front, left rear, right front, right rear."""

    positions_m: tuple[Vector3, Vector3, Vector3, Vector3]
    radius_m: float
    width_m: float
    mass_kg: float
    grouser_m: float = 0.0
    stiffness_N_m: float  # of tyre and ground in series, beside the plastic sinkage


class Motor(_Table, frozen=True, kw_only=True):
    """One geared motor a wheel."""

    max_torque_Nm: float
    max_speed_rad_s: float
    max_acceleration_rad_s2: float
    rotor_inertia_kg_m2: float = 0.0  # as the wheel feels it, through the gear
    idle_power_W: float = 0.0  # electronics, whole rover


class Mast(_Table, frozen=True, kw_only=True):
    """Where the camera stands."""

    forward_m: float


class Drive(_Table, frozen=True, kw_only=True):
    """What the planner is told beside the geometry."""

    max_yaw_rate_rad_s: float
    effective_track_ratio: float


class RoverModel(_Table, frozen=True, kw_only=True):
    """One rover; body origin in the middle of the axles at their height, x forward, y left, z up."""

    name: str
    chassis: Chassis
    wheel: Wheel
    motor: Motor
    mast: Mast
    drive: Drive

    @property
    def mass_kg(self) -> float:
        """Chassis and wheels."""
        return self.chassis.mass_kg + len(self.wheel.positions_m) * self.wheel.mass_kg

    @property
    def centre_of_mass_b(self) -> Vector3:
        """Centre of mass of chassis and wheels."""
        chassis, wheel = self.chassis, self.wheel
        x, y, z = (
            (chassis.mass_kg * own + wheel.mass_kg * sum(column)) / self.mass_kg
            for own, column in zip(chassis.centre_of_mass_m, zip(*wheel.positions_m, strict=True), strict=True)
        )
        return x, y, z

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
        )

    def camera(self, camera: Camera) -> CameraModel:
        """The scenario's camera on this rover, its lens ``height_m`` above level ground."""
        focal = 0.5 * camera.width / tan(radians(camera.fov_deg) / 2.0)
        position = (self.mast.forward_m, 0.0, camera.height_m - self.wheel.radius_m)
        return CameraModel(camera.width, camera.height, focal, position, radians(camera.pitch_deg))

    def _span(self, axis: int) -> float:
        values = [position[axis] for position in self.wheel.positions_m]
        return max(values) - min(values)

    def _extent(self, axis: int, wheel_size: float) -> float:
        boxes = [2.0 * abs(box.centre_m[axis]) + box.size_m[axis] for box in self.chassis.box]
        return max(self._span(axis) + wheel_size, *boxes)


def rover_names() -> list[str]:
    """Names of the rovers that ship."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def load_rover(name_or_path: str | Path) -> RoverModel:
    """A shipped rover by name, or one's own by the path of its TOML file.

    Raises `ScenarioError` for an unknown name, an unknown key or a value that no rover can have.
    """
    path = _FOLDER / f"{name_or_path}.toml"
    if not path.is_file():
        path = Path(name_or_path)
    if not path.is_file():
        known = ", ".join(rover_names())
        raise ScenarioError(f"rover.model = {str(name_or_path)!r}: no such rover; allowed: {known}, or a TOML file")
    model = convert_table(read_table(path), RoverModel, str(path))
    check_limits(model, _LIMITS, str(path))
    _check_geometry(model, str(path))
    return model


def _check_geometry(model: RoverModel, source: str) -> None:
    """Raise `ScenarioError` for parts that do not fit together."""
    wheel, chassis = model.wheel, model.chassis
    if not chassis.box:
        raise ScenarioError(f"{source}: chassis.box: at least one box is needed")
    if model.wheelbase_m < 2.0 * wheel.radius_m or model.track_m < 2.0 * wheel.width_m:
        raise ScenarioError(
            f"{source}: wheel.radius_m = {wheel.radius_m:g}, wheel.width_m = {wheel.width_m:g}: wheels overlap; "
            f"the wheelbase is {model.wheelbase_m:g} m and the track {model.track_m:g} m"
        )
    if wheel.grouser_m > 0.5 * wheel.radius_m:
        raise ScenarioError(f"{source}: wheel.grouser_m = {wheel.grouser_m:g}: at most half of the wheel radius")
    for place, (position, side, row) in enumerate(zip(wheel.positions_m, (1, 1, -1, -1), (1, -1, 1, -1), strict=True)):
        if position[1] * side <= 0.0 or position[0] * row <= 0.0:
            raise ScenarioError(
                f"{source}: wheel.positions_m[{place}] = {list(position)}: "
                "the order is left front, left rear, right front, right rear (x forward, y left)"
            )
    a, b, c = sorted(chassis.inertia_kg_m2)
    if a + b < c:
        raise ScenarioError(
            f"{source}: chassis.inertia_kg_m2 = {list(chassis.inertia_kg_m2)}: no body has one moment "
            "larger than the sum of the other two"
        )
