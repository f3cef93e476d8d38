"""The elevation map that a route is planned over: the true ground as an orbiter would have measured it, or a file."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planner.denoise import denoised
from planner.fine_relief import under_belly
from planner.risk import Vehicle
from planner.route_cost import slope_costs
from planner.route_following import Following, begin
from planner.route_ground import ElevationMap
from planner.route_marks import LegModel
from rover_sim.errors import InputError
from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from rover_sim.risk_belief import risk_model
from worlds.dem_files import Raster, read_raster
from worlds.heightfield import height_at
from worlds.route_table import ORBITAL, RouteTable
from worlds.scenario import Terrain
from worlds.types import FloatArray, Footprint, HeightField, World

ORBIT_STREAM = 105  # of the seed
MOST_CELLS = 4_000_000
SQUARE = 0.01  # by which a pixel's sides may differ
Place = tuple[float, float]


@dataclass(frozen=True)
class _Wanted:
    """What a map must cover, by the key that says so."""

    key: str
    place: Place


def first_route(world: World, footprint: Footprint, vehicle: Vehicle | None = None) -> Following | None:
    """The route of a scenario before the drive, perhaps a refusal; None where it has no table ``[route]``.

    Raises InputError as `route_map` does. The soil is believed to be the scenario's main one. ``vehicle``: the rover
    of forecasts of its risk; None: there are none.
    """
    scenario = world.scenario
    table = scenario.route
    if table is None:
        return None
    measured = route_map(world, table, scenario.name)
    costs = slope_costs(scenario.soil.preset, footprint, scenario.rover.model)
    start, goal = scenario.rover.start_m, scenario.goal
    model = LegModel(length_m=table.leg_m, pass_m=table.radius_m)
    risk = None if vehicle is None else risk_model(scenario, measured, vehicle, world.seed)
    first = begin(denoised(measured), costs, start, goal.position_m, goal.radius_m, leg_model=model, risk_model=risk)
    return replace(first, lifted_m=under_belly(measured, footprint))


def route_map(world: World, table: RouteTable, source: str) -> ElevationMap:
    """The map of a scenario's table ``[route]`` as it was measured.

    Raises InputError, which begins with ``source``, for a file that cannot be used or does not cover start and goal.
    """
    if table.map == ORBITAL:
        return from_orbit(world, table)
    ground = _from_file(world, table, source)
    scenario = world.scenario
    for wanted in (
        _Wanted("rover.start_m", scenario.rover.start_m),
        _Wanted("goal.position_m", scenario.goal.position_m),
    ):
        _check_covers(ground.field, wanted, f'{source}: route.map = "{table.map}"')
    return ground


def from_orbit(world: World, table: RouteTable) -> ElevationMap:
    """Means of the true ground over squares of ``resolution_m``, rocks included, with white noise of ``error_m``."""
    mean = averaged(world, table.resolution_m)
    rng = np.random.default_rng([world.seed, ORBIT_STREAM])
    heights = mean.heights_m + rng.normal(0.0, table.error_m, mean.heights_m.shape)
    return ElevationMap.of(HeightField(heights, mean.resolution_m, mean.origin_m), table.error_m)


def averaged(world: World, cell_m: float) -> HeightField:
    """The true ground, with its rocks, as means over squares that lie wholly on the map."""
    field = world.ground
    (west, east), (south, north) = field.x_limits_m, field.y_limits_m
    nx, ny = (max(3, int(np.floor((high - low) / cell_m))) for low, high in ((west, east), (south, north)))
    parts = max(1, round(cell_m / field.resolution_m))
    fine = cell_m / parts * (np.arange(max(nx, ny) * parts) + 0.5)
    ground = height_at(field, west + fine[None, : nx * parts], south + fine[: ny * parts, None])
    heights = ground.reshape(ny, parts, nx, parts).mean(axis=(1, 3)) + _rocks(world, cell_m, (ny, nx))
    return HeightField(np.ascontiguousarray(heights), cell_m, (west + 0.5 * cell_m, south + 0.5 * cell_m))


def _rocks(world: World, cell_m: float, shape: tuple[int, int]) -> FloatArray:
    """How much the rocks raise the mean of each cell: a half ellipsoid's volume over its area, laid over its width."""
    raised = np.zeros(shape)
    if not len(world.rocks):
        return raised
    length, width, height = world.rocks.extents_m.T
    corner = np.array([world.ground.x_limits_m[0], world.ground.y_limits_m[0]])
    column, row = np.floor((world.rocks.position_w[:, :2] - corner) / cell_m).astype(np.int64).T
    inside = (row >= 0) & (column >= 0) & (row < shape[0]) & (column < shape[1])
    np.add.at(raised, (row[inside], column[inside]), (np.pi / 6.0 * length * width * height)[inside] / cell_m**2)
    return raised


def _from_file(world: World, table: RouteTable, source: str) -> ElevationMap:
    complaint = f'{source}: route.map = "{table.map}"'
    raster = read_raster(Terrain(kind="dem", path=table.map, resolution_m=table.resolution_m), complaint)
    across, along = raster.pixel_m
    if abs(across - along) > SQUARE * across:
        raise InputError(f"{complaint}: its pixels are {across:.3g} x {along:.3g} m; allowed are square ones")
    if raster.heights_m.size > MOST_CELLS:
        raise InputError(f"{complaint}: has {raster.heights_m.size} heights; allowed are {MOST_CELLS}")
    if not np.isfinite(raster.heights_m).any():
        raise InputError(f"{complaint}: all of its heights are missing")
    middle = _middle(world, table, raster, complaint)
    origin = middle[0] + float(raster.x_m[0]), middle[1] + float(raster.y_m[0])
    heights = np.where(np.isfinite(raster.heights_m), raster.heights_m, np.nan)
    return ElevationMap.of(HeightField(heights, across, origin), table.error_m)


def _middle(world: World, table: RouteTable, raster: Raster, complaint: str) -> Place:
    """World place of a file's middle: as the scenario says, else by its georeference, else the world's zero."""
    if table.middle_m is not None:
        return table.middle_m
    place = raster.georeference.place_deg
    if place is None:
        return 0.0, 0.0
    east, north, _ = LocalFrame(world.origin).to_world(GeoPoint(place[0], place[1], world.origin.altitude_m))
    reach = np.hypot(raster.x_m[-1] - raster.x_m[0], raster.y_m[-1] - raster.y_m[0])
    away = float(np.hypot(east, north))
    if away > reach + np.hypot(world.ground.x_limits_m[1], world.ground.y_limits_m[1]):
        raise InputError(
            f"{complaint}: its georeference puts its middle at {place[0]:.5f}, {place[1]:.5f} deg, {away / 1000.0:.1f} "
            "km from the scenario's [origin]; correct one of them, or say by route.middle_m where it lies"
        )
    return east, north


def _check_covers(field: HeightField, wanted: _Wanted, complaint: str) -> None:
    half = 0.5 * field.resolution_m
    (west, east), (south, north) = field.x_limits_m, field.y_limits_m
    x, y = wanted.place
    if west - half <= x <= east + half and south - half <= y <= north + half:
        return
    raise InputError(
        f"{complaint}: does not cover {wanted.key} = [{x:g}, {y:g}]; it covers x {west:.1f} to {east:.1f} and "
        f"y {south:.1f} to {north:.1f}"
    )
