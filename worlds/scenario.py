"""Scenario files: strict TOML to frozen structures and back."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from worlds import fault_events, risk_table, route_table, sensor_tables
from worlds.errors import ScenarioError
from worlds.fault_events import Event, check_events
from worlds.risk_table import RiskTable, check_risk
from worlds.route_table import MAP_SUFFIXES, ORBITAL, RouteTable
from worlds.sensor_tables import Actuator, Barometer, Encoder, Gnss, Imu, Magnetometer, check_sensors
from worlds.soil_file import is_soil_file, load_soil
from worlds.strict_toml import Table, check_limits, convert_table, dump_toml, read_table

MAX_CELLS = (
    26_000_000  # 500 x 500 m at 0.1 m; memory and start-up time: eight bytes a cell in every copy of the heights
)
SLOWEST_CAMERA_HZ = 0.1
MAX_PATCHES = 200  # of soil
SECTIONS = 9  # A0..A8 of a rock
LEAST_SECTION = 0.05  # of those between the tips: a rock is one body
ROVER_SUFFIXES = (".toml", ".urdf")  # of a rover of the user's own; a shipped one is a bare name
MAP_MARGIN_M = 1.0  # start and goal stay this far inside the map, so that a rover fits on it

_SHIPPED = Path(__file__).parent / "scenarios"


GroundTexture = Literal["sand", "ripples", "gravel"]


class Terrain(Table, frozen=True):
    """Shape of the ground, and its look close by."""

    kind: Literal["flat", "slope", "fractal", "dunes", "crater", "dem"] = "fractal"
    size_m: tuple[float, float] = (40.0, 40.0)
    resolution_m: float = 0.08
    slope_deg: float = 0.0
    slope_azimuth_deg: float = 0.0
    roughness_m: float = 0.10  # rms of the fractal part of the kinds fractal, dunes and crater
    feature_size_m: float = 8.0  # crest distance of dunes, diameter of a crater
    relief_m: float = 0.6  # crest height of dunes, depth of a crater
    path: str | None = None
    crop_m: tuple[float, float, float, float] | None = None
    resample: Literal["bilinear", "bicubic"] = "bicubic"
    height_range_m: tuple[float, float] | None = None
    texture: GroundTexture = "sand"  # ripples: of wind; gravel: pebbles in patches
    detail_m: float = 0.0  # kind "dem": rms of seeded relief finer than the file's own grid


class Rocks(Table, frozen=True):
    """Random rocks by the size-frequency law."""

    cfa: float = 0.05
    min_diameter_m: float = 0.05
    max_diameter_m: float = 1.2
    clear_radius_m: float = 1.5
    formations: tuple[int, ...] = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9)  # drawn from with equal odds


class Obstacle(Table, frozen=True):
    """An explicit obstacle; ``radius_m`` of a rock is that of the circle of equal base."""

    kind: Literal["cylinder", "rock"]
    position_m: tuple[float, float]
    radius_m: float
    height_m: float
    formation: int = 0
    yaw_deg: float = 0.0  # of a rock's principal axis
    aspect: float | None = None  # length of a rock over its width; None: 1 for formation 0, else 1.6
    sections: tuple[float, ...] = ()  # of a rock: nine diameters A0..A8 over the largest; none: the formation's own


class SoilPatch(Table, frozen=True):
    """Another soil within a disc, or within a rectangle whose length lies along ``yaw_deg``."""

    kind: Literal["rectangle", "disc"]
    preset: str
    position_m: tuple[float, float]  # of its middle
    radius_m: float | None = None  # of a disc
    size_m: tuple[float, float] | None = None  # length and width of a rectangle
    yaw_deg: float = 0.0


class SoilChoice(Table, frozen=True):
    """Which soil the wheels meet; a preset's name or a soil file, relative to this one."""

    preset: str = "mars_sand"
    ruts: bool = True  # wheels leave ruts, and meet compacted soil where there is one
    patch: tuple[SoilPatch, ...] = ()


class RoverChoice(Table, frozen=True):
    """Which rover, and where it starts."""

    model: str = "husky"
    start_m: tuple[float, float] = (0.0, 0.0)
    heading_deg: float = 0.0
    charge: float = 1.0  # of the battery at the start


class Goal(Table, frozen=True):
    """Where the traverse ends."""

    position_m: tuple[float, float] = (20.0, 0.0)
    radius_m: float = 0.5
    time_limit_s: float = 600.0


class Sensors(Table, frozen=True):
    """Which sensors the rover carries beside the camera."""

    gnss: bool = True  # without it and with stereo, rocks seen tell the rover where it is
    laser: bool = False
    stereo: bool = False
    laser_fails_s: float | None = None  # from then on the scanner is silent
    camera_fails_s: float | None = None


class Camera(Table, frozen=True):
    """The rover's camera."""

    rate_hz: float = 2.0  # 0: no camera
    width: int = 320
    height: int = 240
    fov_deg: float = 75.2  # horizontal
    pitch_deg: float = 25.0
    height_m: float | None = None  # above the ground under a level rover; None: the mast of the rover
    noise: float = 1.5  # grey levels, one sigma


class Sun(Table, frozen=True):
    """Where the light comes from; azimuth from +x counter-clockwise."""

    azimuth_deg: float = 120.0
    elevation_deg: float = 40.0


class Origin(Table, frozen=True):
    """Geographic place of the world's x = y = z = 0."""

    latitude_deg: float = 38.4064
    longitude_deg: float = -110.7919
    altitude_m: float = 1380.0


DEFAULT_ORIGIN = Origin()


class Scenario(Table, frozen=True):
    """A whole scenario file."""

    name: str
    gravity_m_s2: float = 3.71
    terrain: Terrain = Terrain()
    rocks: Rocks = Rocks()
    obstacle: tuple[Obstacle, ...] = ()
    soil: SoilChoice = SoilChoice()
    rover: RoverChoice = RoverChoice()
    goal: Goal = Goal()
    sensors: Sensors = Sensors()
    camera: Camera = Camera()
    sun: Sun = Sun()
    origin: Origin | None = None  # None: that of the elevation file, or the default one
    route: RouteTable | None = None  # None: straight to the goal, with what the rover sees
    risk: RiskTable | None = None  # of that route
    imu: Imu | None = None  # these tables: see `worlds.sensor_tables`
    magnetometer: Magnetometer | None = None
    barometer: Barometer | None = None
    gnss: Gnss | None = None
    encoder: Encoder | None = None
    actuator: Actuator | None = None
    event: tuple[Event, ...] = ()  # faults


# Smallest and largest allowed number of every key; a list's numbers share one range.
LIMITS: dict[str, tuple[float, float]] = {
    "gravity_m_s2": (0.1, 30.0),
    "terrain.size_m": (2.0, 5000.0),
    "terrain.resolution_m": (0.01, 5.0),
    "terrain.slope_deg": (0.0, 45.0),
    "terrain.slope_azimuth_deg": (-360.0, 360.0),
    "terrain.roughness_m": (0.0, 5.0),
    "terrain.feature_size_m": (1.0, 500.0),
    "terrain.relief_m": (0.0, 50.0),
    "terrain.crop_m": (-1e5, 1e5),
    "terrain.height_range_m": (-1e4, 1e5),
    "terrain.detail_m": (0.0, 0.5),
    "rocks.cfa": (0.0, 0.30),  # more cannot be laid at random without overlap
    "rocks.min_diameter_m": (0.01, 5.0),
    "rocks.max_diameter_m": (0.01, 10.0),
    "rocks.clear_radius_m": (0.0, 100.0),
    "rocks.formations": (0, 9),
    "obstacle.position_m": (-1e5, 1e5),
    "obstacle.radius_m": (0.01, 20.0),
    "obstacle.height_m": (0.01, 20.0),
    "obstacle.formation": (0, 9),
    "obstacle.yaw_deg": (-360.0, 360.0),
    "obstacle.aspect": (1.0, 10.0),
    "obstacle.sections": (0.0, 1.0),
    "soil.patch.position_m": (-1e5, 1e5),
    "soil.patch.radius_m": (0.05, 1e4),
    "soil.patch.size_m": (0.05, 1e4),
    "soil.patch.yaw_deg": (-360.0, 360.0),
    "rover.start_m": (-1e5, 1e5),
    "rover.heading_deg": (-360.0, 360.0),
    "rover.charge": (0.0, 1.0),
    "goal.position_m": (-1e5, 1e5),
    "goal.radius_m": (0.05, 100.0),
    "goal.time_limit_s": (1.0, 1e6),
    "sensors.laser_fails_s": (0.0, 1e6),
    "sensors.camera_fails_s": (0.0, 1e6),
    "camera.rate_hz": (0.0, 30.0),
    "camera.width": (40, 1920),
    "camera.height": (40, 1440),
    "camera.fov_deg": (20.0, 140.0),
    "camera.pitch_deg": (-30.0, 80.0),
    "camera.height_m": (0.1, 10.0),
    "camera.noise": (0.0, 64.0),
    "sun.azimuth_deg": (-360.0, 360.0),
    "sun.elevation_deg": (2.0, 90.0),
    "origin.latitude_deg": (-89.0, 89.0),  # east is undefined at the poles
    "origin.longitude_deg": (-180.0, 180.0),
    "origin.altitude_m": (-12000.0, 30000.0),
    **sensor_tables.LIMITS,
    **fault_events.LIMITS,
    **route_table.LIMITS,
    **risk_table.LIMITS,
}


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with the package, sorted."""
    return tuple(sorted(path.stem for path in _SHIPPED.glob("*.toml")))


def without_gnss(scenario: Scenario) -> Scenario:
    """The scenario with a second camera in the stead of the satellite receiver."""
    sensors = msgspec.structs.replace(scenario.sensors, gnss=False, stereo=True)
    return msgspec.structs.replace(scenario, sensors=sensors)


def load_scenario(name_or_path: str) -> Scenario:
    """The scenario of a shipped name or of a TOML file; the files that it names come back absolute.

    Raises `ScenarioError` with one line that names the file, the key, its value and what is allowed.
    """
    path = _SHIPPED / f"{name_or_path}.toml" if name_or_path in shipped_scenarios() else Path(name_or_path)
    if not path.is_file():
        shipped = ", ".join(shipped_scenarios())
        raise ScenarioError(f"{name_or_path}: no such scenario file; shipped scenarios are {shipped}")
    scenario = convert_table(read_table(path), Scenario, str(path))
    scenario = resolve_paths(scenario, path.parent)
    check_scenario(scenario, str(path))
    return scenario


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as complete TOML: every key, so that loading it gives an equal scenario."""
    return dump_toml(scenario)


def resolve_paths(scenario: Scenario, base_dir: Path) -> Scenario:
    """The scenario with the files that it names (elevation, soils, rover) relative to ``base_dir``, made absolute."""
    replace = msgspec.structs.replace

    def soil_path(preset: str) -> str:
        return str((base_dir / preset).resolve()) if is_soil_file(preset) else preset

    terrain, soil, rover = scenario.terrain, scenario.soil, scenario.rover
    if rover.model.endswith(ROVER_SUFFIXES):
        rover = replace(rover, model=str((base_dir / rover.model).resolve()))
    if terrain.path is not None:
        terrain = replace(terrain, path=str((base_dir / terrain.path).resolve()))
    route = scenario.route
    if route is not None and route.map != ORBITAL:
        route = replace(route, map=str((base_dir / route.map).resolve()))
    risk = scenario.risk
    if risk is not None:
        risk = replace(risk, soils=tuple(soil_path(preset) for preset in risk.soils))
    patches = tuple(replace(patch, preset=soil_path(patch.preset)) for patch in soil.patch)
    soil = replace(soil, preset=soil_path(soil.preset), patch=patches)
    return replace(scenario, terrain=terrain, soil=soil, rover=rover, route=route, risk=risk)


def check_scenario(scenario: Scenario, source: str) -> None:
    """Raise a `ScenarioError` that begins with ``source`` for a number out of range or keys at odds."""
    check_limits(scenario, LIMITS, source)
    _check_terrain(scenario.terrain, source)
    rocks = scenario.rocks
    if rocks.min_diameter_m >= rocks.max_diameter_m:
        raise ScenarioError(
            f"{source}: rocks.min_diameter_m = {rocks.min_diameter_m:g}: "
            f"must be less than rocks.max_diameter_m = {rocks.max_diameter_m:g}"
        )
    if not rocks.formations:
        raise ScenarioError(f"{source}: rocks.formations = []: must name at least one of 0 to 9")
    _check_obstacles(scenario.obstacle, source)
    _check_soils(scenario.soil, source)
    _check_eyes(scenario, source)
    check_events(scenario, source)
    check_sensors(scenario, source)
    _check_route(scenario.route, source)
    check_risk(scenario.risk, source, routed=scenario.route is not None)
    if scenario.terrain.kind != "dem":
        _check_on_map(scenario, source)


def _check_terrain(terrain: Terrain, source: str) -> None:
    if terrain.kind == "dem" and terrain.path is None:
        raise ScenarioError(f'{source}: terrain.path: this key is required with terrain.kind = "dem"')
    if terrain.kind != "dem" and terrain.detail_m:
        raise ScenarioError(
            f'{source}: terrain.detail_m = {terrain.detail_m:g}: only elevation files, terrain.kind = "dem", take it'
        )
    if terrain.crop_m and (terrain.crop_m[0] >= terrain.crop_m[2] or terrain.crop_m[1] >= terrain.crop_m[3]):
        raise ScenarioError(
            f"{source}: terrain.crop_m = {list(terrain.crop_m)}: must be [x0, y0, x1, y1], x0 < x1, y0 < y1"
        )
    if terrain.height_range_m and terrain.height_range_m[0] >= terrain.height_range_m[1]:
        raise ScenarioError(
            f"{source}: terrain.height_range_m = {list(terrain.height_range_m)}: must be [lowest, highest]"
        )
    check_cells(terrain.size_m, terrain.resolution_m, source)


def _check_eyes(scenario: Scenario, source: str) -> None:
    rate, sensors = scenario.camera.rate_hz, scenario.sensors
    if 0.0 < rate < SLOWEST_CAMERA_HZ:
        raise ScenarioError(f"{source}: camera.rate_hz = {rate:g}: allowed are 0 and {SLOWEST_CAMERA_HZ:g} to 30")
    if rate == 0.0 and not sensors.laser:
        raise ScenarioError(f"{source}: camera.rate_hz = 0: a rover without camera needs sensors.laser = true")
    for name, present in (("laser", sensors.laser), ("camera", rate > 0.0)):
        if getattr(sensors, f"{name}_fails_s") is not None and not present:
            raise ScenarioError(f"{source}: sensors.{name}_fails_s: the rover has no {name} that could fail")


def _check_route(route: RouteTable | None, source: str) -> None:
    if route is None:
        return
    if route.map != ORBITAL and not route.map.lower().endswith(MAP_SUFFIXES):
        raise ScenarioError(
            f'{source}: route.map = "{route.map}": allowed are "{ORBITAL}" and a file {", ".join(MAP_SUFFIXES)}'
        )
    if route.leg_m[0] >= route.leg_m[1]:
        raise ScenarioError(f"{source}: route.leg_m = {list(route.leg_m)}: must be [shortest, longest]")


def _check_obstacles(obstacles: tuple[Obstacle, ...], source: str) -> None:
    """Raise a `ScenarioError` for a cylinder with the measures of a rock, and for sections that make no body."""
    for number, item in enumerate(obstacles):
        where = f"{source}: obstacle[{number}]"
        if item.kind == "cylinder" and (item.aspect is not None or item.sections):
            raise ScenarioError(f"{where}.kind = cylinder: aspect and sections are keys of a rock")
        if item.sections and len(item.sections) != SECTIONS:
            raise ScenarioError(
                f"{where}.sections: has {len(item.sections)} numbers; give the {SECTIONS} diameters A0..A8"
            )
        if item.sections and (max(item.sections) < 1.0 or min(item.sections[1:-1]) < LEAST_SECTION):
            raise ScenarioError(
                f"{where}.sections = {list(item.sections)}: the largest must be 1 and those between the tips at least "
                f"{LEAST_SECTION:g}"
            )


def _check_soils(soil: SoilChoice, source: str) -> None:
    """Raise a `ScenarioError` for an unknown or impossible soil, and for a patch without its measures."""
    for preset in (soil.preset, *(patch.preset for patch in soil.patch)):
        try:
            load_soil(preset)
        except ScenarioError as error:
            raise ScenarioError(f"{source}: {error}") from error
    for number, patch in enumerate(soil.patch):
        needed, other = ("radius_m", "size_m") if patch.kind == "disc" else ("size_m", "radius_m")
        if getattr(patch, needed) is None:
            raise ScenarioError(f"{source}: soil.patch[{number}].{needed}: this key is required for a {patch.kind}")
        if getattr(patch, other) is not None:
            raise ScenarioError(f"{source}: soil.patch[{number}].{other}: a {patch.kind} has {needed} instead")
    if len(soil.patch) > MAX_PATCHES:
        raise ScenarioError(f"{source}: soil.patch: {len(soil.patch)} patches; allowed are {MAX_PATCHES}")


def check_cells(size_m: tuple[float, float], resolution_m: float, source: str) -> None:
    """Raise a `ScenarioError` where a grid of that size would have too many cells, or too few to be a map."""
    cells = (size_m[0] / resolution_m + 1) * (size_m[1] / resolution_m + 1)
    if cells > MAX_CELLS:
        finest = (size_m[0] * size_m[1] / MAX_CELLS) ** 0.5
        raise ScenarioError(
            f"{source}: terrain.resolution_m = {resolution_m:g}: a map of {size_m[0]:g} x {size_m[1]:g} m would have "
            f"{cells:.3g} cells; allowed are {MAX_CELLS:.0e}, so use {finest * 1.05:.2g} m or more"
        )
    if min(size_m) / resolution_m < 4:
        raise ScenarioError(
            f"{source}: terrain.resolution_m = {resolution_m:g}: must be at most a quarter of the map's "
            f"shorter side, {min(size_m):g} m"
        )


def _check_on_map(scenario: Scenario, source: str) -> None:
    """Synthetic maps are centred between start and goal, so only their distance matters."""
    start, goal = scenario.rover.start_m, scenario.goal.position_m
    for axis, name in enumerate("xy"):
        distance = abs(goal[axis] - start[axis])
        if distance > scenario.terrain.size_m[axis] - 2 * MAP_MARGIN_M:
            raise ScenarioError(
                f"{source}: goal.position_m = {list(goal)}: {distance:g} m from rover.start_m along {name}, which is "
                f"off the map; allowed are {scenario.terrain.size_m[axis] - 2 * MAP_MARGIN_M:g} m "
                f"(terrain.size_m[{axis}] less {MAP_MARGIN_M:g} m at each end)"
            )
