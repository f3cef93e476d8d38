"""Ground with the ruts of a run pressed into it, on a grid as fine as the ruts or as coarse as there is room for."""

from __future__ import annotations

from math import isqrt

import numpy as np

from rover_sim.errors import InputError
from rover_sim.sim.ruts import SavedRuts
from worlds.heightfield import height_at
from worlds.types import FloatArray, HeightField

_TEXELS = 4_000_000  # of ruts that are worked out at a time


def press_ruts(ground: HeightField, ruts: SavedRuts, most_cells: int) -> HeightField:
    """The heights less the depth of the ruts (piled-up soil rises), in at most about ``most_cells`` cells.

    The new samples lie on those of ``ground`` and divide its cells as finely as the texels of the ruts, or less so; if
    even its own cells are too many, every n-th sample is left. Each takes the mean depth of half a new cell around it.
    """
    step = _texels_a_cell(ground, ruts, most_cells)
    cell = step * ruts.texel_m
    sides = tuple(int(round((size - 1) * ground.resolution_m / cell, 9)) for size in ground.heights_m.shape)
    x = ground.origin_m[0] + cell * np.arange(sides[1] + 1)
    y = ground.origin_m[1] + cell * np.arange(sides[0] + 1)
    rows = max(1, _TEXELS // (len(x) * step**2))
    bands = [slice(first, min(first + rows, len(y))) for first in range(0, len(y), rows)]
    heights = [
        height_at(ground, x[None, :], y[band][:, None]) - _depths(ground, ruts, step, band, len(x)) for band in bands
    ]
    return HeightField(np.concatenate(heights), cell, ground.origin_m)


def _texels_a_cell(ground: HeightField, ruts: SavedRuts, most_cells: int) -> int:
    """Texels along a side of a new cell: a divisor of those of an old one, or a multiple."""
    per_cell = round(ground.resolution_m / ruts.texel_m)
    old_cells = (ground.heights_m.shape[0] - 1) * (ground.heights_m.shape[1] - 1)
    finest = isqrt(max(most_cells // old_cells, 0))  # parts of an old cell's side that there is room for
    if finest >= 1:
        return next(step for step in range(1, per_cell + 1) if per_cell % step == 0 and per_cell // step <= finest)
    return per_cell * int(np.ceil(np.sqrt(old_cells / most_cells)))


def _depths(ground: HeightField, ruts: SavedRuts, step: int, band: slice, columns: int) -> FloatArray:
    """Mean depth (m) around the samples of some rows of the new grid."""
    first_column, first_row = (
        round((here - there) / ruts.texel_m) for here, there in zip(ground.origin_m, ruts.origin_m, strict=True)
    )
    # A sample lies on a corner between texels; of an odd number around it the outermost ones count half.
    half, odd = divmod(step, 2)
    reach = half + odd
    weights = np.full(2 * reach, 1.0)
    weights[[0, -1]] = 0.5 if odd else 1.0
    weights /= weights.sum()
    rows = slice(first_row + band.start * step - reach, first_row + (band.stop - 1) * step + reach)
    span = slice(first_column - reach, first_column + (columns - 1) * step + reach)
    fine = ruts.window(rows, span).astype(np.float64)
    by_row = sum(w * fine[k::step][: band.stop - band.start] for k, w in enumerate(weights))
    return np.asarray(sum(w * by_row[:, k::step][:, :columns] for k, w in enumerate(weights)))


def check_ruts(ruts: SavedRuts, ground: HeightField, source: str) -> None:
    """Raise `InputError` where ruts were not driven into this ground."""
    per_cell = ground.resolution_m / ruts.texel_m
    same_place = np.allclose(ruts.origin_m, ground.origin_m, atol=1e-6)
    if not same_place or abs(per_cell - round(per_cell)) > 1e-6:
        raise InputError(
            f"{source}: ruts of {ruts.texel_m:g} m from {tuple(ruts.origin_m)} do not belong to the ground of the "
            f"scenario beside them, {ground.resolution_m:g} m from {tuple(ground.origin_m)}"
        )
