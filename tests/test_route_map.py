from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import tifffile

from rover_sim.cli import main
from rover_sim.errors import InputError
from rover_sim.route_map import averaged, first_route, from_orbit, route_map
from tests.data import data_path
from tests.planner_factory import FOOTPRINT
from worlds.build import build_world
from worlds.route_table import RouteTable
from worlds.scenario import Goal, Obstacle, Origin, Rocks, RoverChoice, Scenario, Terrain, load_scenario
from worlds.types import World

ORIGIN = Origin(latitude_deg=38.4, longitude_deg=-110.8)


def world(table: RouteTable, **changes: Any) -> World:
    """40 x 30 m around (10, 0), tilted up to the east by 5 deg."""
    terrain = Terrain(kind="slope", slope_deg=5.0, size_m=(40.0, 30.0), resolution_m=0.25)
    scenario = Scenario(
        name="test",
        terrain=terrain,
        rocks=Rocks(cfa=0.0),
        goal=Goal(position_m=(20.0, 0.0)),
        origin=ORIGIN,
        route=table,
    )
    return build_world(msgspec.structs.replace(scenario, **changes), 3)


def test_an_orbiter_sees_means_of_squares_with_its_error() -> None:
    flat = world(RouteTable())
    mean = averaged(flat, 1.0)
    assert mean.heights_m.shape == (30, 40)
    assert mean.origin_m == pytest.approx((-9.5, -14.5))
    x = mean.origin_m[0] + np.arange(40.0) - 10.0  # from the middle of the map, which has height 0
    np.testing.assert_allclose(mean.heights_m, np.tile(np.tan(np.radians(5.0)) * x, (30, 1)), atol=1e-9)
    seen = from_orbit(flat, RouteTable(error_m=0.2))
    assert np.std(seen.field.heights_m - mean.heights_m) == pytest.approx(0.2, rel=0.1)
    assert np.all(seen.variance_m2 == 0.2**2)
    again = from_orbit(world(RouteTable()), RouteTable(error_m=0.2))
    np.testing.assert_array_equal(seen.field.heights_m, again.field.heights_m)


def test_a_rock_raises_its_cell_by_its_volume() -> None:
    rock = Obstacle(kind="rock", position_m=(10.5, 0.5), radius_m=0.5, height_m=0.6)
    with_rock, without = (averaged(world(RouteTable(), obstacle=items), 1.0) for items in ((rock,), ()))
    raised = with_rock.heights_m - without.heights_m
    assert raised.max() == pytest.approx(np.pi / 6 * 1.0 * 1.0 * 0.6, rel=0.01)
    assert np.count_nonzero(raised) == 1


def saved(folder: Path, name: str = "map.npy", heights: Any = None) -> Path:
    path = folder / name
    np.save(path, np.zeros((60, 80)) if heights is None else heights)
    return path


def test_a_file_lies_about_zero_or_where_the_scenario_says(tmp_path: Path) -> None:
    path = saved(tmp_path)
    here = route_map(world(RouteTable(map=str(path))), RouteTable(map=str(path), error_m=0.0), "s")
    assert here.field.origin_m == (-39.5, -29.5)
    table = RouteTable(map=str(path), middle_m=(10.0, 5.0), error_m=0.0)
    assert route_map(world(table), table, "s").field.origin_m == (-29.5, -24.5)


def test_a_file_must_cover_start_and_goal(tmp_path: Path) -> None:
    table = RouteTable(map=str(saved(tmp_path)), middle_m=(55.0, 0.0))
    with pytest.raises(
        InputError, match=r'^s: route.map = ".*map.npy": does not cover rover.start_m = \[0, 0\]; it covers x'
    ):
        route_map(world(table), table, "s")


def geotiff(folder: Path, latitude_deg: float) -> RouteTable:
    """A map of 80 x 60 cells of about a metre, its middle at a latitude and the origin's longitude."""
    step = 1.0 / 111_000.0
    keys = (1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326)
    step_x = step / np.cos(np.radians(latitude_deg))
    corner = (0.0, 0.0, 0.0, ORIGIN.longitude_deg - 40 * step_x, latitude_deg + 30 * step, 0.0)
    extra = [(33550, 12, 3, (step_x, step, 0.0), True), (33922, 12, 6, corner, True), (34735, 3, 12, keys, True)]
    tifffile.imwrite(folder / "map.tif", np.zeros((60, 80), dtype=np.float32), extratags=extra)
    return RouteTable(map=str(folder / "map.tif"))


def test_a_georeference_puts_the_map_in_its_place(tmp_path: Path) -> None:
    table = geotiff(tmp_path, ORIGIN.latitude_deg + 10.0 / 111_000.0)
    ground = route_map(world(table), table, "s")
    (south, north), cell = ground.field.y_limits_m, ground.field.resolution_m
    assert 0.5 * (south + north) == pytest.approx(10.0, abs=0.5)
    assert cell == pytest.approx(1.0, abs=0.01)


def test_a_georeference_elsewhere_is_an_error(tmp_path: Path) -> None:
    table = geotiff(tmp_path, 39.4)
    with pytest.raises(
        InputError, match=r"middle at 39.40000, -110.80000 deg, 111.0 km from the scenario's \[origin\]"
    ):
        route_map(world(table), table, "s")


def test_files_without_heights_and_with_oblong_pixels_are_errors(tmp_path: Path) -> None:
    table = RouteTable(map=str(saved(tmp_path, heights=np.full((60, 80), np.nan))))
    with pytest.raises(InputError, match="all of its heights are missing"):
        route_map(world(table), table, "s")
    missing = RouteTable(map=str(tmp_path / "none.tif"))
    with pytest.raises(InputError, match=r"none.tif\": no such file"):
        route_map(world(missing), missing, "s")


def test_holes_of_a_file_are_not_driven(tmp_path: Path) -> None:
    heights = np.zeros((60, 80))
    heights[:, 50] = np.nan  # x = 10.5, between start and goal
    table = RouteTable(map=str(saved(tmp_path, heights=heights)))
    route = first_route(world(table), FOOTPRINT)
    assert route is not None
    assert route.route.refusal == "no_way"
    assert "without heights" in route.route.reason


def test_a_run_with_a_map_elsewhere_is_one_line_and_exit_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved(tmp_path)
    scenario = tmp_path / "far.toml"
    scenario.write_text(
        'name = "far"\n[terrain]\nkind = "flat"\n[route]\nmap = "map.npy"\nmiddle_m = [500.0, 0.0]\n', encoding="utf-8"
    )
    assert main(["run", str(scenario), "--out", str(tmp_path / "run")]) == 2
    told = capsys.readouterr().err.strip()
    assert "route.map = " in told
    assert "does not cover rover.start_m = [0, 0]" in told
    assert "Traceback" not in told


def test_without_the_table_there_is_no_route() -> None:
    plain = build_world(msgspec.structs.replace(load_scenario("rock-field"), route=None), 0)
    assert first_route(plain, FOOTPRINT) is None


def test_a_route_over_the_real_yard() -> None:
    path = data_path("worlds", "marsyard2022_hm.tif")
    terrain = Terrain(kind="dem", path=str(path), resolution_m=0.2)
    scenario = Scenario(
        name="yard",
        terrain=terrain,
        rocks=Rocks(cfa=0.0),
        rover=RoverChoice(start_m=(-18.0, -18.0)),
        goal=Goal(position_m=(15.0, 12.0)),
        route=RouteTable(map=str(path), error_m=0.02),
    )
    route = first_route(build_world(scenario, 0), FOOTPRINT)
    assert route is not None
    assert route.route.refusal is None, route.route.reason
