"""Which soil lies where: patches of a scenario laid over its main soil, cell by cell."""

from __future__ import annotations

import numpy as np

from worlds.errors import ScenarioError
from worlds.heightfield import grid_points
from worlds.scenario import Scenario, SoilPatch
from worlds.soil import Soil
from worlds.soil_file import load_soil
from worlds.types import BoolArray, HeightField, SoilMap


def lay_soils(scenario: Scenario, ground: HeightField, source: str) -> SoilMap | None:
    """The soils of a scenario on the grid of its ground, later patches over earlier ones; None where there is one soil.

    Raises `ScenarioError` for a patch that covers no sample of the grid.
    """
    if not scenario.soil.patch:
        return None
    soils: list[Soil] = [load_soil(scenario.soil.preset)]
    index = np.zeros(ground.heights_m.shape, dtype=np.uint8)
    for number, patch in enumerate(scenario.soil.patch):
        inside = _inside(patch, ground)
        if not inside.any():
            raise ScenarioError(
                f"{source}: soil.patch[{number}].position_m = {list(patch.position_m)}: the patch covers no point of "
                f"the map; allowed are x {ground.x_limits_m[0]:g} to {ground.x_limits_m[1]:g} "
                f"and y {ground.y_limits_m[0]:g} to {ground.y_limits_m[1]:g}"
            )
        soil = load_soil(patch.preset)
        if soil not in soils:
            soils.append(soil)
        index[inside] = soils.index(soil)
    return SoilMap(tuple(soils), index)


def _inside(patch: SoilPatch, ground: HeightField) -> BoolArray:
    """Which samples (ny, nx) of the grid a patch covers."""
    x, y = grid_points(ground)
    dx, dy = x[None, :] - patch.position_m[0], y[:, None] - patch.position_m[1]
    if patch.kind == "disc":
        return np.asarray(np.hypot(dx, dy) <= (patch.radius_m or 0.0))
    length, width = patch.size_m or (0.0, 0.0)
    cos, sin = np.cos(np.radians(patch.yaw_deg)), np.sin(np.radians(patch.yaw_deg))
    along, across = cos * dx + sin * dy, cos * dy - sin * dx
    return np.asarray((np.abs(along) <= length / 2) & (np.abs(across) <= width / 2))
