"""The folder of a run exports its world with the ruts; readers see only the files."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from rover_sim.cli import main
from rover_sim.export.rut_surface import press_ruts
from rover_sim.sim.rover import load_rover
from rover_sim.sim.ruts import SavedRuts
from rover_sim.sim.simulation import Simulation
from worlds.build import build_world
from worlds.heightfield import height_at
from worlds.scenario import Goal, Rocks, Scenario, SoilChoice, Terrain, dump_scenario
from worlds.types import FloatArray, HeightField, World

CROP = (-2.0, -2.0, 2.0, 2.0)


@pytest.fixture(scope="module")
def world() -> World:
    terrain = Terrain(size_m=(12.0, 8.0), resolution_m=0.08, roughness_m=0.05)
    rocks = Rocks(cfa=0.02, min_diameter_m=0.15)
    soil = SoilChoice(preset="loose_sand")
    return build_world(
        Scenario(name="tiny", terrain=terrain, rocks=rocks, soil=soil, goal=Goal(position_m=(5.0, 0.0))), 3
    )


@pytest.fixture(scope="module")
def run(world: World, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a run leaves of its world, after a bend of two seconds."""
    folder = tmp_path_factory.mktemp("run")
    with Simulation(world, load_rover("husky"), np.random.default_rng(0)) as simulation:
        for _ in range(480):
            simulation.step([1.0, 1.0, 3.0, 3.0])
        assert simulation.ruts is not None
        simulation.ruts.copy().save(folder / "ruts.npz")
    (folder / "scenario.toml").write_text(dump_scenario(world.scenario))
    (folder / "summary.json").write_text(json.dumps({"seed": 3}))
    return folder


def texels(run: Path) -> tuple[FloatArray, FloatArray, float]:
    """Middles (N, 2) and depths (N,) of all texels, and their side, out of the file itself."""
    with np.load(run / "ruts.npz") as data:
        side, size = float(data["texel_m"]), data["depth_m"].shape[1]
        within = (np.arange(size) + 0.5) * side
        places = []
        for row, column in data["tile"]:
            x = data["origin_m"][0] + column * size * side + within
            y = data["origin_m"][1] + row * size * side + within
            places.append(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
        return np.concatenate(places), data["depth_m"].reshape(-1).astype(float), side


def export(run: Path, kind: str, out: Path, *more: str) -> None:
    assert main(["world", "export", str(run), "--format", kind, "--out", str(out), *more]) == 0


def assert_shows_the_ruts(points: FloatArray, world: World, run: Path) -> None:
    """A vertex on a corner of texels lies below the natural ground by the mean of the four around it."""
    places, depths, side = texels(run)
    sunk = height_at(world.ground, points[:, 0], points[:, 1]) - points[:, 2]
    assert np.diff(np.unique(points[:, 0].round(5)))[0] == pytest.approx(side, abs=1e-4)
    assert sunk.max() > 0.005
    assert sunk.min() < -0.001  # soil was piled up
    assert sunk.sum() == pytest.approx(depths.sum(), rel=0.01)
    for vertex in np.argsort(-np.abs(sunk))[:40]:
        around = np.all(np.abs(places - points[vertex, :2]) < side, axis=1)
        assert around.sum() == 4
        assert sunk[vertex] == pytest.approx(depths[around].mean(), abs=2e-4)


def test_meshes_are_as_fine_as_the_ruts(
    run: Path, world: World, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export(run, "sdf", tmp_path)
    assert "one height every 0.02 m" in capsys.readouterr().out
    mesh = trimesh.load_mesh(tmp_path / "ground.obj", process=False)
    assert_shows_the_ruts(np.asarray(mesh.vertices), world, run)
    export(run, "gltf", tmp_path, "--crop", "-2", "-2", "2", "2")
    vertices = trimesh.load_scene(tmp_path / "world.glb").geometry["ground"].vertices
    assert np.ptp(vertices[:, [0, 2]], axis=0) == pytest.approx([3.92, 3.92], abs=0.09)
    assert_shows_the_ruts(vertices[:, [0, 2, 1]] * (1, -1, 1), world, run)


def test_a_height_map_holds_the_volume_of_the_ruts(run: Path, world: World, tmp_path: Path) -> None:
    export(run, "heightmap", tmp_path)
    about = json.loads((tmp_path / "heightmap.json").read_text())
    grey = cv2.imread(str(tmp_path / "heightmap.png"), cv2.IMREAD_UNCHANGED)
    assert grey is not None
    heights = about["offset_m"] + about["scale_m"] * grey[::-1].astype(float)
    (x0, x1), (y0, y1) = about["x_limits_m"], about["y_limits_m"]
    x, y = np.linspace(x0, x1, len(heights)), np.linspace(y0, y1, len(heights))
    sunk = height_at(world.ground, x[None, :], y[:, None]) - heights
    _, depths, side = texels(run)
    assert sunk.sum() * (x[1] - x[0]) * (y[1] - y[0]) == pytest.approx(depths.sum() * side**2, rel=0.02)


def test_coarse_ground_keeps_the_volume_of_the_ruts() -> None:
    ground = HeightField(np.zeros((401, 401)), 0.1, (0.0, 0.0))
    depth = np.random.default_rng(0).uniform(0.0, 0.1, (1, 64, 64)).astype(np.float32)
    ruts = SavedRuts(depth, np.array([[10, 12]], dtype=np.int32), 0.02, (0.0, 0.0))
    for most, cell in ((4_000_000, 0.02), (400_000, 0.1), (20_000, 0.3)):
        pressed = press_ruts(ground, ruts, most)
        assert pressed.resolution_m == pytest.approx(cell)
        assert -pressed.heights_m.sum() * cell**2 == pytest.approx(depth.sum() * 0.02**2, rel=1e-5)
        rows, columns = np.nonzero(pressed.heights_m)
        assert columns.min() * cell == pytest.approx(12 * 64 * 0.02, abs=cell)
        assert rows.max() * cell == pytest.approx(11 * 64 * 0.02, abs=cell)


def test_faults_name_the_file(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def fault(*words: str) -> str:
        assert main(["world", "export", *words, "--format", "sdf", "--out", str(tmp_path / "out")]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        return error

    assert "was on seed 3" in fault(str(run), "--seed", "4")
    other = tmp_path / "other"
    other.mkdir()
    text = (run / "scenario.toml").read_text()
    (other / "scenario.toml").write_text(text)
    assert "summary.json: the seed of the run cannot be read" in fault(str(other))
    (other / "summary.json").write_text('{"seed": 3}')
    (other / "ruts.npz").write_text("nothing")
    assert "ruts.npz: no ruts of a run" in fault(str(other))
    (other / "ruts.npz").write_bytes((run / "ruts.npz").read_bytes())
    (other / "scenario.toml").write_text(text.replace("size_m = [12.0, 8.0]", "size_m = [13.0, 8.0]"))
    assert "do not belong to the ground" in fault(str(other))


def test_a_run_without_ruts_is_its_bare_world(run: Path, world: World, tmp_path: Path) -> None:
    for name in ("scenario.toml", "summary.json"):
        (tmp_path / name).write_text((run / name).read_text())
    export(tmp_path, "urdf", tmp_path / "out")
    mesh = trimesh.load_mesh(tmp_path / "out" / "ground.obj", process=False)
    expected = height_at(world.ground, mesh.vertices[:, 0], mesh.vertices[:, 1])
    assert np.abs(mesh.vertices[:, 2] - expected).max() < 1e-3
