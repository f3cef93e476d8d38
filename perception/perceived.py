"""What a picture shows: the rocks in it, and all that one look tells."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from perception.binarize import SingleArray
from perception.blobs import Blobs
from perception.rock_geometry import RockOutlines
from perception.window_features import WindowSource
from worlds.types import BoolArray, FloatArray, IntArray, Observation, PerceivedRock


class ImageRock(msgspec.Struct, frozen=True):
    """A rock as it lies in the working picture; pixel centres at +0.5, angles counter-clockwise as seen."""

    id: int  # its value in `Perception.labels`
    centroid_px: tuple[float, float]  # column, row
    bbox_px: tuple[int, int, int, int]  # x, y, width, height
    area_px: int
    certainty: float  # 0..1
    formation: int  # 0..9
    axis_rad: float  # of the first principal axis, in [0, pi)
    length_px: float  # along it
    sections_px: tuple[float, ...]  # A0..A8 across it
    touches_border: bool
    placed: PerceivedRock | None = None  # on the ground; None without a camera pose or out of range


@dataclass(frozen=True, eq=False)
class Perception:
    """What one picture shows, in pixels of the working picture."""

    scale: tuple[float, float]  # input pixels per working pixel, across and down
    score: SingleArray  # (240, 320) rock evidence 0..1
    mask: BoolArray  # (240, 320) accepted rock
    labels: IntArray  # (240, 320) rock id, 0 = none
    hidden: BoolArray  # (240, 320) sky, beyond the horizon, or no data
    rocks: tuple[ImageRock, ...]
    outlines: RockOutlines  # of the rocks, in their order
    classes: NDArray[np.str_]  # (12, 16) letters of TerrainClass, top row first
    windows: WindowSource  # what their features are measured on
    observation: Observation | None


def image_rocks(blobs: Blobs, shape: RockOutlines, certainty: FloatArray) -> tuple[ImageRock, ...]:
    """Blobs with their outlines and certainty (R,) as rocks of the picture, numbered from 1."""
    columns = zip(
        blobs.centre_px.tolist(),
        blobs.box_px.tolist(),
        blobs.area_px.tolist(),
        certainty.tolist(),
        shape.formation.tolist(),
        blobs.axis_rad.tolist(),
        shape.length_px.tolist(),
        shape.sections_px.tolist(),
        np.any(blobs.border, axis=1).tolist(),
        strict=True,
    )
    return tuple(
        ImageRock(i + 1, (x, y), tuple(box), area, sure, form, axis, length, tuple(sections), cut)
        for i, ((x, y), box, area, sure, form, axis, length, sections, cut) in enumerate(columns)
    )
