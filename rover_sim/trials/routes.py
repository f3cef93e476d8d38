"""Traverses of 100 to 500 m over ground that no straight line crosses, planned over a map from orbit.

Ground of the suite: ``crater``, a bowl between start and goal that has to be gone round; ``dunes``, crests that are
crossed where their lee is flat enough; ``wall``, dunes too steep for any way; ``yard``, a real elevation map
(marsyard2022_hm.tif, about 50 x 50 m, so that goals are at most 30 m away). By name only, for forecasts of risk that
are neither 0 nor 1: ``swells``, short dunes near the limit of the rover, and ``hills``, rough in all directions.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rover_sim.errors import InputError
from rover_sim.trials.trial import Value
from worlds.route_table import RouteTable
from worlds.scenario import Goal, Rocks, RoverChoice, Scenario, SoilChoice, Terrain, check_scenario

GROUNDS = ("crater", "dunes", "wall")
STEEP = ("hills", "swells")
YARD, YARD_FILE, YARD_REACH_M = "yard", "marsyard2022_hm.tif", 15.0
DISTANCES_M = (100.0, 200.0, 500.0)
MARGIN_M = 30.0  # of ground beyond start and goal
SLOWEST_M_S = 0.1  # over the straight line: later is too late


def yard_file(worlds: Path) -> Path:
    """The real map in a folder; raises InputError where it is not."""
    path = worlds / YARD_FILE
    if not path.is_file():
        raise InputError(f"--worlds {worlds}: no {YARD_FILE} in it; give the folder of the real elevation map")
    return path


def route_scenario(cell: Mapping[str, Value], heading_rad: float, worlds: Path | None) -> Scenario:
    """The traverse of one cell (``ground``, ``distance_m``) in a direction; InputError for one that cannot be."""
    ground, distance_m = str(cell["ground"]), float(cell["distance_m"])
    ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
    half = 0.5 * distance_m * ahead
    if ground == YARD:
        if worlds is None:
            raise InputError(f"--cells ground={YARD}: needs --worlds, the folder that holds {YARD_FILE}")
        if distance_m > 2.0 * YARD_REACH_M:
            raise InputError(f"--cells distance_m={distance_m:g}: the real map allows up to {2 * YARD_REACH_M:g}")
        terrain = Terrain(kind="dem", path=str(yard_file(worlds)), resolution_m=0.1)
        route = RouteTable(resolution_m=0.5, error_m=0.05, leg_m=(4.0, 12.0), radius_m=1.5)
    elif ground in STEEP:
        terrain, route = _terrain(ground, distance_m, half), RouteTable(leg_m=(6.0, 12.0), radius_m=1.5)
    elif ground in GROUNDS:
        terrain, route = _terrain(ground, distance_m, half), RouteTable()
    else:
        raise InputError(f"--cells ground={ground}: allowed are {', '.join((*GROUNDS, *STEEP, YARD))}")
    (x, y), (goal_x, goal_y) = np.round(-half, 3).tolist(), np.round(half, 3).tolist()
    scenario = Scenario(
        name="route",
        terrain=terrain,
        rocks=Rocks(cfa=0.02, min_diameter_m=0.08),
        soil=SoilChoice(preset="mars_sand"),
        rover=RoverChoice(start_m=(x, y), heading_deg=round(float(np.degrees(heading_rad)), 3)),
        goal=Goal(position_m=(goal_x, goal_y), radius_m=1.0, time_limit_s=distance_m / SLOWEST_M_S),
        route=route,
    )
    check_scenario(scenario, "--cells")
    return scenario


def _terrain(ground: str, distance_m: float, half: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Terrain:
    """Synthetic ground about the middle between start and goal, with room to go round."""
    room = 0.35 * distance_m + MARGIN_M
    size = tuple(2.0 * max(abs(float(part)) + MARGIN_M, room) for part in half)
    shape = {
        "crater": {"kind": "crater", "feature_size_m": 0.35 * distance_m, "relief_m": 0.06 * distance_m},
        "dunes": {"kind": "dunes", "feature_size_m": 40.0, "relief_m": 1.8},
        "wall": {"kind": "dunes", "feature_size_m": 30.0, "relief_m": 4.0},
        "hills": {"kind": "fractal", "roughness_m": 0.2},
        "swells": {"kind": "dunes", "feature_size_m": 20.0, "relief_m": 1.7, "roughness_m": 0.08},
    }[ground]
    return Terrain(
        size_m=(round(size[0], 1), round(size[1], 1)),
        resolution_m=0.16 if distance_m <= 200.0 else 0.25,
        **{"roughness_m": 0.06, **shape},  # type: ignore[arg-type] # of the keys above
    )
