"""The rover's camera: what a picture is, what a renderer does, and the software rasteriser put together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from statistics import NormalDist
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from worlds.geometry import rotation_from_quaternion
from worlds.types import ByteArray, CameraModel, IntArray, Pose, World

if TYPE_CHECKING:
    from rover_sim.sim.ruts import RutField

SKY_ID = -1
GROUND_ID = 0
SIZE_LIMITS_PX = (16, 2048)
NOISE_DRAWS = 1 << 16


@dataclass(frozen=True, eq=False)
class RenderedImage:
    """A picture with its truth."""

    image: ByteArray  # (H, W, 3) red, green, blue
    depth_m: NDArray[np.float32]  # (H, W) distance along the camera's axis, inf where there is sky
    ids: IntArray  # (H, W) -1 sky, 0 ground, else the id of a rock or cylinder


class Renderer(Protocol):
    """Anything that takes pictures of one world."""

    def render(self, camera: CameraModel, camera_pose: Pose) -> RenderedImage:
        """Picture from a pose whose axes are the camera's right, down and forward."""
        ...

    def clasts(self, camera: CameraModel, camera_pose: Pose, picture: RenderedImage) -> IntArray:
        """The ids of a picture from there, with every pebble that it shows numbered after all rocks."""
        ...


def make_renderer(world: World, ruts: RutField | None = None) -> Renderer:
    """The software rasteriser for a world; compiled parts are loaded here, or built on the first use ever.

    It shows ``ruts`` as they are at each picture.
    """
    # Numba takes half a second to import.
    from rover_sim.sim.rasteriser import Rasteriser

    return Rasteriser(world, ruts)


def add_noise(image: ByteArray, sd_levels: float, rng: np.random.Generator) -> ByteArray:
    """A picture with independent normal noise of ``sd_levels`` grey levels in every channel, clipped to 0..255."""
    if sd_levels == 0.0:
        return image
    from rover_sim.sim.picture_noise import add_levels

    noisy = np.empty_like(image)
    draws = np.frombuffer(rng.bytes(2 * image.size), dtype=np.uint16)
    add_levels(image.ravel(), draws, _noise_levels(sd_levels), noisy.ravel())
    return noisy


@cache
def _noise_levels(sd_levels: float) -> NDArray[np.int16]:
    """The noise for each draw of 16 bits: equally likely values of the normal distribution, in whole levels."""
    half = [NormalDist().inv_cdf((draw + 0.5) / NOISE_DRAWS) for draw in range(NOISE_DRAWS // 2)]
    return np.rint(sd_levels * np.array([*half, *(-value for value in reversed(half))])).astype(np.int16)


def check_camera(camera: CameraModel) -> None:
    """Raise ValueError where a picture's size or focal length cannot be drawn."""
    low, high = SIZE_LIMITS_PX
    if not (low <= camera.width_px <= high and low <= camera.height_px <= high):
        raise ValueError(f"picture of {camera.width_px} x {camera.height_px} px: each side must be {low}..{high}")
    if not (np.isfinite(camera.focal_px) and camera.focal_px > 0):
        raise ValueError(f"focal length {camera.focal_px} px: must be positive")


def pose_rotation(pose: Pose) -> NDArray[np.float64]:
    """Columns are the camera's right, down and forward axes in the world."""
    return rotation_from_quaternion(pose.quaternion_w / np.linalg.norm(pose.quaternion_w))
