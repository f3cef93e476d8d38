"""What the camera says of itself, of its pictures and of where they are kept."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_sim.mavlink.attitude import global_position_int
from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.heartbeat import COMPONENT
from rover_sim.mavlink.tlog import SIMULATED_EPOCH_S
from worlds.geometry import camera_pose, quaternion_from_rotation, rotation_from_quaternion
from worlds.types import CameraModel

CAMERA = int(mavlink.MAV_COMP_ID_CAMERA)
PICTURES = "pictures"  # folder below that of the run
_STORAGE = 1  # number of the only one
_UNKNOWN = math.nan
_IDLE, _INTERVAL_IDLE = 0, 2  # image_status of CAMERA_CAPTURE_STATUS


@dataclass(frozen=True, eq=False)
class CameraPort:
    """The rover's camera as the link needs it."""

    model: CameraModel
    folder: Path  # of the run
    take: Callable[[Path], bool]  # writes a picture as PNG; False where the camera has failed


@dataclass(frozen=True)
class CameraState:
    """What the camera is doing; ``interval_s`` is 0 unless it takes a picture every so often."""

    pictures: int = 0
    interval_s: float = 0.0


def heartbeat() -> Message:
    """HEARTBEAT of a camera: by it ground stations find the component."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_CAMERA, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


def information(context: Context, port: CameraPort) -> Message:
    """CAMERA_INFORMATION: takes pictures and nothing else; it is modelled in pixels, so its sensor has no size."""
    return mavlink.MAVLink_camera_information_message(
        context.boot_ms,
        _text32("rover-sim"),
        _text32("rendered camera"),
        0,
        _UNKNOWN,  # focal length and size of the sensor, mm
        _UNKNOWN,
        _UNKNOWN,
        port.model.width_px,
        port.model.height_px,
        0,
        mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE,
        0,
        b"",
    )


def settings(context: Context) -> Message:
    """CAMERA_SETTINGS: pictures, no zoom, no focus."""
    return mavlink.MAVLink_camera_settings_message(context.boot_ms, mavlink.CAMERA_MODE_IMAGE, _UNKNOWN, _UNKNOWN)


def storage(context: Context, port: CameraPort) -> Message:
    """STORAGE_INFORMATION: the disk of the run's folder."""
    return mavlink.MAVLink_storage_information_message(
        context.boot_ms,
        _STORAGE,
        1,
        mavlink.STORAGE_STATUS_READY,
        *_disk_mib(port.folder),
        _UNKNOWN,
        _UNKNOWN,
        mavlink.STORAGE_TYPE_OTHER,
        b"run folder",
        mavlink.STORAGE_USAGE_FLAG_PHOTO,
    )


def capture_status(context: Context, port: CameraPort, state: CameraState) -> Message:
    """CAMERA_CAPTURE_STATUS."""
    return mavlink.MAVLink_camera_capture_status_message(
        context.boot_ms,
        _INTERVAL_IDLE if state.interval_s else _IDLE,
        0,
        state.interval_s,
        0,
        _disk_mib(port.folder)[2],
        state.pictures,
    )


def captured(context: Context, port: CameraPort, index: int, name: str, *, good: bool) -> Message:
    """CAMERA_IMAGE_CAPTURED: where the rover believes the camera was; a place of zeros before the first pose."""
    place = global_position_int(context)
    where = (0, 0, 0, 0) if place is None else (place.lat, place.lon, place.alt, place.relative_alt)
    return mavlink.MAVLink_camera_image_captured_message(
        context.boot_ms,
        round((SIMULATED_EPOCH_S + context.time_s) * 1e6),
        0,
        *where,
        _orientation(context, port.model),
        index,
        1 if good else 0,
        f"mftp://[;comp={COMPONENT}]/{PICTURES}/{name}".encode() if good else b"",
    )


def _orientation(context: Context, model: CameraModel) -> tuple[float, float, float, float]:
    """Turn from north-east-down to the camera's forward-right-down, as w, x, y, z."""
    if context.estimate is None:
        return (1.0, 0.0, 0.0, 0.0)
    right, down, forward = rotation_from_quaternion(camera_pose(context.estimate.pose, model).quaternion_w).T
    axes = np.stack([forward, right, down], axis=1)  # columns, in east-north-up
    x, y, z, w = (float(value) for value in quaternion_from_rotation(np.stack([axes[1], axes[0], -axes[2]])))
    return w, x, y, z


def _disk_mib(folder: Path) -> tuple[float, float, float]:
    """Total, used and free MiB of a folder's disk; unknown if the folder is gone."""
    try:
        disk = shutil.disk_usage(folder)
    except OSError:
        return (_UNKNOWN, _UNKNOWN, _UNKNOWN)
    return disk.total / 2**20, disk.used / 2**20, disk.free / 2**20


def _text32(text: str) -> bytes:
    return text.encode().ljust(32, b"\0")
