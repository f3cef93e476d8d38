"""The rocks and cylinders of a built world as meshes, each made when it is asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from worlds.rock_mesh import (
    BURIAL_SHARE,
    COLLISION_LEVELS,
    PICTURE_LEVELS,
    Levels,
    cylinder_meshes,
    join,
    level_of,
    rock_meshes,
)
from worlds.types import Cylinder, FloatArray, HeightField, IntArray, RockTable, TriangleMesh

NO_ROCKS = RockTable.of(())
PICTURE_SIDES, COLLISION_SIDES = 24, 12  # of a cylinder


class SolidShapes:
    """Rocks, then cylinders, on a ground; what `Shapes` asks for."""

    def __init__(self, rocks: RockTable, cylinders: Sequence[Cylinder], ground: HeightField) -> None:
        self._rocks, self._cylinders, self._ground = rocks, tuple(cylinders), ground
        self.ids: IntArray = np.concatenate([rocks.ids, [item.id for item in cylinders]]).astype(np.int32)
        boxes = (_rock_boxes(rocks), _cylinder_boxes(self._cylinders))
        self.bounds_w: tuple[FloatArray, FloatArray] = (
            np.concatenate([low for low, _ in boxes]),
            np.concatenate([high for _, high in boxes]),
        )

    def picture(self, which: IntArray) -> TriangleMesh:
        """The things at the places ``which`` (K,) as the camera sees them."""
        return self._mesh(which, PICTURE_LEVELS, PICTURE_SIDES)

    def collision(self, which: IntArray) -> TriangleMesh:
        """The same, coarser."""
        return self._mesh(which, COLLISION_LEVELS, COLLISION_SIDES)

    def face_counts(self) -> tuple[int, int]:
        """How many faces all pictures would have, and all collision meshes."""
        diameters, cylinders = self._rocks.diameters_m, len(self._cylinders)
        return (
            _faces(diameters, PICTURE_LEVELS) + 4 * PICTURE_SIDES * cylinders,
            _faces(diameters, COLLISION_LEVELS) + 4 * COLLISION_SIDES * cylinders,
        )

    def _mesh(self, which: IntArray, levels: Levels, sides: int) -> TriangleMesh:
        is_rock = which < len(self._rocks)
        cylinders = [self._cylinders[place - len(self._rocks)] for place in which[~is_rock].tolist()]
        return join(
            [
                rock_meshes(self._rocks.chosen(which[is_rock]), self._ground, levels),
                cylinder_meshes(cylinders, self._ground, sides),
            ]
        )


def _faces(diameters_m: FloatArray, levels: Levels) -> int:
    counts = np.bincount(level_of(diameters_m, levels), minlength=len(levels))
    return int(counts @ np.array([detail.faces for _, detail in levels]))


def _rock_boxes(rocks: RockTable) -> tuple[FloatArray, FloatArray]:
    """Boxes around the ellipses of the bases, from a little below the ground to the tops."""
    length, width, height = rocks.extents_m.T
    cos, sin = np.cos(rocks.yaw_rad), np.sin(rocks.yaw_rad)
    half_x, half_y = np.hypot(length * cos, width * sin) / 2.0, np.hypot(length * sin, width * cos) / 2.0
    low = rocks.position_w - np.column_stack([half_x, half_y, BURIAL_SHARE * height])
    return low, rocks.position_w + np.column_stack([half_x, half_y, height])


def _cylinder_boxes(cylinders: Sequence[Cylinder]) -> tuple[FloatArray, FloatArray]:
    foot = np.array([item.position_w for item in cylinders]).reshape(-1, 3)
    size = np.array([(item.radius_m, item.height_m) for item in cylinders]).reshape(-1, 2)
    return foot - size[:, [0, 0, 0]] * (1.0, 1.0, BURIAL_SHARE), foot + size[:, [0, 0, 1]]
