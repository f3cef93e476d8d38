"""Camera files: the camera that took a picture, as TOML, written by people or by ``rover-sim calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from perception.lens import COEFFICIENTS
from perception.rock_placement import View
from rover_sim.errors import InputError
from rover_sim.sim.rover import load_rover
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.scenario import Camera
from worlds.strict_toml import Limits, check_limits, convert_table, read_table
from worlds.types import CameraModel, GroundPlane, Lens, Pose

_LIMITS: Limits = {
    "width": (1, 100_000),
    "height": (1, 100_000),
    "fov_deg": (1.0, 170.0),
    "pitch_deg": (-89.0, 89.0),
    "height_m": (0.01, 1000.0),
    "lens.focal_px": (1e-3, 1e7),
    "lens.centre_px": (-1e6, 1e6),
    "lens.coefficients": (-1e4, 1e4),
    "lens.reprojection_px": (0.0, 1e4),
    "stereo.baseline_m": (1e-3, 100.0),
}
_SHAPE_TOLERANCE = 0.01  # of the aspect ratio


class LensTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What calibration finds; pixels of a picture of the file's size, the centre of the first one at (0.5, 0.5)."""

    model: Literal["brown", "fisheye"]
    focal_px: tuple[float, float]  # across, down
    centre_px: tuple[float, float]
    coefficients: tuple[float, ...]  # brown: k1 k2 p1 p2 k3; fisheye: k1 k2 k3 k4, both as in OpenCV
    reprojection_px: float | None = None  # of the calibration, rms


class StereoTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A second, equal camera to the right of the first, its axes parallel."""

    baseline_m: float


class CameraFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A camera over level ground, ``pitch_deg`` positive looking down.

    An ideal one has its horizontal field of view ``fov_deg``, a real one its ``lens``.
    """

    width: int
    height: int
    fov_deg: float | None = None
    pitch_deg: float
    height_m: float
    lens: LensTable | None = None
    stereo: StereoTable | None = None


def load_camera(path: Path) -> CameraFile:
    """The camera of a TOML file; InputError names the file, the key and what is allowed."""
    camera = convert_table(read_table(path), CameraFile, str(path))
    check_limits(camera, _LIMITS, str(path))
    if (camera.fov_deg is None) == (camera.lens is None):
        raise InputError(f"{path}: give fov_deg or a table [lens], one of the two")
    if camera.lens is not None:
        _check_lens(camera.lens, path)
    return camera


def _check_lens(lens: LensTable, path: Path) -> None:
    wanted = COEFFICIENTS[lens.model]
    if len(lens.coefficients) != wanted:
        raise InputError(
            f"{path}: lens.coefficients has {len(lens.coefficients)} numbers; the model {lens.model} has {wanted}"
        )


def baseline_m(camera: CameraFile | None) -> float:
    """Distance of the two cameras of a pair; InputError where the file does not describe one that can be used."""
    if camera is None or camera.stereo is None:
        raise InputError("--right: needs a --camera file with a table [stereo] that holds baseline_m")
    return camera.stereo.baseline_m


def default_camera(size: tuple[int, int]) -> CameraFile:
    """The simulated rover's camera, for a picture of ``size`` (width, height) of which nothing is known."""
    usual, height_m = Camera(), load_rover("husky").mast.height_m
    return CameraFile(
        width=size[0], height=size[1], fov_deg=usual.fov_deg, pitch_deg=usual.pitch_deg, height_m=height_m
    )


def camera_view(camera: CameraFile, size: tuple[int, int], source: str) -> View:
    """View of a picture of ``size`` over level ground, the camera above x = y = 0, looking along x.

    A picture of the same shape but another size is taken as scaled. Raises InputError where the shapes differ.
    """
    model = camera_model(camera, size, source)
    pose = camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0)), model)
    return View(model, pose, GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0])))


def camera_model(camera: CameraFile, size: tuple[int, int], source: str) -> CameraModel:
    """The camera in pixels of a picture of ``size`` (width, height); InputError where the shapes differ."""
    ratio = size[0] * camera.height / (size[1] * camera.width)
    if abs(ratio - 1.0) > _SHAPE_TOLERANCE:
        raise InputError(
            f"{source}: is {size[0]} x {size[1]} px, the camera file says {camera.width} x {camera.height}; "
            "the picture must have the camera's shape"
        )
    place = (0.0, 0.0, camera.height_m)
    pitch = float(np.deg2rad(camera.pitch_deg))
    if camera.lens is None:
        assert camera.fov_deg is not None
        focal = size[0] / 2.0 / np.tan(np.deg2rad(camera.fov_deg) / 2.0)
        return CameraModel(size[0], size[1], float(focal), place, pitch)
    across, down = size[0] / camera.width, size[1] / camera.height
    focal_px = camera.lens.focal_px[0] * across, camera.lens.focal_px[1] * down
    centre = camera.lens.centre_px[0] * across, camera.lens.centre_px[1] * down
    lens = Lens(camera.lens.model, camera.lens.coefficients, centre, focal_px[1] / focal_px[0])
    return CameraModel(size[0], size[1], focal_px[0], place, pitch, lens)
