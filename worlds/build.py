"""Scenario and seed to a world: the one place where terrain, rocks, meshes and soil come together."""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path

import numpy as np
from msgspec import structs

from worlds.dem import Elevation, load_dem
from worlds.errors import ScenarioError
from worlds.geometry import quaternion_from_euler
from worlds.heightfield import contains, height_at
from worlds.rock_field import MESH_MIN_DIAMETER_M, RockField, draw_rock_field, imprint, rocks_of, thin
from worlds.rock_shape import base_extents, rock_shape
from worlds.rock_sizes import expected_number
from worlds.scenario import DEFAULT_ORIGIN, MAP_MARGIN_M, Obstacle, Scenario, check_scenario, resolve_paths
from worlds.shapes import SolidShapes
from worlds.soil_file import load_soil
from worlds.soil_map import lay_soils
from worlds.synthesis import synthesise
from worlds.types import Cylinder, FloatArray, HeightField, Pose, Rock, RockShape, RockTable, World

MAX_ROCKS = 1_500_000  # placement stays within seconds and some hundred megabytes


class Stream(IntEnum):
    """Separate randomness per purpose: other rocks leave the terrain as it is, and the reverse."""

    TERRAIN = 1
    ROCK_SIZES = 2
    ROCK_PLACES = 3
    ROCK_SHAPES = 4


def build_world(scenario: Scenario, seed: int, *, base_dir: Path | None = None, source: str | None = None) -> World:
    """The world of a scenario and a seed; the same two give the same arrays to the bit.

    ``base_dir`` is where a relative ``terrain.path`` starts (default: the working directory).
    Raises `ScenarioError` for what cannot be built: one line with ``source`` (the file that the scenario came from;
    default: its name), the key and the value.
    """
    source = source or f"scenario {scenario.name}"
    if seed < 0:
        raise ScenarioError(f"{source}: seed = {seed}: allowed are whole numbers from 0")
    scenario = resolve_paths(scenario, base_dir or Path.cwd())
    check_scenario(scenario, source)
    elevation = bare_ground(scenario, seed, source)
    bare = elevation.field
    origin = scenario.origin or elevation.origin or DEFAULT_ORIGIN
    # The scenario of a world is complete, so that what it is dumped to needs no default.
    scenario = structs.replace(scenario, origin=origin)
    _check_places(scenario, bare, source)
    field = random_rocks(scenario, bare, seed, source)
    large = field.diameters_m >= MESH_MIN_DIAMETER_M
    ground = imprint(field.chosen(~large), bare)
    explicit = _explicit_rocks(scenario, ground)
    rocks = RockTable.of(explicit).joined(rocks_of(field.chosen(large), ground, first_id=len(explicit) + 1))
    cylinders = _cylinders(scenario, ground, first_id=len(rocks) + 1)
    start, goal = (_on_ground(ground, place) for place in (scenario.rover.start_m, scenario.goal.position_m))
    heading = quaternion_from_euler(0.0, 0.0, float(np.radians(scenario.rover.heading_deg)))
    return World(
        scenario=scenario,
        seed=seed,
        ground=ground,
        rocks=rocks,
        cylinders=cylinders,
        shapes=SolidShapes(rocks, cylinders, ground),
        soil=load_soil(scenario.soil.preset),
        start=Pose(np.array(start), heading),
        goal_w=goal,
        soil_map=lay_soils(scenario, ground, source),
        origin=origin,
        notes=elevation.notes,
    )


def bare_ground(scenario: Scenario, seed: int, source: str) -> Elevation:
    """The ground without any rock. A synthetic map is centred midway between start and goal."""
    rng = _generator(seed, Stream.TERRAIN)
    if scenario.terrain.kind == "dem":
        return load_dem(scenario.terrain, source, rng)
    start, goal = scenario.rover.start_m, scenario.goal.position_m
    centre = ((start[0] + goal[0]) / 2.0, (start[1] + goal[1]) / 2.0)
    return Elevation(synthesise(scenario.terrain, centre, rng))


def random_rocks(scenario: Scenario, ground: HeightField, seed: int, source: str) -> RockField:
    """All random rocks of a scenario, the small ones too."""
    rocks = scenario.rocks
    (west, east), (south, north) = ground.x_limits_m, ground.y_limits_m
    area_m2 = (east - west) * (north - south)
    number = expected_number(rocks.cfa, rocks.min_diameter_m, rocks.max_diameter_m, area_m2)
    if number > MAX_ROCKS:
        raise ScenarioError(
            f"{source}: rocks.min_diameter_m = {rocks.min_diameter_m:g}: would make about {number:.3g} rocks; "
            f"allowed are {MAX_ROCKS}, so use larger ones, a lower rocks.cfa or a smaller map"
        )
    streams = (Stream.ROCK_SIZES, Stream.ROCK_PLACES, Stream.ROCK_SHAPES)
    try:
        field = draw_rock_field(rocks, ground, *(_generator(seed, stream) for stream in streams))
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from error
    return thin(field, _clear_discs(scenario))


def _generator(seed: int, stream: Stream) -> np.random.Generator:
    return np.random.default_rng([seed, stream])


def _clear_discs(scenario: Scenario) -> FloatArray:
    """Discs (M, 3) of x, y and radius that random rocks stay out of."""
    clear = scenario.rocks.clear_radius_m
    ends = [(*place, clear) for place in (scenario.rover.start_m, scenario.goal.position_m)]
    return np.array(ends + [(*item.position_m, _reach(item)) for item in scenario.obstacle])


def _reach(obstacle: Obstacle) -> float:
    """Radius in metres of the circle around all of an explicit obstacle."""
    if obstacle.kind == "cylinder":
        return obstacle.radius_m
    return _extents(obstacle)[0] / 2.0


def _extents(rock: Obstacle) -> tuple[float, float]:
    """Length and width in metres of an explicit rock."""
    return base_extents(rock.formation, 2.0 * rock.radius_m, rock.aspect)


def _holds(obstacle: Obstacle, place: tuple[float, float]) -> bool:
    """Whether a place lies on an obstacle's base; that of a rock is taken as an ellipse."""
    length, width = (2.0 * obstacle.radius_m,) * 2 if obstacle.kind == "cylinder" else _extents(obstacle)
    yaw = np.radians(obstacle.yaw_deg)
    x, y = place[0] - obstacle.position_m[0], place[1] - obstacle.position_m[1]
    along, across = np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x
    return bool(np.hypot(2.0 * along / length, 2.0 * across / width) < 1.0)


def _check_places(scenario: Scenario, ground: HeightField, source: str) -> None:
    """Raise a `ScenarioError` for anything off the map, and for a start or goal inside an explicit obstacle."""
    for key, place in (("rover.start_m", scenario.rover.start_m), ("goal.position_m", scenario.goal.position_m)):
        _check_on_map(f"{source}: {key}", place, ground, MAP_MARGIN_M)
        for index, item in enumerate(scenario.obstacle):
            if _holds(item, place):
                raise ScenarioError(
                    f"{source}: {key} = {list(place)}: lies inside obstacle[{index}], a {item.kind} of radius "
                    f"{_reach(item):.3g} m at {list(item.position_m)}"
                )
    for index, item in enumerate(scenario.obstacle):
        _check_on_map(f"{source}: obstacle[{index}].position_m", item.position_m, ground, 0.0)


def _check_on_map(where: str, place: tuple[float, float], ground: HeightField, margin_m: float) -> None:
    if contains(ground, *place, margin_m):
        return
    (west, east), (south, north) = ground.x_limits_m, ground.y_limits_m
    raise ScenarioError(
        f"{where} = {list(place)}: off the map; allowed are x {west + margin_m:.2f} to {east - margin_m:.2f} "
        f"and y {south + margin_m:.2f} to {north - margin_m:.2f}"
    )


def _explicit_rocks(scenario: Scenario, ground: HeightField) -> tuple[Rock, ...]:
    """The rocks of ``[[obstacle]]``; their ids come first, so that they do not depend on the seed."""
    items = [item for item in scenario.obstacle if item.kind == "rock"]
    return tuple(
        Rock(
            number,
            _on_ground(ground, item.position_m),
            *_extents(item),
            height_m=item.height_m,
            yaw_rad=float(np.radians(item.yaw_deg)),
            shape=RockShape(item.formation, item.sections) if item.sections else rock_shape(item.formation),
        )
        for number, item in enumerate(items, start=1)
    )


def _cylinders(scenario: Scenario, ground: HeightField, first_id: int) -> tuple[Cylinder, ...]:
    items = [item for item in scenario.obstacle if item.kind == "cylinder"]
    return tuple(
        Cylinder(number, _on_ground(ground, item.position_m), item.radius_m, item.height_m)
        for number, item in enumerate(items, start=first_id)
    )


def _on_ground(ground: HeightField, place: tuple[float, float]) -> tuple[float, float, float]:
    return (place[0], place[1], float(height_at(ground, *place)))
