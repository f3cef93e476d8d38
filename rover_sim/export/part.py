"""What is exported: a world or a rectangle of it, its ground thinned to what other programs can hold.

With the ruts of a run the ground is made as fine as they are, as far as that is allowed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rover_sim.errors import InputError
from rover_sim.export.rut_surface import press_ruts
from rover_sim.sim.ruts import SavedRuts
from worlds.heightfield import grid_points, window
from worlds.types import FloatArray, HeightField, IntArray, TriangleMesh, World

Box = tuple[float, float, float, float]

MOST_GROUND_CELLS = 1_000_000  # of a ground mesh; finer ground is thinned
MOST_THINGS = 50_000  # about three million faces
LEAST_SAMPLES = 5


@dataclass(frozen=True, eq=False)
class Part:
    """A rectangle of a world with the rocks and cylinders whose middle lies in it."""

    world: World
    ground: HeightField
    which: IntArray  # places of its things in ``world.shapes``
    ruts: SavedRuts | None = None

    @cached_property
    def thinned(self) -> HeightField:
        """The ground with every n-th row and column, as many as a mesh may have; the same where that is all.

        With ruts it is finer where there is room.
        """
        if self.ruts is not None:
            return press_ruts(self.ground, self.ruts, MOST_GROUND_CELLS)
        stride = int(np.ceil(np.sqrt(self.ground.heights_m.size / MOST_GROUND_CELLS)))
        return HeightField(
            self.ground.heights_m[::stride, ::stride], self.ground.resolution_m * stride, self.ground.origin_m
        )

    @cached_property
    def ground_mesh(self) -> TriangleMesh:
        """Two triangles a cell, facing up, of the thinned ground."""
        x, y = grid_points(self.thinned)
        index = np.arange(self.thinned.heights_m.size, dtype=np.int32).reshape(self.thinned.heights_m.shape)
        a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
        faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2).reshape(-1, 3)
        points = np.stack([*np.meshgrid(x, y), self.thinned.heights_m], axis=-1).reshape(-1, 3)
        return TriangleMesh(points, faces, np.zeros(len(faces), dtype=np.int32))

    @cached_property
    def rocks(self) -> TriangleMesh:
        """Rocks and cylinders as the camera sees them; raises `InputError` where there are too many."""
        self._check()
        return self.world.shapes.picture(self.which)

    @cached_property
    def rocks_for_contact(self) -> TriangleMesh:
        """The same, coarser."""
        self._check()
        return self.world.shapes.collision(self.which)

    def _check(self) -> None:
        if len(self.which) > MOST_THINGS:
            text = f"there are {len(self.which)} rocks and cylinders, allowed are {MOST_THINGS}"
            raise InputError(f"--crop: {text}; choose a part of the map")

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not as in the world itself, one line each."""
        if self.ruts is not None:
            apart = f"ruts: in a ground mesh of one height every {self.thinned.resolution_m:g} m"
            finer = self.thinned.resolution_m > self.ruts.texel_m * 1.001
            return (apart + ("; --crop gives a smaller part as fine as they are" if finer else ""),)
        if self.thinned.resolution_m == self.ground.resolution_m:
            return ()
        text = (
            f"ground mesh: one height in {self.thinned.resolution_m / self.ground.resolution_m:.0f} along each side, "
            f"{self.thinned.resolution_m:g} m apart; --crop gives a smaller part in full"
        )
        return (text,)


def part_of(world: World, crop_m: Box | None, ruts: SavedRuts | None = None) -> Part:
    """The world, or the rectangle ``crop_m`` (x0, y0, x1, y1) of it to whole cells, with ``ruts`` or as it was built.

    Raises `InputError` for a rectangle that is no part of the map.
    """
    low, high = world.shapes.bounds_w
    centre = (low + high)[:, :2] / 2
    if crop_m is None:
        return Part(world, world.ground, np.arange(len(centre), dtype=np.int32), ruts)
    x0, y0, x1, y1 = crop_m
    (west, east), (south, north) = world.ground.x_limits_m, world.ground.y_limits_m
    if not (west <= x0 < x1 <= east and south <= y0 < y1 <= north):
        raise InputError(
            f"--crop {x0:g} {y0:g} {x1:g} {y1:g}: must be X0 Y0 X1 Y1, X0 < X1 within {west:.2f} to {east:.2f} "
            f"and Y0 < Y1 within {south:.2f} to {north:.2f}"
        )
    ground = window(world.ground, (x0, x1), (y0, y1))
    if min(ground.heights_m.shape) < LEAST_SAMPLES:
        raise InputError(
            f"--crop {x0:g} {y0:g} {x1:g} {y1:g}: holds fewer than {LEAST_SAMPLES} x {LEAST_SAMPLES} heights"
        )
    inside = ((centre >= (x0, y0)) & (centre <= (x1, y1))).all(axis=1)
    return Part(world, ground, np.flatnonzero(inside).astype(np.int32), ruts)


def y_up(points_m: FloatArray) -> FloatArray:
    """Points (N, 3) with y up, as glTF has it."""
    return points_m[:, [0, 2, 1]] * (1.0, 1.0, -1.0)
