"""A field of random rocks: sizes, places and shapes as arrays; large ones become bodies, small ones bumps."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from worlds.heightfield import height_at
from worlds.rock_shape import draw_aspects, draw_formations, draw_profiles
from worlds.rock_sizes import place_discs, sample_diameters
from worlds.scenario import Rocks
from worlds.types import BoolArray, FloatArray, HeightField, IntArray, RockTable

MESH_MIN_DIAMETER_M = 0.08  # a wheel rolls over smaller ones, and thousands of them would be most of the faces
BUMP_SIGMA_M = 0.02  # about the radius of a small rock; the grid spacing where that is larger
BAND_ROWS = 512  # of the ground are worked on at a time, so that a large map needs little memory

HEIGHT_OVER_WIDTH = 0.5  # sections are semicircles


@dataclass(frozen=True, eq=False)
class RockField:
    """Random rocks, one a row, largest first."""

    centres_m: FloatArray  # (N, 2)
    diameters_m: FloatArray  # (N,)
    formations: IntArray  # (N,)
    yaws_rad: FloatArray  # (N,)
    aspects: FloatArray  # (N,) length over width
    profiles: FloatArray  # (N, 9)

    @property
    def lengths_m(self) -> FloatArray:
        """Extent (N,) along the principal axis."""
        return self.diameters_m * np.sqrt(self.aspects)

    @property
    def widths_m(self) -> FloatArray:
        """Largest diameter (N,) across the principal axis."""
        return self.diameters_m / np.sqrt(self.aspects)

    def chosen(self, mask: BoolArray) -> RockField:
        """The rocks where ``mask`` (N,) holds."""
        return RockField(**{field.name: getattr(self, field.name)[mask] for field in fields(self)})


def draw_rock_field(
    rocks: Rocks,
    ground: HeightField,
    sizes: np.random.Generator,
    places: np.random.Generator,
    shapes: np.random.Generator,
) -> RockField:
    """Rocks over the whole map by the size-frequency law, uniformly placed, none overlapping another's length."""
    (west, east), (south, north) = ground.x_limits_m, ground.y_limits_m
    size = (east - west, north - south)
    diameters = sample_diameters(rocks.cfa, rocks.min_diameter_m, rocks.max_diameter_m, size[0] * size[1], sizes)
    formations, yaws = draw_formations(len(diameters), rocks.formations, shapes)
    aspects = draw_aspects(formations, shapes)
    profiles = draw_profiles(formations, shapes)
    centres = place_discs(diameters * np.sqrt(aspects) / 2.0, size, places) + np.array([west, south])
    return RockField(centres, diameters, formations, yaws, aspects, profiles)


def thin(field: RockField, keep_clear: FloatArray) -> RockField:
    """The rocks that reach into none of the discs ``keep_clear`` (M, 3) of x, y and radius.

    They are taken away rather than laid elsewhere: moving a goal or adding an obstacle leaves all other rocks alone.
    """
    keep = np.ones(len(field.diameters_m), dtype=bool)
    for x, y, radius in keep_clear:
        distance = np.hypot(field.centres_m[:, 0] - x, field.centres_m[:, 1] - y)
        keep &= distance >= radius + field.lengths_m / 2.0
    return field.chosen(keep)


def imprint(small: RockField, ground: HeightField) -> HeightField:
    """The ground with each small rock as a bump of its volume (half an ellipsoid).

    A bump is a Gaussian of at least one cell: coarse grids get lower, wider bumps rather than spikes.
    """
    from scipy.ndimage import gaussian_filter

    if not len(small.diameters_m):
        return ground
    volume = np.pi / 6.0 * small.diameters_m**2 * small.widths_m * HEIGHT_OVER_WIDTH
    ny, nx = ground.heights_m.shape
    column, row = ((small.centres_m - np.asarray(ground.origin_m)) / ground.resolution_m).T
    left, low = np.clip(column.astype(int), 0, nx - 2), np.clip(row.astype(int), 0, ny - 2)
    u, v = column - left, row - low
    sigma = max(1.0, BUMP_SIGMA_M / ground.resolution_m)
    halo = int(4.0 * sigma + 0.5)  # where the filter cuts its Gaussian
    heights = np.empty_like(ground.heights_m)
    for first in range(0, ny, BAND_ROWS):
        last = min(first + BAND_ROWS, ny)
        start, stop = max(first - halo, 0), min(last + halo, ny)
        deposit = np.zeros((stop - start + 1, nx))  # its last row takes what belongs to the next band
        here = (low >= start - 1) & (low < stop)
        for down, right, share in ((0, 0, (1 - v) * (1 - u)), (0, 1, (1 - v) * u), (1, 0, v * (1 - u)), (1, 1, v * u)):
            place = low[here] + down - start  # -1 is that last row too
            np.add.at(deposit, (place, left[here] + right), (share * volume / ground.resolution_m**2)[here])
        bumps = gaussian_filter(deposit[:-1], sigma, mode="constant")
        np.add(ground.heights_m[first:last], bumps[first - start : last - start], out=heights[first:last])
    return HeightField(heights, ground.resolution_m, ground.origin_m)


def rocks_of(field: RockField, ground: HeightField, first_id: int) -> RockTable:
    """The rocks of a field standing on ``ground``, numbered from ``first_id``."""
    count = len(field.diameters_m)
    return RockTable(
        ids=np.arange(first_id, first_id + count, dtype=np.int32),
        position_w=np.column_stack([field.centres_m, height_at(ground, *field.centres_m.T)]),
        extents_m=np.column_stack([field.lengths_m, field.widths_m, field.widths_m * HEIGHT_OVER_WIDTH]),
        yaw_rad=field.yaws_rad,
        formation=field.formations,
        section_ratio=field.profiles,
    )
