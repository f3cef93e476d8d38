"""Elevation files: GeoTIFF, NumPy arrays and grey pictures as height fields."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np

from worlds.errors import ScenarioError
from worlds.heightfield import grid_points
from worlds.scenario import Terrain, check_cells
from worlds.synthesis import tilt
from worlds.types import FloatArray, HeightField

_PIXEL_SCALE_TAG = 33550  # GeoTIFF 1.1, ModelPixelScaleTag
_NO_DATA_TAG = 42113  # GDAL_NODATA

# What tifffile logs of a damaged file is in our error; without a handler it would be printed a second time.
logging.getLogger("tifffile").addHandler(logging.NullHandler())


def load_dem(terrain: Terrain, source: str) -> HeightField:
    """The elevation file ``terrain.path`` as a height field, cropped and resampled, with the tilt added.

    World (0, 0) is the middle of the file, also after a crop, so coordinates do not depend on ``crop_m``.
    A GeoTIFF brings its pixel size and is resampled to ``resolution_m``; in other files ``resolution_m`` is the
    pixel size. Pictures have north at the top; row 0 of a NumPy array is the southernmost, as in `HeightField`.
    Raises `ScenarioError`, beginning with ``source``, for a file that cannot be used.
    """
    path = Path(terrain.path or "")
    complaint = f'{source}: terrain.path = "{path}"'
    heights, pixel_m = _read(path, terrain, complaint)
    if min(heights.shape) < 5:
        raise ScenarioError(
            f"{complaint}: only {heights.shape[1]} x {heights.shape[0]} heights; at least 5 x 5 are needed"
        )
    missing = int(np.count_nonzero(~np.isfinite(heights)))
    if missing:
        raise ScenarioError(f"{complaint}: {missing} of {heights.size} heights are missing or not finite")
    ny, nx = heights.shape
    field = HeightField(heights, pixel_m, (-(nx - 1) * pixel_m / 2, -(ny - 1) * pixel_m / 2))
    field = _resample(_crop(field, terrain, complaint), terrain, source)
    return HeightField(field.heights_m + tilt(field, terrain), field.resolution_m, field.origin_m)


def _read(path: Path, terrain: Terrain, complaint: str) -> tuple[FloatArray, float]:
    """Heights with the southernmost row first, and the pixel size."""
    readers = {".tif": _read_tiff, ".tiff": _read_tiff, ".npy": _read_npy, ".png": _read_png}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise ScenarioError(f"{complaint}: unknown kind of file; allowed are .tif, .npy and .png")
    if not path.is_file():
        raise ScenarioError(f"{complaint}: no such file")
    values, pixel_m = reader(path, terrain, complaint)
    if values.ndim != 2:
        raise ScenarioError(f"{complaint}: has shape {values.shape}; allowed is one height a cell, two dimensions")
    if values.dtype.kind not in "iuf":
        raise ScenarioError(f"{complaint}: holds values of type {values.dtype}; allowed are real numbers")
    return np.ascontiguousarray(values, dtype=np.float64), pixel_m


def _read_tiff(path: Path, terrain: Terrain, complaint: str) -> tuple[Any, float]:
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            values = file.pages[0].asarray()
            tags = {tag.code: tag.value for tag in file.pages.first.tags}
    except Exception as error:  # a damaged file breaks the parser in undocumented ways
        raise ScenarioError(f"{complaint}: not a readable TIFF: {_one_line(error)}") from error
    pixel_m = terrain.resolution_m
    if _PIXEL_SCALE_TAG in tags:
        scale = tags[_PIXEL_SCALE_TAG]
        pixel_m = float(scale[0])
        if not (pixel_m > 0 and np.isclose(scale[0], scale[1], rtol=0.01)):
            raise ScenarioError(f"{complaint}: pixels of {scale[0]:g} x {scale[1]:g}; allowed are square ones")
    if _NO_DATA_TAG in tags:
        values = np.where(values == _number(tags[_NO_DATA_TAG]), np.nan, values)
    return values[::-1], pixel_m


def _number(text: str) -> float:
    """The value that marks a missing height; not-a-number, which equals nothing, if the tag makes no sense."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _read_npy(path: Path, terrain: Terrain, complaint: str) -> tuple[Any, float]:
    try:
        values = np.load(path, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise ScenarioError(f"{complaint}: not a readable NumPy array: {_one_line(error)}") from error
    return values, terrain.resolution_m


def _read_png(path: Path, terrain: Terrain, complaint: str) -> tuple[Any, float]:
    import cv2

    if terrain.height_range_m is None:
        raise ScenarioError(f"{complaint}: a picture needs terrain.height_range_m = [lowest, highest] as well")
    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if values is None:
        raise ScenarioError(f"{complaint}: not a readable PNG picture")
    low, high = terrain.height_range_m
    white = 255.0 if values.dtype == np.uint8 else 65535.0  # PNG holds 8 or 16 bits
    return low + (high - low) * values[::-1] / white, terrain.resolution_m


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _crop(field: HeightField, terrain: Terrain, complaint: str) -> HeightField:
    """The part of the field inside ``crop_m``, to whole cells."""
    if terrain.crop_m is None:
        return field
    x0, y0, x1, y1 = terrain.crop_m
    x, y = grid_points(field)
    slack = 0.5 * field.resolution_m
    if x0 < x[0] - slack or x1 > x[-1] + slack or y0 < y[0] - slack or y1 > y[-1] + slack:
        raise ScenarioError(
            f"{complaint}: terrain.crop_m = {list(terrain.crop_m)} reaches off the file; "
            f"allowed are x {x[0]:.2f} to {x[-1]:.2f} and y {y[0]:.2f} to {y[-1]:.2f}"
        )
    columns, rows = (x >= x0 - slack) & (x <= x1 + slack), (y >= y0 - slack) & (y <= y1 + slack)
    if columns.sum() < 5 or rows.sum() < 5:
        raise ScenarioError(f"{complaint}: terrain.crop_m = {list(terrain.crop_m)} leaves fewer than 5 x 5 heights")
    return HeightField(
        field.heights_m[np.ix_(rows, columns)], field.resolution_m, (float(x[columns][0]), float(y[rows][0]))
    )


def _resample(field: HeightField, terrain: Terrain, source: str) -> HeightField:
    """The field at ``resolution_m``, by the spline of ``resample``."""
    from scipy.interpolate import RectBivariateSpline

    x, y = grid_points(field)
    size = (float(x[-1] - x[0]), float(y[-1] - y[0]))
    check_cells(size, terrain.resolution_m, source)
    if np.isclose(field.resolution_m, terrain.resolution_m, rtol=1e-9):
        return field
    degree = 3 if terrain.resample == "bicubic" else 1
    spline = RectBivariateSpline(y, x, field.heights_m, kx=degree, ky=degree)
    # Whole cells inside the old grid, so that nothing is extrapolated; what is left over is shared by both edges.
    nx, ny = (int(np.floor(side / terrain.resolution_m + 1e-9)) for side in size)
    west = x[0] + (size[0] - nx * terrain.resolution_m) / 2
    south = y[0] + (size[1] - ny * terrain.resolution_m) / 2
    new_x = west + terrain.resolution_m * np.arange(nx + 1)
    new_y = south + terrain.resolution_m * np.arange(ny + 1)
    heights = spline(np.clip(new_y, y[0], y[-1]), np.clip(new_x, x[0], x[-1]))
    return HeightField(np.ascontiguousarray(heights), terrain.resolution_m, (float(west), float(south)))
