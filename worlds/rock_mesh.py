"""Rocks and cylinders as closed triangle meshes.

A rock is lofted through parallel semicircular sections across its principal axis (the 2004 paper, section 4) that
stand on the ground as given by `rock_shape`; tips close to a point, walls carry the outline down below grade to a flat
underside, so that no gap shows on a slope. Eight sections make the finest level; smaller rocks take fewer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from worlds.heightfield import height_at
from worlds.rock_shape import diameters_along
from worlds.types import BoolArray, Cylinder, FloatArray, HeightField, IntArray, RockTable, TriangleMesh

BUMP_SHARE = 0.30  # largest deviation of the surface from the loft, as a share of the local radius
BURIAL_SHARE = 0.10  # of the height, below the lowest ground along the outline
_WAVES = 4
_HASH = np.random.default_rng(2004).uniform(-1e3, 1e3, size=(4 * _WAVES, 12))  # a constant table


@dataclass(frozen=True)
class Detail:
    """Sections along a rock and edges of each section's arc."""

    sections: int
    arc_edges: int

    @property
    def faces(self) -> int:
        """Triangles of one rock."""
        return 2 * (self.sections - 1) * (self.arc_edges + 3) + 2 * (self.arc_edges + 5)


Levels = tuple[tuple[float, Detail], ...]  # (up to this diameter in m, detail), ascending

PICTURE_LEVELS: Levels = ((0.12, Detail(3, 3)), (0.25, Detail(4, 6)), (0.5, Detail(6, 9)), (np.inf, Detail(8, 16)))
COLLISION_LEVELS: Levels = ((0.15, Detail(3, 3)), (np.inf, Detail(4, 6)))


def rock_meshes(rocks: RockTable, ground: HeightField, levels: Levels) -> TriangleMesh:
    """All ``rocks`` in one mesh, each as fine as the first level that its diameter fits.

    A pure function of each rock: it looks the same whatever lies around it, and its levels share their bumps.
    """
    level = level_of(rocks.diameters_m, levels)
    parts = [
        _rocks_of_level(rocks.chosen(level == number), ground, detail)
        for number, (_, detail) in enumerate(levels)
        if (level == number).any()
    ]
    return join(parts)


def level_of(diameters_m: FloatArray, levels: Levels) -> NDArray[np.intp]:
    """Number (N,) of the first level that each diameter fits."""
    return np.searchsorted([limit for limit, _ in levels], diameters_m, side="right")


def cylinder_meshes(cylinders: Sequence[Cylinder], ground: HeightField, sides: int) -> TriangleMesh:
    """All ``cylinders`` in one mesh of upright prisms, their feet buried."""
    return join([_cylinder(cylinder, ground, sides) for cylinder in cylinders])


def join(parts: Sequence[TriangleMesh]) -> TriangleMesh:
    """One mesh of several."""
    offsets = np.cumsum([0, *(len(part.vertices_m) for part in parts)])
    return TriangleMesh(
        np.concatenate([np.zeros((0, 3)), *(part.vertices_m for part in parts)]),
        np.concatenate(
            [np.zeros((0, 3), np.int32), *(part.faces + shift for part, shift in zip(parts, offsets, strict=False))]
        ).astype(np.int32),
        np.concatenate([np.zeros(0, np.int32), *(part.owner for part in parts)]).astype(np.int32),
    )


def _rocks_of_level(rocks: RockTable, ground: HeightField, detail: Detail) -> TriangleMesh:
    """Rocks of one level of detail, stood on the ground and turned to their yaw."""
    extents = rocks.extents_m
    local, is_foot = _loft(rocks.section_ratio, detail, _waves_of(rocks))
    # Stretched to the extents exactly: bumps do not make a rock longer, wider or higher than the table says.
    low, high = local.min(axis=1, keepdims=True), local.max(axis=1, keepdims=True)
    middle = (low + high) / 2.0
    local[..., :2] = ((local - middle) / (high - low))[..., :2] * extents[:, None, :2]
    local[..., 2] = local[..., 2] / high[..., 2] * extents[:, 2:]
    yaw = rocks.yaw_rad[:, None]
    base = rocks.position_w[:, None, :]
    world = np.empty_like(local)
    world[..., 0] = base[..., 0] + np.cos(yaw) * local[..., 0] - np.sin(yaw) * local[..., 1]
    world[..., 1] = base[..., 1] + np.sin(yaw) * local[..., 0] + np.cos(yaw) * local[..., 1]
    world[..., 2] = base[..., 2] + local[..., 2]
    lowest_ground = height_at(ground, world[..., 0], world[..., 1]).min(axis=1)
    bottom = np.minimum(lowest_ground, base[:, 0, 2]) - BURIAL_SHARE * extents[:, 2]
    world[:, is_foot, 2] = bottom[:, None]
    faces = _loft_faces(detail)
    shift = (np.arange(len(rocks), dtype=np.int32) * world.shape[1])[:, None, None]
    owner = np.repeat(rocks.ids, len(faces))
    return TriangleMesh(world.reshape(-1, 3), (faces[None] + shift).reshape(-1, 3).astype(np.int32), owner)


def _waves_of(rocks: RockTable) -> FloatArray:
    """Numbers (N, waves, 4) in -1..1 that look random, hashed from each rock's own measures."""
    own = np.column_stack([rocks.section_ratio, rocks.extents_m[:, :2], rocks.yaw_rad])
    mixed = (own[:, None, :] * _HASH).sum(axis=2)
    return np.asarray(2.0 * np.mod(mixed, 1.0) - 1.0).reshape(len(rocks), _WAVES, 4)


def _loft(profiles: FloatArray, detail: Detail, bumps: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Unit rocks (N, V, 3), x in -1..1, feet at z = 0 still, and which vertices are feet.

    Vertex order: for each section its loop (right foot, arc from right to left, left foot), then the four of the tips.
    """
    count, arc = len(profiles), detail.arc_edges
    # Closer together towards the tips, where the outline bends most.
    places = -np.cos(np.pi * (np.arange(detail.sections) + 0.5) / detail.sections)
    angles = np.linspace(0.0, np.pi, arc + 1)
    loop_angle = np.concatenate([[0.0], angles, [np.pi]])
    radius = diameters_along(profiles, places)[:, :, None] * _bump(bumps, places, loop_angle)
    sections = np.empty((count, detail.sections, arc + 3, 3))
    sections[..., 0] = places[None, :, None]
    sections[..., 1] = -radius * np.cos(loop_angle)
    sections[..., 2] = radius * np.sin(loop_angle)
    sections[..., [0, 1, -2, -1], 2] = 0.0
    tips = np.zeros((count, 4, 3))
    tips[:, :2, 0], tips[:, 2:, 0] = -1.0, 1.0
    is_foot = np.zeros((detail.sections, arc + 3), dtype=bool)
    is_foot[:, [0, -1]] = True
    return (
        np.concatenate([sections.reshape(count, -1, 3), tips], axis=1),
        np.concatenate([is_foot.ravel(), [False, True, False, True]]),
    )


def _bump(bumps: FloatArray, places: FloatArray, angles: FloatArray) -> FloatArray:
    """Radius factor (N, sections, loop) of a few seeded waves over the surface, within 1 +- BUMP_SHARE."""
    along, around, phase, weight = (bumps[:, :, index, None, None] for index in range(4))
    waves = np.sin(
        5.0 * along * places[None, None, :, None] + 4.0 * around * angles[None, None, None, :] + np.pi * phase
    )
    return np.asarray(1.0 + BUMP_SHARE / _WAVES * (weight * waves).sum(axis=1))


def _loft_faces(detail: Detail) -> IntArray:
    """Faces (F, 3) of one rock, counter-clockwise seen from outside."""
    loop = detail.arc_edges + 3
    near = np.arange(loop, dtype=np.int32)
    after = np.roll(near, -1)
    faces: list[IntArray] = []
    for section in range(detail.sections - 1):
        here, there = section * loop, (section + 1) * loop
        faces.append(np.stack([here + near, there + near, there + after], axis=1))
        faces.append(np.stack([here + near, there + after, here + after], axis=1))
    first, last = detail.sections * loop, detail.sections * loop + 2
    ring = (detail.sections - 1) * loop
    faces.append(_tip_faces(near, after, first)[:, ::-1])
    faces.append(_tip_faces(ring + near, ring + after, last))
    return np.concatenate(faces)


def _tip_faces(near: IntArray, after: IntArray, top: int) -> IntArray:
    """Faces between a section's loop and a tip: its vertex ``top`` at grade and ``top + 1`` below."""
    arc = [[a, top, b] for a, b in zip(near[1:-2], after[1:-2], strict=True)]
    right_foot, right, left, left_foot = near[0], near[1], near[-2], near[-1]
    walls = [
        [right_foot, top, right],
        [right_foot, top + 1, top],
        [left, top, left_foot],
        [top, top + 1, left_foot],
        [left_foot, top + 1, right_foot],
    ]
    return np.array([*arc, *walls], dtype=np.int32)


def _cylinder(cylinder: Cylinder, ground: HeightField, sides: int) -> TriangleMesh:
    angle = 2.0 * np.pi * np.arange(sides) / sides
    x = cylinder.position_w[0] + cylinder.radius_m * np.cos(angle)
    y = cylinder.position_w[1] + cylinder.radius_m * np.sin(angle)
    foot = cylinder.position_w[2]
    bottom = min(float(height_at(ground, x, y).min()), foot) - BURIAL_SHARE * cylinder.radius_m
    rings = [np.stack([x, y, np.full(sides, z)], axis=1) for z in (bottom, foot + cylinder.height_m)]
    ends = np.array([[*cylinder.position_w[:2], bottom], [*cylinder.position_w[:2], foot + cylinder.height_m]])
    near = np.arange(sides)
    after = np.roll(near, -1)
    faces = np.concatenate(
        [
            np.stack([near, after, sides + after], axis=1),
            np.stack([near, sides + after, sides + near], axis=1),
            np.stack([np.full(sides, 2 * sides), after, near], axis=1),
            np.stack([np.full(sides, 2 * sides + 1), sides + near, sides + after], axis=1),
        ]
    )
    owner = np.full(len(faces), cylinder.id, dtype=np.int32)
    return TriangleMesh(np.concatenate([*rings, ends]), faces.astype(np.int32), owner)
