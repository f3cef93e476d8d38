"""Worlds and cameras made by hand for the tests of the camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tests.prepared_shapes import PreparedShapes
from worlds.geometry import camera_pose, quaternion_from_euler
from worlds.scenario import Camera, GroundTexture, Rocks, Scenario, Sun, Terrain
from worlds.soil import soil_preset
from worlds.types import (
    CameraModel,
    Cylinder,
    FloatArray,
    HeightField,
    Pose,
    Rock,
    RockShape,
    RockTable,
    TriangleMesh,
    World,
)

Surface = Callable[[FloatArray, FloatArray], FloatArray]


def flat(x: FloatArray, y: FloatArray) -> FloatArray:
    """Level ground."""
    return 0.0 * (x + y)


def field(size_m: float = 20.0, resolution_m: float = 0.1, surface: Surface = flat) -> HeightField:
    """A square of ground around the origin with z = surface(x, y)."""
    n = round(size_m / resolution_m) + 1
    axis = (np.arange(n) - (n - 1) / 2) * resolution_m
    x, y = np.meshgrid(axis, axis)
    return HeightField(surface(x, y), resolution_m, (float(axis[0]), float(axis[0])))


def dome(
    identity: int, x: float, y: float, radius: float, height: float, z: float = 0.0, rings: int = 5
) -> TriangleMesh:
    """Half an ellipsoid on the ground with a wall down to 0.1 m below it, closed; outward faces."""
    sides = 4 * rings
    angle = 2 * np.pi * np.arange(sides) / sides
    up = np.linspace(0.0, np.pi / 2, rings + 1)[:-1]
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    layers = [np.column_stack([radius * circle, np.full(sides, -0.1)])]
    layers += [np.column_stack([radius * np.cos(t) * circle, np.full(sides, height * np.sin(t))]) for t in up]
    points = np.concatenate([*layers, [[0.0, 0.0, height], [0.0, 0.0, -0.1]]]) + np.array([x, y, z])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    top, bottom = len(points) - 2, len(points) - 1
    faces = [np.column_stack([np.full(sides, bottom), j, i])]
    for k in range(len(layers) - 1):
        a, b = k * sides, (k + 1) * sides
        faces += [np.column_stack([a + i, a + j, b + j]), np.column_stack([a + i, b + j, b + i])]
    last = (len(layers) - 1) * sides
    faces += [np.column_stack([last + i, last + j, np.full(sides, top)])]
    face = np.concatenate(faces).astype(np.int32)
    return TriangleMesh(points, face, np.full(len(face), identity, dtype=np.int32))


def post(cylinder: Cylinder, sides: int = 48) -> TriangleMesh:
    """An upright cylinder, closed; outward faces."""
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = cylinder.radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    low, high = (np.column_stack([circle, np.full(sides, z)]) for z in (0.0, cylinder.height_m))
    points = np.concatenate([low, high, [[0, 0, 0.0], [0, 0, cylinder.height_m]]]) + np.array(cylinder.position_w)
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    walls = [np.column_stack([i, j, sides + j]), np.column_stack([i, sides + j, sides + i])]
    lids = [
        np.column_stack([j, i, np.full(sides, 2 * sides)]),
        np.column_stack([sides + i, sides + j, np.full(sides, 2 * sides + 1)]),
    ]
    face = np.concatenate(walls + lids).astype(np.int32)
    return TriangleMesh(points, face, np.full(len(face), cylinder.id, dtype=np.int32))


def merge(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Several meshes as one."""
    if not meshes:
        return TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32), np.zeros(0, dtype=np.int32))
    shift = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes])
    faces = np.concatenate([mesh.faces + s for mesh, s in zip(meshes, shift, strict=False)]).astype(np.int32)
    owner = np.concatenate([mesh.owner for mesh in meshes]).astype(np.int32)
    return TriangleMesh(np.concatenate([mesh.vertices_m for mesh in meshes]), faces, owner)


def world(
    ground: HeightField | None = None,
    rocks: Sequence[tuple[float, float, float, float]] = (),
    cylinders: Sequence[tuple[float, float, float, float]] = (),
    *,
    cfa: float = 0.0,
    sun: tuple[float, float] = (120.0, 40.0),
    seed: int = 1,
    texture: GroundTexture = "sand",
) -> World:
    """A world with domes at ``(x, y, radius, height)`` (ids from 1) and posts at the same (ids after them)."""
    ground = field() if ground is None else ground
    fine, coarse, listed = [], [], []
    for identity, (x, y, radius, height) in enumerate(rocks, start=1):
        z = height_near(ground, x, y)
        fine.append(dome(identity, x, y, radius, height, z, 6))
        coarse.append(dome(identity, x, y, radius, height, z, 3))
        listed.append(Rock(identity, (x, y, z), 2 * radius, 2 * radius, height, 0.0, RockShape(0, (1.0,) * 9)))
    posts = [
        Cylinder(identity, (x, y, height_near(ground, x, y)), radius, height)
        for identity, (x, y, radius, height) in enumerate(cylinders, start=len(rocks) + 1)
    ]
    walls = [post(cylinder) for cylinder in posts]
    scenario = Scenario(
        name="made-by-hand",
        terrain=Terrain(texture=texture),
        rocks=Rocks(cfa=cfa),
        sun=Sun(azimuth_deg=sun[0], elevation_deg=sun[1]),
    )
    start = Pose(np.array([0.0, 0.0, height_near(ground, 0.0, 0.0)]), np.array([0.0, 0.0, 0.0, 1.0]))
    return World(
        scenario,
        seed,
        ground,
        RockTable.of(listed),
        tuple(posts),
        PreparedShapes(merge(fine + walls), merge(coarse + walls)),
        soil_preset("firm"),
        start,
        (5.0, 0.0, 0.0),
    )


def height_near(ground: HeightField, x: float, y: float) -> float:
    """Height of the nearest sample."""
    column = round((x - ground.origin_m[0]) / ground.resolution_m)
    row = round((y - ground.origin_m[1]) / ground.resolution_m)
    return float(ground.heights_m[row, column])


def lens(width: int = 320, height: int = 240, pitch_deg: float = 25.0) -> CameraModel:
    """The scenario's camera at its usual angle of view."""
    focal = width / 2 / np.tan(np.radians(Camera().fov_deg) / 2)
    return CameraModel(width, height, float(focal), (0.0, 0.0, 0.0), float(np.radians(pitch_deg)))


def look(camera: CameraModel, x: float, y: float, z: float, yaw_deg: float = 0.0, roll_deg: float = 0.0) -> Pose:
    """Pose of the camera at a place, turned by ``yaw_deg`` from +x, pitched as the camera says."""
    body = Pose(
        np.array([x, y, z]), quaternion_from_euler(float(np.radians(roll_deg)), 0.0, float(np.radians(yaw_deg)))
    )
    return camera_pose(body, camera)
