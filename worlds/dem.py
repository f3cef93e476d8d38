"""Elevation files as ground: cropped, holes filled, resampled, with detail below their own resolution."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from worlds.dem_files import Raster, read_raster
from worlds.errors import ScenarioError
from worlds.scenario import Origin, Terrain, check_cells
from worlds.synthesis import add_tilt, fractal
from worlds.types import HeightField

MOST_MISSING = 0.05  # share of the heights that may be filled in


@dataclass(frozen=True, eq=False)
class Elevation:
    """What came out of an elevation file."""

    field: HeightField
    origin: Origin | None = None  # of x = y = z = 0, where the file says where on Earth it lies
    notes: tuple[str, ...] = ()  # one line each, for the user


def load_dem(terrain: Terrain, source: str, rng: np.random.Generator) -> Elevation:
    """The elevation file ``terrain.path``: cropped, holes filled, resampled, with tilt and detail added.

    World (0, 0) is the middle of the file, also after a crop, so coordinates do not depend on ``crop_m``; y is the
    file's north and z its height. A GeoTIFF brings its pixel size and is resampled to ``resolution_m``; in other files
    ``resolution_m`` is the pixel size. Pictures have north at the top; row 0 of a NumPy array is the southernmost.
    Raises `ScenarioError`, beginning with ``source``, for a file that cannot be used.
    """
    path = Path(terrain.path or "")
    complaint = f'{source}: terrain.path = "{path}"'
    raster = read_raster(terrain, complaint)
    whole, notes = _without_holes(_crop(raster, terrain, complaint), path.name, complaint)
    field = _resample(whole, terrain, source)
    add_tilt(field, terrain)
    if terrain.detail_m:
        field.heights_m[:] += fractal(field, terrain.detail_m, rng, _detail_band(whole, terrain, source))
    georeference = raster.georeference
    if georeference.note:
        notes = (*notes, f"{path.name}: {georeference.note}: the mission origin is the scenario's [origin]")
    place = georeference.place_deg
    origin = None if place is None else Origin(latitude_deg=place[0], longitude_deg=place[1], altitude_m=0.0)
    return Elevation(field, origin, notes)


def _crop(raster: Raster, terrain: Terrain, complaint: str) -> Raster:
    """The part inside ``crop_m``, to whole cells."""
    if terrain.crop_m is None:
        return raster
    x0, y0, x1, y1 = terrain.crop_m
    x, y = raster.x_m, raster.y_m
    slack_x, slack_y = (0.5 * step for step in raster.pixel_m)
    if x0 < x[0] - slack_x or x1 > x[-1] + slack_x or y0 < y[0] - slack_y or y1 > y[-1] + slack_y:
        raise ScenarioError(
            f"{complaint}: terrain.crop_m = {list(terrain.crop_m)} reaches off the file; "
            f"allowed are x {x[0]:.2f} to {x[-1]:.2f} and y {y[0]:.2f} to {y[-1]:.2f}"
        )
    columns, rows = (x >= x0 - slack_x) & (x <= x1 + slack_x), (y >= y0 - slack_y) & (y <= y1 + slack_y)
    if columns.sum() < 5 or rows.sum() < 5:
        raise ScenarioError(f"{complaint}: terrain.crop_m = {list(terrain.crop_m)} leaves fewer than 5 x 5 heights")
    return Raster(raster.heights_m[np.ix_(rows, columns)], x[columns], y[rows], raster.georeference)


def _without_holes(raster: Raster, name: str, complaint: str) -> tuple[Raster, tuple[str, ...]]:
    """The raster with missing heights filled in, and what to tell the user of it."""
    holes = ~np.isfinite(raster.heights_m)
    missing = int(holes.sum())
    if not missing:
        return raster, ()
    share = missing / holes.size
    text = f"{missing} of {holes.size} heights ({100 * share:.2g} %) are missing"
    if share > MOST_MISSING:
        raise ScenarioError(
            f"{complaint}: {text}; up to {100 * MOST_MISSING:g} % would be filled in, "
            "so choose a part without gaps by terrain.crop_m"
        )
    from worlds.holes import fill_holes

    filled = fill_holes(raster.heights_m, holes)
    return Raster(filled, raster.x_m, raster.y_m, raster.georeference), (f"{name}: {text} and were filled in",)


def _resample(raster: Raster, terrain: Terrain, source: str) -> HeightField:
    """Square cells of ``resolution_m``, by the spline of ``resample``."""
    from scipy.interpolate import RectBivariateSpline

    x, y = raster.x_m, raster.y_m
    size = (float(x[-1] - x[0]), float(y[-1] - y[0]))
    check_cells(size, terrain.resolution_m, source)
    if np.allclose(raster.pixel_m, terrain.resolution_m, rtol=1e-9):
        return HeightField(raster.heights_m, terrain.resolution_m, (float(x[0]), float(y[0])))
    degree = 3 if terrain.resample == "bicubic" else 1
    spline = RectBivariateSpline(y, x, raster.heights_m, kx=degree, ky=degree)
    # Whole cells inside the old grid, so that nothing is extrapolated; what is left over is shared by both edges.
    nx, ny = (int(np.floor(side / terrain.resolution_m + 1e-9)) for side in size)
    west = x[0] + (size[0] - nx * terrain.resolution_m) / 2
    south = y[0] + (size[1] - ny * terrain.resolution_m) / 2
    new_x = west + terrain.resolution_m * np.arange(nx + 1)
    new_y = south + terrain.resolution_m * np.arange(ny + 1)
    heights = spline(np.clip(new_y, y[0], y[-1]), np.clip(new_x, x[0], x[-1]))
    return HeightField(np.ascontiguousarray(heights), terrain.resolution_m, (float(west), float(south)))


def _detail_band(raster: Raster, terrain: Terrain, source: str) -> tuple[float, float]:
    """Longest and shortest wave of the detail: from what the file can hold down to what the grid can."""
    longest, shortest = 2.0 * max(raster.pixel_m), 2.0 * terrain.resolution_m
    if longest <= shortest:
        raise ScenarioError(
            f"{source}: terrain.detail_m = {terrain.detail_m:g}: adds relief finer than the elevation file's grid of "
            f"{longest / 2:.3g} m, so terrain.resolution_m = {terrain.resolution_m:g} must be less than that"
        )
    return longest, shortest
