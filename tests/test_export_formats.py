"""Each export is read back by a reader that knows nothing of how it was written."""

from __future__ import annotations

import json
import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh

from rover_sim.cli import main
from rover_sim.sim.bullet import pybullet
from worlds.build import build_world
from worlds.heightfield import height_at
from worlds.scenario import load_scenario
from worlds.types import FloatArray, World

TEXT = """
name = "tiny yard"
gravity_m_s2 = 1.62
[terrain]
size_m = [12.0, 8.0]
resolution_m = 0.1
roughness_m = 0.2
[rocks]
cfa = 0.04
min_diameter_m = 0.15
[rover]
heading_deg = 30.0
[goal]
position_m = [6.0, 0.0]
[[obstacle]]
kind = "cylinder"
position_m = [3.0, 2.0]
radius_m = 0.1
height_m = 1.0
[sun]
azimuth_deg = 90.0
elevation_deg = 30.0
[origin]
latitude_deg = 10.0
longitude_deg = 20.0
altitude_m = 30.0
"""
OBJ_STEP_M = 1e-4  # of the coordinates in a text file


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("scenario") / "yard.toml"
    path.write_text(TEXT)
    return str(path)


@pytest.fixture(scope="module")
def world(scenario_file: str) -> World:
    return build_world(load_scenario(scenario_file), 3)


def export(scenario_file: str, kind: str, out: Path, *more: str) -> Path:
    assert main(["world", "export", scenario_file, "--format", kind, "--seed", "3", "--out", str(out), *more]) == 0
    return out


def free_spots(world: World, count: int = 60) -> FloatArray:
    """Places (N, 2) on the map with no rock or cylinder over them."""
    spots = np.random.default_rng(0).uniform((-2.9, -3.9), (8.9, 3.9), (4 * count, 2))
    low, high = world.shapes.bounds_w
    inside = (spots[:, None] > low[:, :2] - 0.1) & (spots[:, None] < high[:, :2] + 0.1)
    over_rock = np.any(np.all(inside, axis=2), axis=1)
    return np.asarray(spots[~over_rock][:count])


def assert_is_the_ground(mesh: trimesh.Trimesh, world: World, step_m: float) -> None:
    heights = np.asarray(world.ground.heights_m)
    assert len(mesh.vertices) == heights.size
    expected = height_at(world.ground, mesh.vertices[:, 0], mesh.vertices[:, 1])
    assert np.abs(mesh.vertices[:, 2] - expected).max() <= 0.6 * step_m + 1e-9
    assert (mesh.face_normals[:, 2] > 0).all()
    assert mesh.triangles_cross[:, 2].sum() / 2 == pytest.approx(12.0 * 8.0, rel=1e-4)


def assert_are_the_rocks(mesh: trimesh.Trimesh, world: World, count: int) -> None:
    assert mesh.is_watertight
    assert mesh.volume > 0
    assert mesh.body_count == count
    expected = world.picture_mesh.vertices_m
    assert mesh.bounds == pytest.approx(np.array([expected.min(axis=0), expected.max(axis=0)]), abs=0.05)


def test_sdf(scenario_file: str, world: World, tmp_path: Path) -> None:
    root = ET.parse(export(scenario_file, "sdf", tmp_path / "out") / "world.sdf").getroot()  # noqa: S314 - our own file
    top = root.find("world")
    assert root.tag == "sdf"
    assert top is not None
    assert top.findtext("gravity") == "0 0 -1.62"
    assert [top.findtext(f"spherical_coordinates/{key}") for key in ("latitude_deg", "longitude_deg", "elevation")] == [
        "10.0",
        "20.0",
        "30",
    ]
    # Light from the north, 30 degrees high, goes south and down.
    direction = [float(word) for word in (top.findtext("light/direction") or "").split()]
    assert direction == pytest.approx([0.0, -np.cos(np.pi / 6), -0.5], abs=1e-6)
    frames = {item.get("name"): [float(w) for w in (item.findtext("pose") or "").split()] for item in top.iter("frame")}
    assert frames["start"] == pytest.approx([*world.start.position_w, 0.0, 0.0, np.radians(30.0)], abs=1e-5)
    assert frames["goal"][:3] == pytest.approx(world.goal_w, abs=1e-5)
    models = {item.get("name"): item for item in top.iter("model")}
    assert set(models) == {"ground", "rocks"}
    assert all(model.findtext("static") == "true" for model in models.values())
    for kind in ("visual", "collision"):
        files = {name: model.findtext(f"link/{kind}/geometry/mesh/uri") or "" for name, model in models.items()}
        meshes = {name: trimesh.load_mesh(tmp_path / "out" / file, process=False) for name, file in files.items()}
        assert_is_the_ground(meshes["ground"], world, OBJ_STEP_M)
        assert_are_the_rocks(meshes["rocks"], world, len(world.rocks) + 1)


@pytest.fixture
def client() -> Iterator[int]:
    number = pybullet.connect(pybullet.DIRECT)
    yield number
    pybullet.disconnect(physicsClientId=number)


def test_urdf_in_pybullet(scenario_file: str, world: World, tmp_path: Path, client: int) -> None:
    path = export(scenario_file, "urdf", tmp_path / "out") / "world.urdf"
    body = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
    assert pybullet.getNumJoints(body, physicsClientId=client) == 1

    def height(x: float, y: float) -> float:
        return float(pybullet.rayTest([x, y, 9.0], [x, y, -9.0], physicsClientId=client)[0][3][2])

    for x, y in free_spots(world):
        # Two triangles a cell and the bilinear surface differ by at most the twist of a cell.
        assert height(x, y) == pytest.approx(float(height_at(world.ground, x, y)), abs=0.004)
    assert height(3.0, 2.0) == pytest.approx(float(height_at(world.ground, 3.0, 2.0)) + 1.0, abs=1e-3)
    tall = max(world.rocks, key=lambda rock: rock.height_m)
    assert height(*tall.position_w[:2]) > tall.position_w[2] + 0.5 * tall.height_m
    # Contact follows the ground too, not its convex hull: a ball let go over it comes to rest on it.
    x, y = free_spots(world)[0]
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.05, physicsClientId=client)
    ball = pybullet.createMultiBody(1.0, shape, basePosition=[x, y, height(x, y) + 0.1], physicsClientId=client)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    for _ in range(60):
        pybullet.stepSimulation(physicsClientId=client)
    place = pybullet.getBasePositionAndOrientation(ball, physicsClientId=client)[0]
    assert place[2] == pytest.approx(float(height_at(world.ground, *place[:2])) + 0.05, abs=0.02)


def test_urdf_in_mujoco(scenario_file: str, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    model = mujoco.MjModel.from_xml_path(str(export(scenario_file, "urdf", tmp_path / "out") / "world.urdf"))
    assert model.nmesh >= 2
    assert model.nv == 0  # nothing moves


def read_glb(path: Path) -> dict[str, tuple[FloatArray, Any]]:
    """Positions (V, 3) and indices of each mesh by name, by the specification of glTF 2.0 alone."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data, 0)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    tree = json.loads(data[20 : 20 + size])
    binary = data[20 + size + 8 :]

    def values(index: int) -> Any:
        accessor = tree["accessors"][index]
        view = tree["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        numbers = {5125: np.uint32, 5126: np.float32}[accessor["componentType"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return np.frombuffer(binary, numbers, width * accessor["count"], start).reshape(-1, width)

    meshes = {}
    for node in tree["nodes"]:
        if "mesh" in node:
            assert node.get("matrix", np.eye(4).ravel().tolist()) == np.eye(4).ravel().tolist()
            (part,) = tree["meshes"][node["mesh"]]["primitives"]
            positions = values(part["attributes"]["POSITION"]).astype(float)
            meshes[node["name"]] = (positions, values(part["indices"]).reshape(-1, 3))
    return meshes


def test_gltf(scenario_file: str, world: World, tmp_path: Path) -> None:
    meshes = read_glb(export(scenario_file, "gltf", tmp_path / "out") / "world.glb")
    assert set(meshes) == {"ground", "rocks"}
    # From y up back to z up.
    solids = {
        name: trimesh.Trimesh(points[:, [0, 2, 1]] * (1, -1, 1), faces, process=False)
        for name, (points, faces) in meshes.items()
    }
    assert_is_the_ground(solids["ground"], world, 1e-5)
    assert_are_the_rocks(solids["rocks"], world, len(world.rocks) + 1)
    assert len(solids["rocks"].faces) == len(world.picture_mesh.faces)


def test_heightmap(scenario_file: str, world: World, tmp_path: Path) -> None:
    out = export(scenario_file, "heightmap", tmp_path / "out")
    about = json.loads((out / "heightmap.json").read_text())
    grey = cv2.imread(str(out / about["picture"]), cv2.IMREAD_UNCHANGED)
    assert grey is not None
    assert (str(grey.dtype), grey.shape) == ("uint16", (129, 129))  # 120 x 80 cells need 2^7
    assert (grey.min(), grey.max()) == (0, 65535)
    assert about["size_m"][:2] == pytest.approx([12.0, 8.0])
    assert about["size_m"][2] == pytest.approx(float(np.ptp(world.ground.heights_m)), rel=0.02)
    heights = about["offset_m"] + about["scale_m"] * grey[::-1].astype(float)
    x, y = (low + (high - low) * np.arange(129) / 128 for low, high in (about["x_limits_m"], about["y_limits_m"]))
    expected = height_at(world.ground, x[None, :], y[:, None])
    assert np.abs(heights - expected).max() <= 0.5 * about["scale_m"] + 1e-12
    assert (about["latitude_deg"], about["longitude_deg"], about["altitude_m"]) == (10.0, 20.0, 30.0)


def test_a_heightmap_of_a_power_of_two_holds_every_height(tmp_path: Path) -> None:
    path = tmp_path / "even.toml"
    path.write_text(
        'name = "even"\nrocks.cfa = 0.0\nterrain = { size_m = [12.8, 12.8], resolution_m = 0.1 }\n'
        "goal.position_m = [5.0, 0.0]\n"
    )
    out = export(str(path), "heightmap", tmp_path / "out")
    about = json.loads((out / "heightmap.json").read_text())
    grey = cv2.imread(str(out / "heightmap.png"), cv2.IMREAD_UNCHANGED)
    assert grey is not None
    heights = about["offset_m"] + about["scale_m"] * grey[::-1].astype(float)
    expected = build_world(load_scenario(str(path)), 3).ground.heights_m
    assert np.abs(heights - expected).max() <= 0.5 * about["scale_m"] + 1e-12


def test_level_ground_has_a_height_map_too(tmp_path: Path) -> None:
    path = tmp_path / "flat.toml"
    path.write_text('name = "flat"\nrocks.cfa = 0.0\nterrain.kind = "flat"\ngoal.position_m = [5.0, 0.0]\n')
    out = export(str(path), "heightmap", tmp_path / "out")
    about = json.loads((out / "heightmap.json").read_text())
    assert about["offset_m"] == 0.0
    assert about["size_m"][2] > 0.0
    assert not np.asarray(cv2.imread(str(out / "heightmap.png"), cv2.IMREAD_UNCHANGED)).any()
