"""Scenario files: strict TOML to frozen structures and back."""

from __future__ import annotations

from typing import Literal

import msgspec


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a scenario file: a mistyped key is an error."""


class Terrain(_Table):
    """Shape of the ground."""

    kind: Literal["flat", "slope", "fractal", "dunes", "crater", "dem"] = "fractal"
    size_m: tuple[float, float] = (40.0, 40.0)
    resolution_m: float = 0.08
    slope_deg: float = 0.0
    slope_azimuth_deg: float = 0.0
    roughness_m: float = 0.10
    path: str | None = None
    crop_m: tuple[float, float, float, float] | None = None
    resample: Literal["bilinear", "bicubic"] = "bicubic"
    height_range_m: tuple[float, float] | None = None


class Rocks(_Table):
    """Random rocks by the size-frequency law."""

    cfa: float = 0.05
    min_diameter_m: float = 0.05
    max_diameter_m: float = 1.2
    clear_radius_m: float = 1.5


class Obstacle(_Table):
    """An explicit obstacle."""

    kind: Literal["cylinder", "rock"]
    position_m: tuple[float, float]
    radius_m: float
    height_m: float
    formation: int = 0
    yaw_deg: float = 0.0


class SoilChoice(_Table):
    """Which soil the wheels meet."""

    preset: str = "mars_sand"


class RoverChoice(_Table):
    """Which rover, and where it starts."""

    model: str = "husky"
    start_m: tuple[float, float] = (0.0, 0.0)
    heading_deg: float = 0.0


class Goal(_Table):
    """Where the traverse ends."""

    position_m: tuple[float, float] = (20.0, 0.0)
    radius_m: float = 0.5
    time_limit_s: float = 600.0


class Sensors(_Table):
    """Which sensors the rover carries beside the camera."""

    gnss: bool = True
    laser: bool = False
    stereo: bool = False


class Camera(_Table):
    """The rover's camera."""

    rate_hz: float = 2.0
    width: int = 320
    height: int = 240
    fov_deg: float = 75.2  # horizontal
    pitch_deg: float = 25.0
    height_m: float = 1.1  # above the ground under a level rover
    noise: float = 1.5  # grey levels, one sigma


class Sun(_Table):
    """Where the light comes from; azimuth from +x counter-clockwise."""

    azimuth_deg: float = 120.0
    elevation_deg: float = 40.0


class Origin(_Table):
    """Geographic place of the world's x = y = z = 0."""

    latitude_deg: float = 38.4064
    longitude_deg: float = -110.7919
    altitude_m: float = 1380.0


class Scenario(_Table):
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
    origin: Origin = Origin()
