from __future__ import annotations

from math import degrees
from pathlib import Path

import numpy as np
import pytest

from worlds.build import build_world
from worlds.errors import ScenarioError
from worlds.scenario import Scenario, SoilChoice, SoilPatch, Terrain, dump_scenario, load_scenario
from worlds.soil import PRESETS
from worlds.soil_file import load_soil

OWN = """
cohesive_modulus = 990.0
frictional_modulus = 1528430.0
sinkage_exponent = 1.1
cohesion_Pa = 1040.0
friction_angle_deg = 28.0
shear_modulus_m = 0.02
"""


def own_soil(folder: Path, text: str = OWN) -> str:
    path = folder / "my-sand.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_soil_of_ones_own_has_the_values_of_its_file(tmp_path: Path) -> None:
    soil = load_soil(own_soil(tmp_path))
    assert soil.name == "my-sand"
    assert (soil.cohesive_modulus, soil.frictional_modulus, soil.cohesion_Pa) == (990.0, 1528430.0, 1040.0)
    assert degrees(soil.friction_angle_rad) == pytest.approx(28.0)
    assert soil.stress_peak_offset == 0.4


def test_presets_are_found_by_name() -> None:
    assert load_soil("dry_sand") is PRESETS["dry_sand"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("cohesive_modulus = -990.0", "cohesive_modulus = -990: allowed are 0 to 1e+09"),
        ("frictional_modulus = -1.0", "frictional_modulus = -1: allowed are 0 to 1e+10"),
        ("friction_angle_deg = 90.0", "friction_angle_deg = 90: allowed are 0 to 60"),
        ("friction_angle_deg = nan", "friction_angle_deg = nan: must be a finite number"),
        ("shear_modulus_m = 0.0", "shear_modulus_m = 0: allowed are 1e-05 to 1"),
        ("shear_modulus_m = -0.01", "shear_modulus_m = -0.01: allowed are 1e-05 to 1"),
        ("sinkage_exponent = 0.0", "sinkage_exponent = 0: allowed are 0.05 to 3"),
        ("cohesion_Pa = -5.0", "cohesion_Pa = -5: allowed are 0 to 1e+06"),
        ('cohesion_Pa = "much"', 'cohesion_Pa = "much": expected a number, got text'),
        ("kohesion_Pa = 5.0", "kohesion_Pa = 5.0: unknown key; did you mean 'cohesion_Pa'?"),
    ],
)
def test_soils_that_cannot_be_are_one_line(tmp_path: Path, line: str, words: str) -> None:
    key = line.split(" =", maxsplit=1)[0]
    text = "\n".join(line if row.startswith(key) else row for row in OWN.splitlines())
    path = own_soil(tmp_path, text if line in text else f"{text}\n{line}\n")
    with pytest.raises(ScenarioError) as caught:
        load_soil(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_soils_without_stiffness_or_strength_are_refused(tmp_path: Path) -> None:
    limp = OWN.replace("990.0", "0.0").replace("1528430.0", "0.0")
    with pytest.raises(ScenarioError, match="frictional_modulus = 0: one of cohesive_modulus and it must be above 0"):
        load_soil(own_soil(tmp_path, limp))
    weak = OWN.replace("1040.0", "0.0").replace("28.0", "0.0")
    with pytest.raises(ScenarioError, match="friction_angle_deg = 0: one of cohesion_Pa and it must be above 0"):
        load_soil(own_soil(tmp_path, weak))


def test_a_missing_key_and_a_missing_file_are_said(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="cohesion_Pa: this key is required"):
        load_soil(own_soil(tmp_path, OWN.replace("cohesion_Pa = 1040.0", "")))
    with pytest.raises(ScenarioError, match=r"soil.preset = 'none\.toml': no such soil file"):
        load_soil("none.toml")


def test_a_scenario_names_its_soil_file_relative_to_itself(tmp_path: Path) -> None:
    own_soil(tmp_path)
    path = tmp_path / "world.toml"
    path.write_text('name = "w"\n[soil]\npreset = "my-sand.toml"\n', encoding="utf-8")
    scenario = load_scenario(str(path))
    assert scenario.soil.preset == str(tmp_path / "my-sand.toml")
    again = tmp_path / "again"
    again.mkdir()
    (again / "copy.toml").write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(str(again / "copy.toml")) == scenario


def patched(*patches: SoilPatch) -> Scenario:
    return Scenario(
        name="patched",
        terrain=Terrain(kind="flat", size_m=(24.0, 8.0), resolution_m=0.5),
        soil=SoilChoice(preset="firm", patch=patches),
    )


def test_patches_lie_where_they_are_said_and_later_ones_on_top() -> None:
    disc = SoilPatch(kind="disc", preset="snow", position_m=(10.0, 0.0), radius_m=1.0)
    bar = SoilPatch(kind="rectangle", preset="mars_sand", position_m=(10.0, 0.0), size_m=(4.0, 1.0), yaw_deg=90.0)
    world = build_world(patched(disc, bar), 0)
    assert world.soil.name == "firm"
    assert world.soil_map is not None
    assert [soil.name for soil in world.soil_map.soils] == ["firm", "snow", "mars_sand"]

    def name_at(x: float, y: float) -> str:
        column, row = round((x - world.ground.origin_m[0]) / 0.5), round((y - world.ground.origin_m[1]) / 0.5)
        assert world.soil_map is not None
        return str(world.soil_map.soils[world.soil_map.index[row, column]].name)

    assert name_at(10.0, 0.0) == "mars_sand"
    assert name_at(10.0, 2.0) == "mars_sand"  # the bar lies along y
    assert name_at(11.0, 0.0) == "snow"
    assert name_at(12.0, 0.0) == "firm"
    assert name_at(10.0, 2.5) == "firm"


def test_a_world_of_one_soil_has_no_map() -> None:
    assert build_world(patched(), 0).soil_map is None


def test_patches_of_one_soil_share_it() -> None:
    discs = [SoilPatch(kind="disc", preset="snow", position_m=(x, 0.0), radius_m=1.0) for x in (5.0, 10.0)]
    world = build_world(patched(*discs), 0)
    assert world.soil_map is not None
    assert len(world.soil_map.soils) == 2
    assert np.count_nonzero(world.soil_map.index) == 2 * 13  # points of a grid of half a metre within one metre


@pytest.mark.parametrize(
    ("patch", "words"),
    [
        (SoilPatch(kind="disc", preset="firm", position_m=(0.0, 0.0)), r"soil\.patch\[0\]\.radius_m: this key is req"),
        (
            SoilPatch(kind="rectangle", preset="firm", position_m=(0.0, 0.0), radius_m=1.0, size_m=(1.0, 1.0)),
            r"soil\.patch\[0\]\.radius_m: a rectangle has size_m",
        ),
        (SoilPatch(kind="disc", preset="mud", position_m=(0.0, 0.0), radius_m=1.0), "'mud': unknown soil; allowed: "),
        (SoilPatch(kind="disc", preset="firm", position_m=(0.0, 0.0), radius_m=-1.0), "radius_m = -1: allowed are"),
        (SoilPatch(kind="disc", preset="firm", position_m=(99.0, 0.0), radius_m=1.0), "covers no point of the map"),
    ],
)
def test_wrong_patches_are_one_line(patch: SoilPatch, words: str) -> None:
    with pytest.raises(ScenarioError, match=words) as caught:
        build_world(patched(patch), 0)
    assert "\n" not in str(caught.value)
