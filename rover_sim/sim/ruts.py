"""Ruts: a fine map of how deep wheels have pressed the ground, in tiles that exist only where a wheel was.

The natural ground stays as it is; what is held here is the depth below it, negative where soil was piled up. The
compiled step writes (`soil_kernels.press_rut`); renderer, report and export read.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rover_sim.files import atomic_path
from rover_sim.sim.rut_kernels import TILE_TEXELS, Ruts
from rover_sim.sim.rut_shading import Marks
from worlds.types import ByteArray, FloatArray, HeightField, IntArray

TEXEL_M = 0.02  # at most
_FIRST_TILES = 64
_SPARE_TILES = 32  # more than all wheels can take into use in one step


@dataclass(frozen=True, eq=False)
class SavedRuts:
    """The ruts of a run: tile k begins at row and column 64 ``tile[k]`` of the texels."""

    depth_m: NDArray[np.float32]  # (T, 64, 64) below the natural ground, negative where soil was piled up
    tile: IntArray  # (T, 2) row and column of the tile
    texel_m: float
    origin_m: tuple[float, float]  # corner of the first texel

    def window(self, rows: slice, columns: slice) -> NDArray[np.float32]:
        """Depths (m) of a range of texels, zero where there is no tile."""
        return _window(self.depth_m, self.tile, rows, columns)

    def save(self, path: Path) -> None:
        """Write a compressed npz with an array for each field, atomically."""
        with atomic_path(path) as temporary:
            np.savez_compressed(
                temporary,
                depth_m=self.depth_m,
                tile=self.tile,
                texel_m=np.float64(self.texel_m),
                origin_m=np.array(self.origin_m),
            )


def _window(depth_m: NDArray[np.float32], places: IntArray, rows: slice, columns: slice) -> NDArray[np.float32]:
    """Texels of tiles (T, 64, 64) at ``places`` (T, 2) that lie in a range."""
    out = np.zeros((rows.stop - rows.start, columns.stop - columns.start), dtype=np.float32)
    for tile, (row, column) in zip(depth_m, places, strict=True):
        v, u = row * TILE_TEXELS - rows.start, column * TILE_TEXELS - columns.start
        v0, u0 = max(v, 0), max(u, 0)
        v1, u1 = min(v + TILE_TEXELS, out.shape[0]), min(u + TILE_TEXELS, out.shape[1])
        if v0 < v1 and u0 < u1:
            out[v0:v1, u0:u1] = tile[v0 - v : v1 - v, u0 - u : u1 - u]
    return out


def load_ruts(path: Path) -> SavedRuts:
    """Read what `SavedRuts.save` wrote."""
    with np.load(path) as data:
        x0, y0 = data["origin_m"]
        return SavedRuts(data["depth_m"], data["tile"], float(data["texel_m"]), (float(x0), float(y0)))


class RutField:
    """Depths of ruts over one height field; cells of the field have a whole number of texels a side."""

    def __init__(self, ground: HeightField) -> None:
        self.per_cell = ceil(ground.resolution_m / TEXEL_M - 1e-9)
        self.texel_m = ground.resolution_m / self.per_cell
        self.origin_m = ground.origin_m
        self._shape = ground.heights_m.shape
        rows, columns = (ceil((size - 1) * self.per_cell / TILE_TEXELS) for size in self._shape)
        self.directory: IntArray = np.full((rows, columns), -1, dtype=np.int32)
        self.depth_m: NDArray[np.float32] = np.zeros((_FIRST_TILES, TILE_TEXELS, TILE_TEXELS), dtype=np.float32)
        self._changed: ByteArray = np.zeros(_FIRST_TILES, dtype=np.uint8)
        self._used: IntArray = np.zeros(1, dtype=np.int32)
        self.view = self._make_view()

    @property
    def count(self) -> int:
        """Tiles in use."""
        return int(self._used[0])

    def reserve(self) -> None:
        """Make room for the tiles of the next step."""
        if self._used[0] + _SPARE_TILES <= len(self.depth_m):
            return
        self.depth_m = np.concatenate([self.depth_m, np.zeros_like(self.depth_m)])
        self._changed = np.concatenate([self._changed, np.zeros_like(self._changed)])
        self.view = self._make_view()

    def take_changes(self) -> IntArray:
        """Places (T, 2) in the directory, row and column, of the tiles that changed since the last call."""
        places = self.places()
        changed = self._changed[self.directory[places[:, 0], places[:, 1]]] > 0
        self._changed[:] = 0
        return places[changed]

    def places(self) -> IntArray:
        """Places (T, 2) of all tiles in use, in the order in which they were taken."""
        found = np.argwhere(self.directory >= 0)
        return np.asarray(found[np.argsort(self.directory[found[:, 0], found[:, 1]])], dtype=np.int32)

    def window(self, rows: slice, columns: slice) -> NDArray[np.float32]:
        """Depths (m) of a range of texels, zero where there is no tile."""
        places = self.places()
        return _window(self.depth_m[self.directory[places[:, 0], places[:, 1]]], places, rows, columns)

    def samples(self, rows: slice, columns: slice) -> FloatArray:
        """Mean depth (m) around each sample of a range of the height field's grid, half a cell to every side."""
        n, half = self.per_cell, self.per_cell // 2
        low = (rows.start * n - half, columns.start * n - half)
        size = (rows.stop - rows.start, columns.stop - columns.start)
        fine = self.window(slice(low[0], low[0] + size[0] * n), slice(low[1], low[1] + size[1] * n))
        return np.asarray(fine.reshape(size[0], n, size[1], n).mean(axis=(1, 3)), dtype=np.float64)

    def cells(self, place: IntArray) -> tuple[slice, slice]:
        """Rows and columns of the height field's samples that the tile at a place of the directory touches."""
        spans = []
        for index, size in zip(place, self._shape, strict=True):
            first = int(index) * TILE_TEXELS // self.per_cell
            last = ((int(index) + 1) * TILE_TEXELS + self.per_cell // 2) // self.per_cell + 1
            spans.append(slice(first, min(last, size)))
        return spans[0], spans[1]

    def copy(self) -> SavedRuts:
        """The ruts as they are now."""
        return SavedRuts(self.depth_m[: self.count].copy(), self.places(), self.texel_m, self.origin_m)

    @property
    def marks(self) -> Marks:
        """What the renderer takes: the arrays themselves, so that it always sees the ruts of now."""
        return Marks(self.directory, self.depth_m, float(self.origin_m[0]), float(self.origin_m[1]), 1.0 / self.texel_m)

    def _make_view(self) -> Ruts:
        x0, y0 = self.origin_m
        return (self.directory, self.depth_m, self._changed, self._used, float(x0), float(y0), 1.0 / self.texel_m)


def no_marks() -> Marks:
    """What the renderer takes where there are no ruts."""
    return Marks(np.zeros((0, 0), dtype=np.int32), np.zeros((0, 1, 1), dtype=np.float32), 0.0, 0.0, 1.0)


def no_ruts() -> Ruts:
    """What the compiled step gets where the ground does not deform."""
    empty = np.zeros((0, 0), dtype=np.int32)
    return (empty, np.zeros((0, 1, 1), np.float32), np.zeros(0, np.uint8), np.zeros(1, np.int32), 0.0, 0.0, 1.0)
