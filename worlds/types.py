"""The data that more than one room needs: ground, rocks, poses, cameras and what was perceived.

Frames: world ENU (x east, y north, z up), body FLU (x forward, y left, z up), camera OpenCV
(x right, y down, z forward). Quaternions are ``(x, y, z, w)``. SI units and radians throughout.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Literal, Protocol, overload

import msgspec
import numpy as np
from numpy.typing import NDArray

from worlds.scenario import DEFAULT_ORIGIN, Origin, Scenario
from worlds.soil import Soil

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
ByteArray = NDArray[np.uint8]
BoolArray = NDArray[np.bool_]
Vector3 = tuple[float, float, float]


class TerrainClass(StrEnum):
    """The six terrain classes of the 2004 paper, section 5, by their printed letter."""

    SAND = "S"
    VERY_SMALL_ROCKS = "V"
    ROUGH = "m"
    VERY_ROUGH = "M"
    BIG_ROCK = "B"
    UNCERTAIN = "U"


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights on a square grid; ``heights_m[iy, ix]`` lies at ``origin_m + resolution_m * (ix, iy)``."""

    heights_m: FloatArray  # (ny, nx)
    resolution_m: float
    origin_m: tuple[float, float]  # world x, y of heights_m[0, 0]

    @property
    def x_limits_m(self) -> tuple[float, float]:
        """World x of the first and the last column."""
        return self.origin_m[0], self.origin_m[0] + (self.heights_m.shape[1] - 1) * self.resolution_m

    @property
    def y_limits_m(self) -> tuple[float, float]:
        """World y of the first and the last row."""
        return self.origin_m[1], self.origin_m[1] + (self.heights_m.shape[0] - 1) * self.resolution_m


@dataclass(frozen=True)
class RockShape:
    """Formation of a rock: 0 is the hemisphere, 1..9 the lofted models of the paper's figure 3."""

    formation: int
    section_ratio: tuple[float, ...]  # nine diameters A0..A8 across the long axis, largest = 1


@dataclass(frozen=True)
class Rock:
    """One rock standing on the ground; ``position_w`` is the centre of its base at ground height."""

    id: int
    position_w: Vector3
    length_m: float  # extent along its principal axis
    width_m: float  # largest diameter across it
    height_m: float  # above the ground
    yaw_rad: float  # direction of the principal axis, from +x counter-clockwise
    shape: RockShape

    @property
    def diameter_m(self) -> float:
        """Diameter of the circle of equal base, the D of the size-frequency law."""
        return float(np.sqrt(self.length_m * self.width_m))


@dataclass(frozen=True, eq=False)
class RockTable(Sequence[Rock]):
    """Many rocks as columns; as a sequence it makes each `Rock` when it is asked for."""

    ids: IntArray  # (N,)
    position_w: FloatArray  # (N, 3)
    extents_m: FloatArray  # (N, 3) length, width, height
    yaw_rad: FloatArray  # (N,)
    formation: IntArray  # (N,)
    section_ratio: FloatArray  # (N, 9)

    @staticmethod
    def of(rocks: Iterable[Rock]) -> RockTable:
        """The columns of some rocks."""
        rows = list(rocks)
        return RockTable(
            np.array([rock.id for rock in rows], dtype=np.int32),
            np.array([rock.position_w for rock in rows], dtype=np.float64).reshape(-1, 3),
            np.array([(rock.length_m, rock.width_m, rock.height_m) for rock in rows], dtype=np.float64).reshape(-1, 3),
            np.array([rock.yaw_rad for rock in rows], dtype=np.float64),
            np.array([rock.shape.formation for rock in rows], dtype=np.int32),
            np.array([rock.shape.section_ratio for rock in rows], dtype=np.float64).reshape(-1, 9),
        )

    @property
    def diameters_m(self) -> FloatArray:
        """Diameter (N,) of the circle of equal base of each rock."""
        return np.asarray(np.sqrt(self.extents_m[:, 0] * self.extents_m[:, 1]))

    def chosen(self, which: IntArray | BoolArray) -> RockTable:
        """The rocks at some places, or where a mask holds."""
        return RockTable(**{field.name: getattr(self, field.name)[which] for field in fields(self)})

    def joined(self, other: RockTable) -> RockTable:
        """These rocks and then the others."""
        names = [field.name for field in fields(self)]
        return RockTable(**{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names})

    def __len__(self) -> int:
        return len(self.ids)

    @overload
    def __getitem__(self, index: int) -> Rock: ...
    @overload
    def __getitem__(self, index: slice) -> RockTable: ...
    def __getitem__(self, index: int | slice) -> Rock | RockTable:
        if isinstance(index, slice):
            return self.chosen(np.arange(len(self), dtype=np.int32)[index])
        x, y, z = self.position_w[index].tolist()
        length, width, height = self.extents_m[index].tolist()
        shape = RockShape(int(self.formation[index]), tuple(self.section_ratio[index].tolist()))
        return Rock(int(self.ids[index]), (x, y, z), length, width, height, float(self.yaw_rad[index]), shape)


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder; ``position_w`` is the centre of its foot."""

    id: int
    position_w: Vector3
    radius_m: float
    height_m: float


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh with outward faces; ``owner`` names the rock or cylinder id of each face."""

    vertices_m: FloatArray  # (V, 3)
    faces: IntArray  # (F, 3)
    owner: IntArray  # (F,)


class Shapes(Protocol):
    """Solid things as meshes, made for those that are asked for: a large world has too many to mesh at once.

    In every mesh the vertices and the faces of a thing lie together and are its own.
    """

    @property
    def ids(self) -> IntArray:
        """Id (N,) of each thing, ascending."""
        ...

    @property
    def bounds_w(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corners (N, 3) of the boxes around what stands above the ground, nearly."""
        ...

    def picture(self, which: IntArray) -> TriangleMesh:
        """The things at the places ``which`` (K,) as the camera sees them."""
        ...

    def collision(self, which: IntArray) -> TriangleMesh:
        """The same, coarser."""
        ...

    def face_counts(self) -> tuple[int, int]:
        """How many faces all pictures would have, and all collision meshes."""
        ...


@dataclass(frozen=True, eq=False)
class Pose:
    """Position and attitude in the world; the quaternion ``(x, y, z, w)`` turns body into world."""

    position_w: FloatArray  # (3,)
    quaternion_w: FloatArray  # (4,)


@dataclass(frozen=True)
class Lens:
    """How a real lens leaves the ideal pinhole; models and order of the coefficients are OpenCV's.

    ``brown``: k1 k2 p1 p2 k3, after Brown, Photogrammetric Engineering 32(3), 1966. ``fisheye``: k1 k2 k3 k4, the odd
    polynomial of the angle of Kannala and Brandt, IEEE Trans. PAMI 28(8), 2006.
    """

    model: Literal["brown", "fisheye"]
    coefficients: tuple[float, ...]
    centre_px: tuple[float, float]  # principal point, the centre of the first pixel at (0.5, 0.5)
    aspect: float = 1.0  # focal length down over that across


@dataclass(frozen=True)
class CameraModel:
    """A camera and where it sits on the rover (``pitch_rad`` is positive looking down)."""

    width_px: int
    height_px: int
    focal_px: float
    position_b: Vector3 = (0.0, 0.0, 0.0)
    pitch_rad: float = 0.0
    lens: Lens | None = None  # None: an ideal pinhole with its principal point in the middle

    @property
    def centre_px(self) -> tuple[float, float]:
        """Principal point (column, row); pixel centres lie at +0.5."""
        return self.lens.centre_px if self.lens else (self.width_px / 2.0, self.height_px / 2.0)


@dataclass(frozen=True, eq=False)
class GroundPlane:
    """The plane that the rover believes it stands on."""

    point_w: FloatArray  # (3,)
    normal_w: FloatArray  # (3,), unit, upwards


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture as the perception gets it, with the believed pose of the camera and of the ground."""

    time_s: float
    image: ByteArray  # (H, W) grey or (H, W, 3) RGB
    camera: CameraModel
    camera_pose: Pose | None = None  # turns camera axes into world; None for a picture from anywhere
    ground: GroundPlane | None = None
    right: ByteArray | None = None  # of a second, equal camera to the right of it, its axes parallel
    baseline_m: float = 0.0  # between the two
    to_sun_w: Vector3 | None = None  # unit vector to the sun, as almanac and attitude tell it; None: not known


@dataclass(frozen=True)
class LaserModel:
    """A scanner whose beams fan out in a plane level with the rover, symmetric about straight ahead."""

    position_b: Vector3
    field_rad: float = float(np.radians(270.0))
    step_rad: float = float(np.radians(0.25))
    reach_m: float = 10.0
    rate_hz: float = 10.0
    range_sd_m: float = 0.01

    @property
    def angles_rad(self) -> FloatArray:
        """Direction (N,) of each beam from straight ahead, counter-clockwise; the first points to the right."""
        count = round(self.field_rad / self.step_rad) + 1
        return np.asarray(self.step_rad * (np.arange(count) - (count - 1) / 2), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class RangeScan:
    """Distances to what stands up, in one plane: a turn of a laser scanner, or what a camera made of its columns.

    ``pose`` is the believed one of the sensor, its x axis straight ahead; ``ground`` that of the ground.
    """

    time_s: float
    angles_rad: FloatArray  # (N,) of the beams from straight ahead, counter-clockwise
    ranges_m: FloatArray  # (N,); inf where nothing within reach came back
    range_sd_m: FloatArray  # (N,) one sigma
    least_m: FloatArray  # (N,) nearer than this the beam says nothing
    reach_m: float
    pose: Pose
    ground: GroundPlane


class PerceivedRock(msgspec.Struct, frozen=True):
    """A rock as the camera saw it, placed on the believed ground; a frozen dataclass takes 30 times as long to make."""

    position_w: Vector3  # centre of its base
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float
    certainty: float  # 0..1
    formation: int
    range_m: float  # ground distance from the camera
    position_sd_m: float  # one sigma of the position along the line of sight
    cut: bool = False  # it runs out of the picture: sizes are lower bounds
    height_sd_m: float = 0.0  # one sigma of the height; 0: not known


@dataclass(frozen=True, eq=False)
class Observation:
    """What one frame says about the ground, in world coordinates."""

    time_s: float
    rocks: tuple[PerceivedRock, ...]
    classes: NDArray[np.str_]  # (rows, columns) letters of TerrainClass, top row first
    class_centre_w: FloatArray  # (rows, columns, 2), NaN where a window sees no ground
    footprint_w: FloatArray  # (N, 2) outline of the ground that was seen, counter-clockwise
    ground: GroundPlane | None = None  # the plane that places were found on; None: level at height 0


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """What the rover believes of its own motion."""

    time_s: float
    pose: Pose
    velocity_w: FloatArray  # (3,)
    yaw_rate_rad_s: float
    position_sd_m: float
    yaw_sd_rad: float


@dataclass(frozen=True)
class ImuReading:
    """Strap-down inertial unit with a compass: specific force and rate in body axes, heading in the world."""

    acceleration_b: Vector3
    rate_b: Vector3
    heading_rad: float | None  # from +x counter-clockwise; None: the compass is silent


@dataclass(frozen=True)
class GnssReading:
    """A position and velocity fix in the world frame."""

    position_w: Vector3
    velocity_w: Vector3
    position_sd_m: float


@dataclass(frozen=True)
class BatteryReading:
    """What a battery that counts its charge says of itself."""

    voltage_v: float
    current_a: float
    used_mah: float  # since it was full
    used_j: float  # since the start
    capacity_mah: float

    @property
    def left_mah(self) -> float:
        """Charge left."""
        return max(self.capacity_mah - self.used_mah, 0.0)

    @property
    def left_share(self) -> float:
        """Charge left, 0 to 1."""
        return self.left_mah / self.capacity_mah


@dataclass(frozen=True)
class SensorReadings:
    """All that the rover's own sensors gave at one instant; ``gnss`` is None between fixes, a silent unit's too."""

    time_s: float
    imu: ImuReading | None
    wheel_speed_rad_s: tuple[float, ...]  # left side front to rear, then right side front to rear
    gnss: GnssReading | None = None
    battery: BatteryReading | None = None  # None: the rover has none that can be read


@dataclass(frozen=True)
class RigidBody:
    """A hull on four equal wheels without suspension, at the corners of a rectangle.

    Body axes: origin in the middle of the axles at their height, x ahead, y left, z up.
    """

    wheelbase_m: float
    track_m: float
    wheel_radius_m: float
    wheel_width_m: float
    centre_of_mass_m: Vector3
    undersides_m: tuple[tuple[float, float, float, float, float], ...]  # of each box: rear, front, right, left, height


@dataclass(frozen=True)
class Footprint:
    """What the planner must know of the rover's body."""

    length_m: float
    width_m: float
    wheel_radius_m: float
    track_m: float
    wheelbase_m: float
    clearance_m: float
    max_speed_m_s: float
    max_yaw_rate_rad_s: float
    effective_track_ratio: float = 1.6  # skid-steer: kinematic yaw rate over true yaw rate
    wheels: int = 4  # half of them on each side
    climb_height_m: float = 0.08  # lower rocks may be driven over
    body: RigidBody | None = None  # None: its wheels hang on arms, or nothing is known

    @property
    def wheel_width_m(self) -> float:
        """Width of a wheel: the outer edges of two are as far apart as the body is wide."""
        return self.width_m - self.track_m


@dataclass(frozen=True, eq=False)
class SoilMap:
    """Which soil lies at each sample of the ground's grid; the nearest sample speaks for a point."""

    soils: tuple[Soil, ...]  # the first is the world's main soil
    index: ByteArray  # (ny, nx) into ``soils``


@dataclass(frozen=True, eq=False)
class World:
    """Everything that is true of one scenario and seed."""

    scenario: Scenario
    seed: int
    ground: HeightField  # rocks too small for a mesh are bumps of it
    rocks: RockTable  # those with a mesh of their own
    cylinders: tuple[Cylinder, ...]
    shapes: Shapes  # of rocks and cylinders, as meshes
    soil: Soil
    start: Pose  # on the ground under the rover, turned to its heading only
    goal_w: Vector3
    soil_map: SoilMap | None = None  # None where ``soil`` lies everywhere
    origin: Origin = DEFAULT_ORIGIN  # geographic place of x = y = z = 0
    notes: tuple[str, ...] = ()  # one line each: what the user should know of how it was made

    @property
    def picture_mesh(self) -> TriangleMesh:
        """Everything as the camera sees it, made anew; only small worlds can hold it."""
        return self.shapes.picture(np.arange(len(self.shapes.ids), dtype=np.int32))

    @property
    def collision_mesh(self) -> TriangleMesh:
        """The same, coarser."""
        return self.shapes.collision(np.arange(len(self.shapes.ids), dtype=np.int32))
