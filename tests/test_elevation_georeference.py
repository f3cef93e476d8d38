from __future__ import annotations

from math import cos, radians, sin, sqrt, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from worlds.build import build_world
from worlds.dem import load_dem
from worlds.errors import ScenarioError
from worlds.georeference import FLATTENING, SEMI_MAJOR_M, Georeference, read_georeference, utm_to_degrees
from worlds.scenario import Goal, Origin, RoverChoice, Scenario, Terrain

E2 = FLATTENING * (2.0 - FLATTENING)
SHAPE = (100, 200)


def tags(keys: dict[int, int], scale: tuple[float, float] = (2.0, 2.0), tie: tuple[float, ...] = ()) -> dict[int, Any]:
    directory = [1, 1, 0, len(keys)]
    for key, value in keys.items():
        directory += [key, 0, 1, value]
    found: dict[int, Any] = {33550: (*scale, 0.0), 34735: tuple(directory)}
    return found | ({33922: tie} if tie else {})


def degrees_of(zone: int, south: bool, east: float, north: float) -> tuple[float, float]:
    """Place of the middle of a grid of 2 m pixels whose middle is there."""
    keys = {1024: 1, 3072: (32700 if south else 32600) + zone}
    found = read_georeference(tags(keys, tie=(0, 0, 0, east - 200.0, north + 100.0, 0)), SHAPE)
    assert found.pixel_m == (2.0, 2.0)
    assert found.place_deg is not None
    return found.place_deg


def test_known_places_of_utm() -> None:
    # The CN Tower: 17T 630084 4833438 is 43 deg 38' 33.24" N, 79 deg 23' 13.7" W (published to the metre).
    assert degrees_of(17, south=False, east=630084.0, north=4833438.0) == pytest.approx(
        (43.642567, -79.387139), abs=1e-5
    )
    assert degrees_of(31, south=False, east=500000.0, north=0.0) == pytest.approx((0.0, 3.0), abs=1e-12)
    assert degrees_of(60, south=True, east=500000.0, north=1e7) == pytest.approx((0.0, 177.0), abs=1e-12)
    assert degrees_of(1, south=False, east=200000.0, north=0.0)[1] == pytest.approx(-180.0 + 0.3053, abs=1e-3)


def meridian_arc(latitude_rad: float) -> float:
    """Length in metres from the equator, by quadrature of the radius of curvature."""

    def radius(angle: float) -> float:
        return float(SEMI_MAJOR_M * (1 - E2) / (1 - E2 * sin(angle) ** 2) ** 1.5)

    return float(quad(radius, 0.0, latitude_rad, epsabs=1e-9)[0])


@given(st.floats(-80.0, 84.0, allow_subnormal=False).filter(lambda latitude: abs(latitude) > 1e-6))
def test_northings_on_the_central_meridian_are_its_arc(latitude: float) -> None:
    south = latitude < 0
    found = utm_to_degrees(500000.0, 0.9996 * meridian_arc(radians(latitude)) + 1e7 * south, 33, south)
    assert found == pytest.approx((latitude, 15.0), abs=1e-10)


def utm_by_snyder(latitude: float, east_of_centre: float) -> tuple[float, float]:
    """Easting and northing by Snyder, USGS PP 1395, eq. 8-9 and 8-10: series in the longitude."""
    phi = radians(latitude)
    ep2, t = E2 / (1 - E2), tan(phi) ** 2
    c, a = ep2 * cos(phi) ** 2, cos(phi) * radians(east_of_centre)
    n = SEMI_MAJOR_M / sqrt(1 - E2 * sin(phi) ** 2)
    m = meridian_arc(phi)
    x = n * (a + (1 - t + c) * a**3 / 6 + (5 - 18 * t + t**2 + 72 * c - 58 * ep2) * a**5 / 120)
    y = m + n * tan(phi) * (
        a**2 / 2 + (5 - t + 9 * c + 4 * c**2) * a**4 / 24 + (61 - 58 * t + t**2 + 600 * c - 330 * ep2) * a**6 / 720
    )
    return 0.9996 * x + 500000.0, 0.9996 * y


@given(st.floats(0.001, 80.0), st.floats(-3.0, 3.0))
def test_utm_agrees_with_an_independent_series(latitude: float, east_of_centre: float) -> None:
    east, north = utm_by_snyder(latitude, east_of_centre)
    found = utm_to_degrees(east, north, 31, southern=False)
    # That series leaves out terms of up to some millimetres at 3 degrees.
    assert found == pytest.approx((latitude, 3.0 + east_of_centre), abs=2e-7)


def test_degrees_become_metres_at_the_middle() -> None:
    second = 1.0 / 3600.0
    keys = {1024: 2, 1025: 2, 2048: 4326}
    # Points, so 99 and 199 steps from the tie point to the far corner.
    found = read_georeference(
        tags(keys, (second, second), (0, 0, 0, 15.0 - 99.5 * second, 60.0 + 49.5 * second, 0)), SHAPE
    )
    assert found.place_deg == pytest.approx((60.0, 15.0))
    # At 60 degrees: a degree of longitude 55.80 km, of latitude 111.412 km (published tables of WGS-84).
    assert found.pixel_m is not None
    assert found.pixel_m == pytest.approx((55800.0 / 3600, 111412.0 / 3600), rel=1e-4)


def test_a_matrix_does_what_scale_and_tie_point_do() -> None:
    keys = tags({1024: 1, 3072: 32633})
    matrix = (2.0, 0, 0, 4e5, 0, -2.0, 0, 5e6, 0, 0, 0, 0, 0, 0, 0, 1)
    plain = read_georeference(keys | {33922: (0, 0, 0, 4e5, 5e6, 0)}, SHAPE)
    del keys[33550]
    assert read_georeference(keys | {34264: matrix}, SHAPE) == plain


def test_feet_are_metres_in_the_end() -> None:
    found = read_georeference(tags({1024: 1, 3072: 2230, 3076: 9003}, (3.0, 3.0), (0, 0, 0, 6e6, 2e6, 0)), SHAPE)
    assert found.pixel_m == pytest.approx((0.914402, 0.914402), abs=1e-6)
    assert found.place_deg is None
    assert found.note == "its place is given in projection EPSG:2230, neither geographic nor UTM"


def test_mars_is_not_on_earth() -> None:
    mars = tags({1024: 2, 2048: 32767}, (0.001, 0.001), (0, 0, 0, 137.0, -4.5, 0))
    mars[34735] = (1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 32767, 2057, 34736, 1, 1)
    mars[34736] = (0.0, 3396190.0)
    found = read_georeference(mars, SHAPE)
    assert found.place_deg is None
    assert found.note == "its place is on a body of radius 3396.19 km, not on the Earth"
    assert found.pixel_m == pytest.approx((59.3, 59.0), abs=0.5)  # 2 pi 3396.19 km / 360000, by the cosine of 4.55 deg


def test_without_keys_there_is_a_pixel_size_only() -> None:
    assert read_georeference({}, SHAPE) == Georeference()
    assert read_georeference({33550: (0.5, 0.25, 0.0)}, SHAPE) == Georeference((0.5, 0.25))
    assert read_georeference({33550: (0.5, 0.5, 0.0), 33922: (0, 0, 0, -25, 25, 0)}, SHAPE) == Georeference((0.5, 0.5))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ({33550: (-1.0, 1.0, 0.0)}, "pixels of -1 x 1"),
        ({34264: (1, 1, 0, 0, 1, -1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1)}, "its grid is turned"),
        ({34264: (1.0, 0.0)}, "its grid is turned"),
        (tags({1024: 1, 3076: 9036}), "unit 9036 of EPSG; allowed are metres and feet"),
        (tags({1024: 2, 2054: 9101}, tie=(0,) * 6), "unit 9101 of EPSG; allowed are degrees"),
        (tags({1024: 2}), "without a tie point"),
        (tags({1024: 2}, tie=(0, 0, 0, 0, 300, 0)), "at latitude 200 degrees"),
    ],
)
def test_georeferences_that_cannot_be_used(found: dict[int, Any], expected: str) -> None:
    with pytest.raises(ScenarioError, match=expected):
        read_georeference(found, SHAPE)


def write_utm(path: Path, code: int = 32633) -> str:
    """100 x 100 m at 1 m around east 400,000, north 5,000,000; row 0 is the north."""
    keys = (1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, code)
    heights = np.add.outer(np.arange(100)[::-1] * 0.05, np.zeros(100))
    extra = [
        (33550, "d", 3, (1.0, 1.0, 0.0), True),
        (33922, "d", 6, (0.0, 0.0, 0.0, 399950.0, 5000050.0, 0.0), True),
        (34735, "H", len(keys), keys, True),
    ]
    tifffile.imwrite(path, heights.astype(np.float32), extratags=extra)
    return str(path)


def scenario(path: str, origin: Origin | None = None) -> Scenario:
    return Scenario(
        name="utm",
        terrain=Terrain(kind="dem", path=path, resolution_m=0.5),
        rover=RoverChoice(start_m=(-10.0, 0.0)),
        goal=Goal(position_m=(10.0, 0.0)),
        origin=origin,
    )


def test_the_mission_starts_where_the_file_lies(tmp_path: Path) -> None:
    world = build_world(scenario(write_utm(tmp_path / "u.tif")), 0)
    place = utm_to_degrees(400000.0, 5000000.0, 33, southern=False)
    assert (world.origin.latitude_deg, world.origin.longitude_deg, world.origin.altitude_m) == (*place, 0.0)
    assert world.scenario.origin == world.origin  # so the dumped scenario repeats the run
    # 40 m further north in UTM is 40 m / 0.9996 further in the world; grid north is 0.89 degrees off true north here.
    there = utm_to_degrees(400000.0, 5000040.0, 33, southern=False)
    east, north, _ = LocalFrame(world.origin).to_world(GeoPoint(*there, 0.0))
    assert np.hypot(east, north) == pytest.approx(40.0, abs=0.03)
    assert north == pytest.approx(40.0, abs=0.03)


def test_the_scenarios_own_origin_goes_before_the_files(tmp_path: Path) -> None:
    own = Origin(latitude_deg=1.0, longitude_deg=2.0, altitude_m=3.0)
    assert build_world(scenario(write_utm(tmp_path / "u.tif"), own), 0).origin == own


def test_another_projection_leaves_a_note_and_the_default_origin(tmp_path: Path) -> None:
    world = build_world(scenario(write_utm(tmp_path / "lambert.tif", 2154)), 0)
    assert world.origin == Origin()
    (note,) = world.notes
    assert note == (
        "lambert.tif: its place is given in projection EPSG:2154, neither geographic nor UTM: "
        "the mission origin is the scenario's [origin]"
    )


def test_a_grid_in_degrees_gets_square_cells(tmp_path: Path) -> None:
    keys = (1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326)
    second = 1.0 / 36000.0
    # A plane that rises 1 m a row to the north and 2 m a column to the east, at 60 deg north.
    heights = np.add.outer(np.arange(60)[::-1] * 1.0, np.arange(80) * 2.0)
    extra = [
        (33550, "d", 3, (second, second, 0.0), True),
        (33922, "d", 6, (0.0, 0.0, 0.0, 10.0, 60.0 + 30 * second, 0.0), True),
        (34735, "H", len(keys), keys, True),
    ]
    tifffile.imwrite(tmp_path / "d.tif", heights, extratags=extra)
    terrain = Terrain(kind="dem", path=str(tmp_path / "d.tif"), resolution_m=0.5)
    elevation = load_dem(terrain, "test", np.random.default_rng(0))
    h = elevation.field.heights_m
    assert (h[0, 1] - h[0, 0]) / 0.5 == pytest.approx(2.0 / 1.5500, rel=1e-3)
    assert (h[1, 0] - h[0, 0]) / 0.5 == pytest.approx(1.0 / 3.0948, rel=1e-3)
    assert elevation.origin is not None
    assert elevation.origin.latitude_deg == pytest.approx(60.0)
