"""The table of a scenario about route planning above navigation."""

from __future__ import annotations

from worlds.strict_toml import Table

ORBITAL = "orbital"
MAP_SUFFIXES = (".tif", ".tiff", ".npy")


class RouteTable(Table, frozen=True):
    """Which elevation map the route is planned over, and how it is cut into legs."""

    map: str = ORBITAL  # the true ground as an orbiter measured it, or an elevation file
    resolution_m: float = 1.0  # between two heights; a GeoTIFF brings its own
    error_m: float = 0.1  # one sigma of a height; of a file: what is believed of it
    middle_m: tuple[float, float] | None = (
        None  # world place of a file's middle; None: by its georeference, else (0, 0)
    )
    leg_m: tuple[float, float] = (10.0, 25.0)  # shortest and longest leg
    radius_m: float = 2.5  # from the end of a leg, at which the next one is begun


LIMITS: dict[str, tuple[float, float]] = {
    "route.resolution_m": (0.1, 20.0),
    "route.error_m": (0.0, 5.0),
    "route.middle_m": (-1e5, 1e5),
    "route.leg_m": (3.0, 200.0),
    "route.radius_m": (0.5, 20.0),
}
