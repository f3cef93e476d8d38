"""What the shading kernel is told: camera, ground, rocks, shadows and light, as tuples that compiled code can take."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from worlds.types import FloatArray, IntArray

Colour = tuple[float, float, float]


class Lens(NamedTuple):
    """Where the camera is and how it sees."""

    eye_w: FloatArray  # (3,)
    rotation: FloatArray  # (3, 3), columns are right, down, forward in the world
    focal_px: float


class Surface(NamedTuple):
    """The ground: slopes at every sample, and the plane beyond its edge."""

    slopes: NDArray[np.float32]  # (ny, nx, 2) dz/dx, dz/dy
    x0_m: float
    y0_m: float
    resolution_m: float
    slope_beyond_x: float
    slope_beyond_y: float


class Stones(NamedTuple):
    """How each face of the rocks looks."""

    normal: NDArray[np.float32]  # (F, 3) outward unit normals
    block: IntArray  # (F,) which rock
    look: NDArray[np.float32]  # (R, 9) red, green, blue, dust share, texture offset x, y, z, roughness, width in m


class ShadowMap(NamedTuple):
    """Heights of what the sun meets first; a texel is a ray of the sun through a level plane."""

    key: NDArray[np.float32]  # (N, N)
    matrix: FloatArray  # (4, 4) world to texels and key


class Light(NamedTuple):
    """Colours are of a picture of 0..255 levels; the exposure is in them."""

    to_sun_w: Colour  # unit vector
    sun: Colour
    ambient: Colour
    sand: Colour
    pebble: Colour
    horizon: Colour
    zenith: Colour
    haze_per_m: float
