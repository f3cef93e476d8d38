"""What `perceive` reports of one picture, in the picture's own pixels, and the camera that it is reported for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from perception.pipeline import ImageRock, Perception, View
from rover_sim import __version__
from rover_sim.errors import InputError
from rover_sim.picture_paths import PicturePath
from rover_sim.sim.rover import load_rover
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.scenario import Camera
from worlds.strict_toml import Limits, check_limits, convert_table, read_table
from worlds.types import CameraModel, GroundPlane, Pose

_LIMITS: Limits = {
    "width": (1, 100_000),
    "height": (1, 100_000),
    "fov_deg": (1.0, 170.0),
    "pitch_deg": (-89.0, 89.0),
    "height_m": (0.01, 1000.0),
}
_SHAPE_TOLERANCE = 0.01  # of the aspect ratio


class CameraFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A camera over level ground; ``fov_deg`` is horizontal, ``pitch_deg`` positive looking down."""

    width: int
    height: int
    fov_deg: float
    pitch_deg: float
    height_m: float


def load_camera(path: Path) -> CameraFile:
    """The camera of a TOML file; InputError names the file, the key and what is allowed."""
    camera = convert_table(read_table(path), CameraFile, str(path))
    check_limits(camera, _LIMITS, str(path))
    return camera


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
    ratio = size[0] * camera.height / (size[1] * camera.width)
    if abs(ratio - 1.0) > _SHAPE_TOLERANCE:
        raise InputError(
            f"{source}: is {size[0]} x {size[1]} px, the camera file says {camera.width} x {camera.height}; "
            "the picture must have the camera's shape"
        )
    focal = size[0] / 2.0 / np.tan(np.deg2rad(camera.fov_deg) / 2.0)
    model = CameraModel(
        size[0], size[1], float(focal), (0.0, 0.0, camera.height_m), float(np.deg2rad(camera.pitch_deg))
    )
    pose = camera_pose(Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0)), model)
    return View(model, pose, GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0])))


def result_table(
    found: Perception, paths: Sequence[PicturePath], size: tuple[int, int], camera: CameraFile | None, knowledge: str
) -> dict[str, Any]:
    """The table of the JSON file; keys in metres only where the ``camera`` is known."""
    metric = camera is not None
    return {
        "size_px": list(size),
        "camera": msgspec.to_builtins(camera or default_camera(size)),
        "camera_assumed": not metric,
        "knowledge": knowledge,
        "version": __version__,
        "classes": ["".join(row) for row in found.classes.tolist()],
        "rocks": [_rock(rock, found.scale, metric=metric) for rock in found.rocks],
        "waypoints": [_path(path, metric=metric) for path in paths],
    }


def _rock(rock: ImageRock, scale: tuple[float, float], *, metric: bool) -> dict[str, Any]:
    across, down = scale
    x, y, width, height = rock.bbox_px
    cos, sin = np.cos(rock.axis_rad), np.sin(rock.axis_rad)
    # Pixels that are not square turn directions and stretch what is measured along them.
    axis = float(np.mod(np.arctan2(sin * down, cos * across), np.pi))
    stretch = float(np.hypot(sin * across, cos * down))
    table: dict[str, Any] = {
        "id": rock.id,
        "centroid_px": [_round(rock.centroid_px[0] * across), _round(rock.centroid_px[1] * down)],
        "bbox_px": [_round(x * across), _round(y * down), _round(width * across), _round(height * down)],
        "area_px": _round(rock.area_px * across * down),
        "certainty": round(rock.certainty, 4),
        "formation": rock.formation,
        "axis_deg": _round(float(np.rad2deg(axis))),
        "sections_px": [_round(section * stretch) for section in rock.sections_px],
    }
    if metric and rock.placed is not None:
        table["position_m"] = [round(value, 4) for value in rock.placed.position_w]
        table["height_m"] = round(rock.placed.height_m, 4)
    return table


def _path(path: PicturePath, *, metric: bool) -> dict[str, Any]:
    table: dict[str, Any] = {
        "traversability": round(path.traversability, 4),
        "points_px": np.round(path.points_px, 2).tolist(),
    }
    if metric:
        table["points_m"] = np.round(path.points_w, 4).tolist()
    return table


def _round(value: float) -> float:
    return round(float(value), 2)
