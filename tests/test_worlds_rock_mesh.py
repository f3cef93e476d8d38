from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from worlds.heightfield import height_at
from worlds.rock_mesh import (
    COLLISION_LEVELS,
    PICTURE_LEVELS,
    Detail,
    cylinder_meshes,
    join,
    rock_meshes,
)
from worlds.rock_shape import (
    PROFILES,
    base_extents,
    diameters_along,
    draw_aspects,
    draw_formations,
    draw_profiles,
    formation_of_axis,
    outlines,
    rock_shape,
)
from worlds.types import Cylinder, FloatArray, HeightField, Rock, RockShape, RockTable, TriangleMesh

SLOPE = HeightField(np.add.outer(np.arange(9) * 0.1, np.arange(9) * 0.3), 1.0, (-4.0, -4.0))


def rock(formation: int, diameter_m: float = 0.6, number: int = 1, yaw_rad: float = 0.4) -> Rock:
    length, width = base_extents(formation, diameter_m)
    base = (0.3, 0.1, float(height_at(SLOPE, 0.3, 0.1)))
    return Rock(number, base, length, width, width / 2, yaw_rad, rock_shape(formation))


def solid(mesh: TriangleMesh, owner: int) -> trimesh.Trimesh:
    part = trimesh.Trimesh(mesh.vertices_m, mesh.faces[mesh.owner == owner], process=False)
    part.remove_unreferenced_vertices()
    return part


def assert_closed(part: trimesh.Trimesh) -> None:
    assert part.is_watertight
    assert part.is_winding_consistent
    assert part.volume > 0
    assert part.euler_number == 2
    assert part.area_faces.min() > 1e-8


@pytest.mark.parametrize("formation", range(10))
@pytest.mark.parametrize("levels", [PICTURE_LEVELS, COLLISION_LEVELS])
@pytest.mark.parametrize("diameter_m", [0.08, 0.2, 0.4, 2.0])
def test_every_formation_is_closed_at_every_level(
    formation: int, levels: tuple[tuple[float, Detail], ...], diameter_m: float
) -> None:
    assert_closed(solid(rock_meshes(RockTable.of([rock(formation, diameter_m)]), SLOPE, levels), 1))


@given(seed=st.integers(0, 2**32))
def test_random_rocks_are_closed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    formations, yaws = draw_formations(6, tuple(range(10)), rng)
    aspects, profiles = draw_aspects(formations, rng), draw_profiles(formations, rng)
    rocks = []
    for index, formation in enumerate(formations):
        length, width = base_extents(int(formation), float(rng.uniform(0.08, 1.5)), float(aspects[index]))
        x, y = rng.uniform(-2.0, 2.0, 2)
        base = (float(x), float(y), float(height_at(SLOPE, x, y)))
        shape = RockShape(int(formation), tuple(profiles[index].tolist()))
        rocks.append(Rock(index + 1, base, length, width, width / 2, float(yaws[index]), shape))
    mesh = rock_meshes(RockTable.of(rocks), SLOPE, PICTURE_LEVELS)
    for item in rocks:
        assert_closed(solid(mesh, item.id))


def test_faces_grow_with_the_rock() -> None:
    counts = [
        len(rock_meshes(RockTable.of([rock(1, size)]), SLOPE, PICTURE_LEVELS).faces) for size in (0.1, 0.2, 0.4, 0.6)
    ]
    assert counts == [40, 76, 148, 308]
    assert counts == [detail.faces for _, detail in PICTURE_LEVELS]
    assert len(rock_meshes(RockTable.of([rock(1, 0.6)]), SLOPE, COLLISION_LEVELS).faces) == 76
    assert PICTURE_LEVELS[-1][1].sections == 8


@pytest.mark.parametrize("formation", range(10))
def test_extents_are_those_of_the_table(formation: int) -> None:
    item = rock(formation, 0.6, yaw_rad=0.0)
    vertices = rock_meshes(RockTable.of([item]), SLOPE, PICTURE_LEVELS).vertices_m - np.array(item.position_w)
    assert np.ptp(vertices[:, 0]) == pytest.approx(item.length_m)
    assert np.ptp(vertices[:, 1]) == pytest.approx(item.width_m)
    assert vertices[:, 2].max() == pytest.approx(item.height_m)


def test_the_base_lies_below_the_ground_all_around() -> None:
    mesh = rock_meshes(RockTable.of([rock(4)]), SLOPE, PICTURE_LEVELS)
    feet = mesh.vertices_m[mesh.vertices_m[:, 2] < mesh.vertices_m[:, 2].min() + 1e-9]
    assert np.all(feet[:, 2] < height_at(SLOPE, feet[:, 0], feet[:, 1]))


def test_the_yaw_turns_the_long_axis() -> None:
    vertices = rock_meshes(RockTable.of([rock(1, yaw_rad=np.radians(90.0))]), SLOPE, PICTURE_LEVELS).vertices_m
    assert np.ptp(vertices[:, 1]) > 1.5 * np.ptp(vertices[:, 0])


def test_a_rock_looks_the_same_whatever_lies_around_it() -> None:
    alone = rock_meshes(RockTable.of([rock(3, number=7)]), SLOPE, PICTURE_LEVELS)
    among = rock_meshes(RockTable.of([rock(2, 0.7, 1), rock(3, number=7), rock(5, 0.1, 9)]), SLOPE, PICTURE_LEVELS)
    first = np.flatnonzero(among.owner == 7)
    assert np.array_equal(among.vertices_m[among.faces[first]], alone.vertices_m[alone.faces])


def test_sections_are_semicircles_up_to_the_bumps() -> None:
    item = rock(0, 1.0, yaw_rad=0.0)
    vertices = rock_meshes(RockTable.of([item]), SLOPE, PICTURE_LEVELS).vertices_m - np.array(item.position_w)
    above = vertices[vertices[:, 2] > 0.05]
    assert np.linalg.norm(above, axis=1) == pytest.approx(0.5, rel=0.3)


def features(formation: int) -> FloatArray:
    """Of the outline seen from above, unit rock: cover, centroid and spread along the axis, waist."""
    item = rock(formation, 1.0, yaw_rad=0.0)
    base = outlines(
        np.array([item.shape.section_ratio]), np.array([item.length_m]), np.array([item.width_m]), np.zeros(1)
    )[0]
    x, y = base[:, 0], base[:, 1]
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = cross.sum() / 2
    centroid = ((x + np.roll(x, -1)) * cross).sum() / (6 * area)
    second = ((x**2 + x * np.roll(x, -1) + np.roll(x, -1) ** 2) * cross).sum() / (12 * area)
    waist = PROFILES[formation][4] / PROFILES[formation].max()
    return np.array([area, abs(centroid), np.sqrt(second), waist])


def test_the_formations_differ_measurably() -> None:
    measured = {formation: features(formation) for formation in range(10)}
    for one, other in combinations(measured, 2):
        # At least three hundredths of the unit rock in some measure.
        assert np.abs(measured[one] - measured[other]).max() > 0.03, (one, other)


def test_formations_are_the_twenty_degree_sectors_of_the_axis() -> None:
    assert [formation_of_axis(np.radians(angle)) for angle in (0, 19, 21, 90, 179, 181, -1)] == [1, 1, 2, 5, 9, 1, 9]
    formations, yaws = draw_formations(500, tuple(range(10)), np.random.default_rng(0))
    for formation, yaw in zip(formations, yaws, strict=True):
        assert formation in {0, formation_of_axis(float(yaw))}
    assert set(formations.tolist()) == set(range(10))
    only, _ = draw_formations(50, (4,), np.random.default_rng(0))
    assert set(only.tolist()) == {4}


def test_heights_are_a_quarter_to_half_the_diameter() -> None:
    rng = np.random.default_rng(0)
    formations, _ = draw_formations(1000, tuple(range(10)), rng)
    height_over_diameter = 0.5 / np.sqrt(draw_aspects(formations, rng))
    assert height_over_diameter.min() >= 0.25
    assert height_over_diameter.max() == 0.5
    assert np.all(height_over_diameter[formations == 0] == 0.5)


def test_the_hemispheres_diameters_follow_a_circle() -> None:
    places = np.array([-1.0, -0.6, 0.0, 0.33, 0.9, 1.0])
    assert diameters_along(PROFILES[:1], places)[0] == pytest.approx(np.sqrt(1 - places**2), abs=0.04)


def test_a_cylinder_is_closed_and_has_the_volume_of_its_prism() -> None:
    level = HeightField(np.zeros((3, 3)), 4.0, (-4.0, -4.0))
    mesh = cylinder_meshes([Cylinder(5, (0.0, 0.0, 0.0), 0.075, 1.0)], level, 24)
    part = solid(mesh, 5)
    assert_closed(part)
    # Area of a regular 24-gon; buried by a tenth of the radius.
    area = 12 * 0.075**2 * np.sin(2 * np.pi / 24)
    assert part.volume == pytest.approx(area * 1.0075)


def test_nothing_joins_to_an_empty_mesh() -> None:
    empty = join([rock_meshes(RockTable.of([]), SLOPE, PICTURE_LEVELS), cylinder_meshes([], SLOPE, 8)])
    assert (empty.vertices_m.shape, empty.faces.shape, empty.owner.shape) == ((0, 3), (0, 3), (0,))
    assert empty.faces.dtype == np.int32
    assert empty.owner.dtype == np.int32
