"""The ground as a 16-bit grey picture with a description, square with 2^n + 1 pixels a side as Gazebo wants it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from rover_sim.errors import InputError
from rover_sim.export.part import Part
from rover_sim.export.rut_surface import press_ruts
from rover_sim.files import atomic_path, write_json
from worlds.heightfield import height_at
from worlds.types import HeightField

LARGEST_SIDE_PX = 4097
_WHITE = 65535
_LEAST_SPAN_M = 1e-3  # of level ground, whose levels would otherwise be of no height


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Grey levels of a ground: height = ``offset_m`` + ``scale_m`` * level."""

    levels: NDArray[np.uint16]  # (N, N), the northernmost row first
    offset_m: float
    scale_m: float


def write_heightmap(part: Part, folder: Path) -> list[str]:
    """Write ``heightmap.png`` and ``heightmap.json``; the names of the files."""
    ground = part.ground if part.ruts is None else press_ruts(part.ground, part.ruts, (LARGEST_SIDE_PX - 1) ** 2)
    made = heightmap(ground)
    with atomic_path(folder / "heightmap.png") as path:
        done, data = cv2.imencode(".png", made.levels)
        if not done:
            raise InputError(f"{path}: the picture could not be packed")
        path.write_bytes(data.tobytes())
    (west, east), (south, north) = part.ground.x_limits_m, part.ground.y_limits_m
    origin = part.world.origin
    description = {
        "scenario": part.world.scenario.name,
        "seed": part.world.seed,
        "picture": "heightmap.png",
        "side_px": made.levels.shape[0],
        "first_row": "north",
        "x_limits_m": [west, east],
        "y_limits_m": [south, north],
        "size_m": [east - west, north - south, made.scale_m * _WHITE],
        "offset_m": made.offset_m,
        "scale_m": made.scale_m,
        "height_m": "offset_m + scale_m * level; first and last pixels lie on the limits",
        "latitude_deg": origin.latitude_deg,
        "longitude_deg": origin.longitude_deg,
        "altitude_m": origin.altitude_m,
    }
    write_json(folder / "heightmap.json", description)
    return ["heightmap.png", "heightmap.json"]


def heightmap(ground: HeightField) -> HeightMap:
    """The ground at the corners of a square of 2^n cells a side, no coarser than its grid where that is allowed."""
    side = min(2 ** int(np.ceil(np.log2(max(ground.heights_m.shape) - 1))) + 1, LARGEST_SIDE_PX)
    x, y = (np.linspace(*limits, side) for limits in (ground.x_limits_m, ground.y_limits_m))
    # The whole range of levels is used: some programs take the brightest pixel for the top, others white.
    heights = np.concatenate([height_at(ground, x[None, :], rows[:, None]) for rows in np.array_split(y[::-1], 32)])
    low = float(heights.min())
    scale = max(float(heights.max()) - low, _LEAST_SPAN_M) / _WHITE
    return HeightMap(np.rint((heights - low) / scale).astype(np.uint16), low, scale)
