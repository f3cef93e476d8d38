"""Elevation files as they are: GeoTIFF, NumPy arrays and grey pictures."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from worlds.errors import ScenarioError
from worlds.georeference import Georeference, read_georeference
from worlds.scenario import Terrain
from worlds.types import FloatArray

_NO_DATA_TAG = 42113  # GDAL_NODATA

# What tifffile logs of a damaged file is in our error; without a handler it would be printed a second time.
logging.getLogger("tifffile").addHandler(logging.NullHandler())


@dataclass(frozen=True, eq=False)
class Raster:
    """Heights over a grid whose cells need not be square."""

    heights_m: FloatArray  # (ny, nx), the southernmost row first; NaN where missing
    x_m: FloatArray  # (nx,) east of the middle of the file
    y_m: FloatArray  # (ny,) north of it
    georeference: Georeference

    @property
    def pixel_m(self) -> tuple[float, float]:
        """Distance of columns and of rows."""
        (nx, ny) = len(self.x_m) - 1, len(self.y_m) - 1
        return float(self.x_m[-1] - self.x_m[0]) / nx, float(self.y_m[-1] - self.y_m[0]) / ny


def read_raster(terrain: Terrain, complaint: str) -> Raster:
    """The file ``terrain.path``; raises `ScenarioError`, beginning with ``complaint``, if it cannot be used."""
    path = Path(terrain.path or "")
    readers = {".tif": _read_tiff, ".tiff": _read_tiff, ".npy": _read_npy, ".png": _read_png}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise ScenarioError(f"{complaint}: unknown kind of file; allowed are .tif, .npy and .png")
    if not path.is_file():
        raise ScenarioError(f"{complaint}: no such file")
    values, georeference = reader(path, terrain, complaint)
    if values.ndim != 2:
        raise ScenarioError(f"{complaint}: has shape {values.shape}; allowed is one height a cell, two dimensions")
    if values.dtype.kind not in "iuf":
        raise ScenarioError(f"{complaint}: holds values of type {values.dtype}; allowed are real numbers")
    ny, nx = values.shape
    if min(ny, nx) < 5:
        raise ScenarioError(f"{complaint}: only {nx} x {ny} heights; at least 5 x 5 are needed")
    pixel_m = georeference.pixel_m or (terrain.resolution_m, terrain.resolution_m)
    x, y = (step * (np.arange(size) - (size - 1) / 2) for step, size in zip(pixel_m, (nx, ny), strict=True))
    return Raster(np.ascontiguousarray(values, dtype=np.float64), x, y, georeference)


def _read_tiff(path: Path, terrain: Terrain, complaint: str) -> tuple[Any, Georeference]:
    import tifffile

    del terrain
    try:
        with tifffile.TiffFile(path) as file:
            values = file.pages[0].asarray()
            tags = {tag.code: tag.value for tag in file.pages.first.tags}
    except Exception as error:  # a damaged file breaks the parser in undocumented ways
        raise ScenarioError(f"{complaint}: not a readable TIFF: {_one_line(error)}") from error
    try:
        georeference = read_georeference(tags, values.shape[:2])
    except ScenarioError as error:
        raise ScenarioError(f"{complaint}: {error}") from error
    if _NO_DATA_TAG in tags:
        values = np.where(values == _marker(tags[_NO_DATA_TAG], values.dtype), np.nan, values)
    return values[::-1], georeference


def _marker(text: str, kind: np.dtype[Any]) -> Any:
    """The value that marks a missing height; not-a-number, which equals nothing, if the tag makes no sense."""
    try:
        number = float(text)
    except ValueError:
        return np.nan
    # The tag may have more digits than a height of single precision.
    with np.errstate(over="ignore"):
        return kind.type(number) if kind.kind == "f" else number


def _read_npy(path: Path, terrain: Terrain, complaint: str) -> tuple[Any, Georeference]:
    del terrain
    try:
        values = np.load(path, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise ScenarioError(f"{complaint}: not a readable NumPy array: {_one_line(error)}") from error
    return values, Georeference()


def _read_png(path: Path, terrain: Terrain, complaint: str) -> tuple[Any, Georeference]:
    import cv2

    if terrain.height_range_m is None:
        raise ScenarioError(f"{complaint}: a picture needs terrain.height_range_m = [lowest, highest] as well")
    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if values is None:
        raise ScenarioError(f"{complaint}: not a readable PNG picture")
    low, high = terrain.height_range_m
    white = 255.0 if values.dtype == np.uint8 else 65535.0  # PNG holds 8 or 16 bits
    return low + (high - low) * values[::-1] / white, Georeference()


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
