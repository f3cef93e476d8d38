from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from rover_sim.commands import world as command
from rover_sim.errors import InputError
from rover_sim.report.ground_map import draw_close_up, draw_ground, draw_scale
from worlds.build import build_world
from worlds.scenario import Obstacle, Scenario, Terrain, load_scenario

TEXT = """
name = "tiny yard"
[terrain]
size_m = [12.0, 8.0]
resolution_m = 0.1
[goal]
position_m = [6.0, 0.0]
[[obstacle]]
kind = "cylinder"
position_m = [3.0, 2.0]
radius_m = 0.1
height_m = 1.0
"""


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    command.configure(parser)
    return command.execute(parser.parse_args(words))


@pytest.fixture
def scenario_file(tmp_path: Path) -> str:
    path = tmp_path / "yard.toml"
    path.write_text(TEXT)
    return str(path)


def test_build_writes_the_world_and_prints_its_table(
    tmp_path: Path, scenario_file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("build", scenario_file, "--seed", "3", "--out", str(tmp_path / "out")) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"world.npz", "scenario.toml", "rocks.glb"}
    world = build_world(load_scenario(scenario_file), 3)
    with np.load(tmp_path / "out" / "world.npz") as saved:
        assert np.array_equal(saved["heights_m"], world.ground.heights_m)
        assert saved["rock_position_w"].tolist() == [list(rock.position_w) for rock in world.rocks]
        assert saved["cylinder_size_m"].tolist() == [[0.1, 1.0]]
    again = build_world(load_scenario(str(tmp_path / "out" / "scenario.toml")), 3)
    assert np.array_equal(again.ground.heights_m, world.ground.heights_m)
    printed = capsys.readouterr().out
    for part in ("12.00 x 8.00 m", "121 x 81 of 0.1 m", "bumps of the ground", "mars_sand", "rock cover"):
        assert part in printed


def test_the_glb_holds_the_mesh_with_y_up(tmp_path: Path, scenario_file: str) -> None:
    run("build", scenario_file, "--out", str(tmp_path / "out"))
    mesh = trimesh.load_mesh(tmp_path / "out" / "rocks.glb")
    expected = build_world(load_scenario(scenario_file), 0).picture_mesh
    assert len(mesh.faces) == len(expected.faces)
    assert mesh.bounds[:, 1] == pytest.approx(
        [expected.vertices_m[:, 2].min(), expected.vertices_m[:, 2].max()], abs=1e-5
    )
    assert mesh.volume > 0


def test_show_writes_a_picture(tmp_path: Path, scenario_file: str) -> None:
    target = tmp_path / "new folder" / "yard.png"
    assert run("show", scenario_file, "--out", str(target)) == 0
    assert target.read_bytes()[:4] == b"\x89PNG"


def test_show_wants_a_png_name(tmp_path: Path, scenario_file: str) -> None:
    with pytest.raises(InputError, match=r"--out .*yard\.jpg: must end in \.png"):
        run("show", scenario_file, "--out", str(tmp_path / "yard.jpg"))


def test_a_world_without_rocks_can_be_built_and_shown(tmp_path: Path) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(TEXT.partition("[[obstacle]]")[0] + "[rocks]\ncfa = 0.0\n")
    assert run("build", str(path), "--out", str(tmp_path / "out")) == 0
    assert not (tmp_path / "out" / "rocks.glb").exists()
    assert run("show", str(path), "--out", str(tmp_path / "bare.png")) == 0


def test_the_map_shows_every_rock_start_and_goal() -> None:
    terrain = Terrain(size_m=(30.0, 12.0), resolution_m=0.1)
    rock = Obstacle(kind="rock", position_m=(5.0, 1.0), radius_m=0.4, height_m=0.3, formation=2)
    world = build_world(Scenario(name="map", terrain=terrain, obstacle=(rock,)), 0)
    axes = Figure().add_subplot()
    draw_ground(axes, world)
    draw_scale(axes, world)
    assert [text.get_text() for text in axes.texts] == ["", "5 m"]
    rocks = axes.collections[0].get_paths()
    assert len(rocks) == len(world.rocks)
    assert np.asarray(rocks[0].vertices).mean(axis=0) == pytest.approx([5.0, 1.0], abs=0.15)
    assert axes.get_legend_handles_labels()[1] == ["start", "goal"]


def test_a_part_of_the_map_has_the_rocks_that_reach_into_it() -> None:
    world = build_world(Scenario(name="map", terrain=Terrain(size_m=(30.0, 12.0), resolution_m=0.1)), 0)
    axes = Figure().add_subplot()
    draw_ground(axes, world, (8.0, 12.0, -2.0, 50.0))
    assert (axes.get_xlim(), axes.get_ylim()) == ((8.0, 12.0), (-2.0, 50.0))
    drawn = len(axes.collections[0].get_paths())
    inside = [r for r in world.rocks if 8.0 <= r.position_w[0] <= 12.0 and r.position_w[1] >= -2.0]
    assert len(inside) <= drawn < len(inside) + 20


def test_what_is_too_small_to_see_is_left_out_of_a_large_map(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rover_sim.report.ground_map.FINEST_SHARE", 100)
    monkeypatch.setattr("rover_sim.report.ground_map.MOST_PX", 50)
    world = build_world(Scenario(name="map", terrain=Terrain(size_m=(30.0, 12.0), resolution_m=0.1)), 0)
    axes = Figure().add_subplot()
    draw_ground(axes, world)
    drawn = len(axes.collections[0].get_paths())
    assert drawn == sum(rock.diameter_m >= 0.3 for rock in world.rocks)
    assert max(axes.images[0].get_size()) <= 50


def test_too_many_faces_are_not_written(
    tmp_path: Path, scenario_file: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "MOST_FACES", 10)
    assert run("build", scenario_file, "--out", str(tmp_path / "out")) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"world.npz", "scenario.toml"}
    assert "rocks.glb: not written" in capsys.readouterr().out


def test_the_close_up_holds_only_what_is_near() -> None:
    world = build_world(Scenario(name="near", terrain=Terrain(size_m=(30.0, 12.0), resolution_m=0.1)), 0)
    axes = Figure().add_subplot(projection="3d")
    draw_close_up(axes, world, (10.0, 0.0), 2.0)
    assert axes.get_xlim() == pytest.approx((9.0, 11.0), abs=0.25)
