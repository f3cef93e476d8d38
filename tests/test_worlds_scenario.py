from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from worlds.errors import ScenarioError
from worlds.fault_events import Event
from worlds.risk_table import RiskTable
from worlds.route_table import RouteTable
from worlds.scenario import (
    LIMITS,
    Camera,
    Goal,
    Obstacle,
    Origin,
    RoverChoice,
    Scenario,
    Sensors,
    SoilChoice,
    SoilPatch,
    Terrain,
    check_scenario,
    dump_scenario,
    load_scenario,
    shipped_scenarios,
)
from worlds.sensor_tables import Actuator, Barometer, Encoder, Gnss, Imu, Magnetometer
from worlds.strict_toml import convert_table, dump_toml, numeric_keys

SENSOR_TABLES = ("imu", "magnetometer", "barometer", "gnss", "encoder", "actuator", "event")


def load_text(folder: Path, text: str) -> Scenario:
    path = folder / "world.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(str(path))


def message_of(folder: Path, text: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        load_text(folder, text)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(folder / "world.toml"))
    return message


def test_the_shipped_scenarios_load_and_have_their_own_name() -> None:
    assert shipped_scenarios() == ("demo", "rock-field", "slope", "tsu-mockup")
    for name in shipped_scenarios():
        assert load_scenario(name).name == name


def test_demo_is_a_traverse_of_at_least_22_m_through_cfa_5_percent() -> None:
    demo = load_scenario("demo")
    assert demo.rocks.cfa == 0.05
    assert demo.goal.position_m[0] - demo.rover.start_m[0] >= 22.0
    assert (demo.gravity_m_s2, demo.soil.preset, demo.goal.time_limit_s) == (3.71, "mars_sand", 300.0)


def test_contract_example_loads_but_for_its_missing_elevation_file(tmp_path: Path) -> None:
    text = """
        name = "mars-yard"
        gravity_m_s2 = 3.71
        [terrain]
        kind = "fractal"
        size_m = [40.0, 40.0]
        path = "yard.tif"
        [[obstacle]]
        kind = "cylinder"
        position_m = [2.0, 1.0]
        radius_m = 0.075
        height_m = 1.0
        [goal]
        position_m = [30.0, 0.0]
    """
    scenario = load_text(tmp_path, text)
    assert scenario.obstacle[0].radius_m == 0.075
    assert scenario.terrain.path == str(tmp_path / "yard.tif")


def test_dump_has_every_key_and_loads_to_an_equal_scenario(tmp_path: Path) -> None:
    for name in shipped_scenarios():
        scenario = load_scenario(name)
        text = dump_scenario(scenario)
        assert load_text(tmp_path, text) == scenario
        for key in LIMITS:
            leaf = key.split(".")[-1]
            optional = key.startswith(("obstacle", "origin", "soil.patch", "route", "risk", *SENSOR_TABLES))
            assert optional or f"{leaf} =" in text or f"# {leaf} is not set" in text


@given(
    name=st.text(st.characters(exclude_categories=["Cs"]), max_size=30),
    x=st.floats(-9.0, 9.0),
    yaw=st.floats(-360.0, 360.0),
    gnss=st.booleans(),
)
def test_any_scenario_survives_the_round_trip(name: str, x: float, yaw: float, gnss: bool) -> None:
    import tomllib

    obstacle = Obstacle(kind="rock", position_m=(x, -x), radius_m=0.3, height_m=0.2, yaw_deg=yaw)
    base = Scenario(name=name, obstacle=(obstacle, obstacle), rover=RoverChoice(start_m=(x, 0.0), heading_deg=yaw))
    scenario = msgspec.structs.replace(base, sensors=msgspec.structs.replace(base.sensors, gnss=gnss))
    assert convert_table(tomllib.loads(dump_toml(scenario)), Scenario, "test") == scenario


def test_every_number_has_a_range() -> None:
    terrain = Terrain(crop_m=(0.0, 0.0, 1.0, 1.0), height_range_m=(0.0, 1.0))
    obstacle = Obstacle(kind="rock", position_m=(0.0, 0.0), radius_m=1.0, height_m=1.0, aspect=1.5, sections=(0.5,) * 9)
    patch = SoilPatch(kind="disc", preset="firm", position_m=(0.0, 0.0), radius_m=1.0, size_m=(1.0, 1.0))
    soil = SoilChoice(patch=(patch,))
    camera, sensors = Camera(height_m=1.0), Sensors(laser_fails_s=1.0, camera_fails_s=1.0)
    scenario = Scenario(
        name="x",
        terrain=terrain,
        obstacle=(obstacle,),
        soil=soil,
        origin=Origin(),
        camera=camera,
        sensors=sensors,
        route=RouteTable(middle_m=(0.0, 0.0)),
        risk=RiskTable(limit=0.5, soils=("firm",), weights=(1.0,), roughness_m=0.01),
        imu=Imu(roughness_cm3=64.0),
        magnetometer=Magnetometer(field_uT=(20.0, 0.0, 40.0)),
        barometer=Barometer(),
        gnss=Gnss(outages_s=((1.0, 2.0),)),
        encoder=Encoder(),
        actuator=Actuator(),
        event=(Event(kind="power_loss", time_s=1.0, duration_s=1.0, wheel=0, offset_m=(0.0,) * 3, stall_s=1.0),),
    )
    assert numeric_keys(scenario) == set(LIMITS)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[terrain]\nresolutoin_m = 0.1", "terrain.resolutoin_m = 0.1: unknown key; did you mean 'resolution_m'?"),
        ("[terrain]\nresolutoin_m = 0.1", "allowed here: kind, size_m, resolution_m, slope_deg"),
        ("[sunn]\n", "sunn = {}: unknown key; did you mean 'sun'?"),
        ("[[obstacle]]\nkind = 'rock'\nhight_m = 1", "obstacle[0].hight_m = 1: unknown key; did you mean 'height_m'"),
        ("[terrain]\nkind = 'hills'", 'terrain.kind = "hills": allowed are flat, slope, fractal, dunes, crater, dem'),
        ("[gnss]\nfix = 'good'", 'gnss.fix = "good": allowed are 3d, dgps, rtk_float, rtk_fixed'),
        ("[gnss]\noutages_s = [[2.0, 1.0]]", "gnss.outages_s[0] = [2, 1]: must be [from, to]"),
        ("[gnss]\noutages_s = [[2.0]]", "gnss.outages_s[0] = [2.0]: expected a list of 2 numbers, got 1"),
        ("[gnss]\n[sensors]\ngnss = false", "gnss: sensors.gnss is false, so there is no receiver"),
        ("[imu]\ngyro_noise = 0.1", "imu.gyro_noise = 0.1: unknown key; did you mean 'gyro_noise_deg_s_rthz'?"),
        ("[magnetometer]\nyear = 2031", "magnetometer.year = 2031: allowed are 2025 to 2030"),
        ("[actuator]\ndead_band = 0.3\nlimit = 0.2", "actuator.dead_band = 0.3: must be less than actuator.limit"),
        ("[terrain]\nsize_m = [40.0]", "terrain.size_m = [40.0]: expected a list of 2 numbers, got 1"),
        ("[terrain]\nsize_m = ['a', 2]", 'terrain.size_m[0] = "a": expected a number, got text'),
        ("[terrain]\npath = 3", "terrain.path = 3: expected text, got a whole number"),
        ("terrain = 3", "terrain = 3: expected a table, got a whole number"),
        ("[camera]\nwidth = 2.5", "camera.width = 2.5: expected a whole number, got a number"),
        ("[sensors]\ngnss = 1", "sensors.gnss = 1: expected true or false, got a whole number"),
        ("[[obstacle]]\nkind = 'rock'", "obstacle[0].position_m: this key is required"),
        ("[camera]\nrate_hz = 0.05", "camera.rate_hz = 0.05: allowed are 0 and 0.1 to 30"),
        ("[camera]\nrate_hz = 0.0", "camera.rate_hz = 0: a rover without camera needs sensors.laser = true"),
        ("[sensors]\nlaser_fails_s = 3.0", "sensors.laser_fails_s: the rover has no laser that could fail"),
        ("[camera]\nrate_hz = nan", "camera.rate_hz = nan: must be a finite number"),
        ("[terrain]\nslope_deg = inf", "terrain.slope_deg = inf: must be a finite number"),
        ("[terrain]\nsize_m = [-5.0, 5.0]", "terrain.size_m[0] = -5: allowed are 2 to 5000"),
        ("[rocks]\ncfa = 0.9", "rocks.cfa = 0.9: allowed are 0 to 0.3"),
        ("gravity_m_s2 = -1.0", "gravity_m_s2 = -1: allowed are 0.1 to 30"),
        ("[camera]\nfov_deg = 180.0", "camera.fov_deg = 180: allowed are 20 to 140"),
        ("[goal]\ntime_limit_s = -3", "goal.time_limit_s = -3: allowed are 1 to"),
        ("[goal]\nposition_m = [39.0, 0.0]", "goal.position_m = [39.0, 0.0]: 39 m from rover.start_m along x"),
        ("[rocks]\nmin_diameter_m = 2.0", "rocks.min_diameter_m = 2: must be less than rocks.max_diameter_m = 1.2"),
        ("[rocks]\nformations = []", "rocks.formations = []: must name at least one"),
        ("[terrain]\nresolution_m = 0.01\nsize_m = [90, 90]", "terrain.resolution_m = 0.01: a map of 90 x 90 m would"),
        ("[terrain]\nresolution_m = 5.0\nsize_m = [9, 90]\n[goal]\nposition_m=[0,9]", "terrain.resolution_m = 5: must"),
        ("[terrain]\nkind = 'dem'", "terrain.path: this key is required"),
        ("[terrain]\ncrop_m = [1, 1, 0, 2]", "terrain.crop_m = [1.0, 1.0, 0.0, 2.0]: must be [x0, y0, x1, y1]"),
        ("[terrain]\nheight_range_m = [1, 1]", "terrain.height_range_m = [1.0, 1.0]: must be [lowest, highest]"),
        ("[terrain]\ndetail_m = 0.1", "terrain.detail_m = 0.1: only elevation files"),
        ("[origin]\nlatitude = 1.0", "origin.latitude = 1.0: unknown key; did you mean 'latitude_deg'?"),
        ("[origin]\nlatitude_deg = 90.0", "origin.latitude_deg = 90: allowed are -89 to 89"),
        ("[origin]\nlatitude_deg = 'x'", 'origin.latitude_deg = "x": expected a number, got text'),
        ("[soil]\npreset = 'mud'", "soil.preset = 'mud'"),
        ("[terrain\n", "not valid TOML: Expected ']' at the end of a table declaration (at line 2, column 9)"),
    ],
)
def test_a_fault_is_one_line_with_file_key_value_and_remedy(tmp_path: Path, text: str, expected: str) -> None:
    assert expected in message_of(tmp_path, f'name = "x"\n{text}\n')


def test_a_missing_name_is_named(tmp_path: Path) -> None:
    assert "name: this key is required" in message_of(tmp_path, "gravity_m_s2 = 3.71\n")


def test_a_missing_file_lists_the_shipped_names() -> None:
    with pytest.raises(ScenarioError, match=r"nowhere\.toml: no such scenario file; shipped .*demo, rock-field, slope"):
        load_scenario("nowhere.toml")


def test_a_folder_and_a_binary_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no such scenario file"):
        load_scenario(str(tmp_path))
    (tmp_path / "world.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="not a text file"):
        load_scenario(str(tmp_path / "world.toml"))


def test_start_and_goal_may_lie_anywhere_as_long_as_both_fit() -> None:
    scenario = Scenario(name="x", rover=RoverChoice(start_m=(900.0, 5.0)), goal=Goal(position_m=(938.0, 5.0)))
    check_scenario(scenario, "test")
    far = msgspec.structs.replace(scenario, goal=Goal(position_m=(938.5, 5.0)))
    with pytest.raises(ScenarioError, match="off the map"):
        check_scenario(far, "test")
