"""Small worlds for the tests of the physics: planes and a few obstacles, made by hand."""

from __future__ import annotations

from math import cos, radians, sin, tan

import numpy as np

from tests.prepared_shapes import NO_MESH, PreparedShapes
from worlds.geometry import quaternion_from_euler
from worlds.scenario import RoverChoice, Scenario, Sensors, SoilChoice
from worlds.soil import soil_preset
from worlds.types import FloatArray, HeightField, Pose, RockTable, TriangleMesh, World


def field(heights: FloatArray, resolution_m: float = 0.08) -> HeightField:
    rows, columns = heights.shape
    origin = (-0.5 * (columns - 1) * resolution_m, -0.5 * (rows - 1) * resolution_m)
    return HeightField(heights, resolution_m, origin)


def slope(slope_deg: float, size_m: float = 8.0, azimuth_deg: float = 0.0, resolution_m: float = 0.08) -> HeightField:
    """A plane that rises toward ``azimuth_deg``."""
    count = int(size_m / resolution_m) + 1
    axis = (np.arange(count) - (count - 1) / 2) * resolution_m
    rise = axis[None, :] * cos(radians(azimuth_deg)) + axis[:, None] * sin(radians(azimuth_deg))
    return field(rise * tan(radians(slope_deg)), resolution_m)


def box_mesh(low: tuple[float, float, float], high: tuple[float, float, float], owner: int = 1) -> TriangleMesh:
    (x0, y0, z0), (x1, y1, z1) = low, high
    corners = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]
    corners += [(x, y, z1) for x, y, _ in corners]
    faces = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4)]
    faces += [(1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)]
    return TriangleMesh(np.array(corners), np.array(faces, np.int32), np.full(12, owner, np.int32))


def make_world(
    ground: HeightField,
    soil: str = "firm",
    gravity: float = 9.81,
    *,
    mesh: TriangleMesh = NO_MESH,
    start: tuple[float, float] = (0.0, 0.0),
    heading_deg: float = 0.0,
    gnss: bool = True,
) -> World:
    scenario = Scenario(
        name="test",
        gravity_m_s2=gravity,
        soil=SoilChoice(preset=soil),
        rover=RoverChoice(start_m=start, heading_deg=heading_deg),
        sensors=Sensors(gnss=gnss),
    )
    pose = Pose(np.array([*start, 0.0]), quaternion_from_euler(0.0, 0.0, radians(heading_deg)))
    return World(
        scenario, 0, ground, RockTable.of(()), (), PreparedShapes(mesh), soil_preset(soil), pose, (5.0, 0.0, 0.0)
    )
