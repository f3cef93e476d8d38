"""The virtual terrain model: rocks and ground of a picture as a scenario and as glTF, and paths driven in it."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from msgspec import structs

from perception.pipeline import ImageRock, Perception, View, examine, load_knowledge, on_ground
from planner.choice import dense
from rover_sim.camera_file import camera_view, default_camera
from rover_sim.cli import main
from rover_sim.given_way import Way
from rover_sim.picture_paths import picture_paths
from rover_sim.report.perceived_overlay import VERDICT_COLOURS, draw_overlay
from rover_sim.report.virtual_terrain import terrain_glb
from rover_sim.sim.rover import load_rover
from rover_sim.verdict import Verdict
from rover_sim.verify import Check, Drive, cross_track_m, drive_way
from rover_sim.virtual_terrain import (
    FIRM_SOIL,
    SOIL,
    ground_sections,
    placed_rocks,
    unseen_m,
    virtual_scenario,
    way_ahead,
)
from tests.data import data_path
from tests.test_perception_command import CAMERA_TOML, scene, written
from worlds.build import build_world
from worlds.scenario import Goal, Obstacle, Rocks, Scenario, Terrain, dump_scenario, load_scenario
from worlds.types import FloatArray, World

REACH_M = 10.0
ROVER = load_rover("husky")


@pytest.fixture(scope="module")
def seen() -> tuple[Perception, View]:
    view = camera_view(default_camera((320, 240)), (320, 240), "scene")
    knowledge = load_knowledge("mars")
    return on_ground(examine(scene(), knowledge, view), view, 0.0, knowledge), view


def scenario_of(seen: tuple[Perception, View], end: tuple[float, float] = (6.0, 0.0)) -> Scenario:
    way = np.array([[0.0, 0.0], end])
    return virtual_scenario("scene", *seen, "husky", ROVER.footprint(), way, REACH_M)[0]


def test_the_scenario_reads_back_and_builds_the_perceived_rocks(seen: tuple[Perception, View], tmp_path: Path) -> None:
    scenario = scenario_of(seen)
    path = tmp_path / "scene.toml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(str(path)) == scenario
    built = list(build_world(scenario, 0).rocks)
    perceived = list(placed_rocks(*seen))
    assert len(built) == len(perceived) > 0
    for one, other in zip(built, perceived, strict=True):
        assert one.position_w[:2] == pytest.approx(other.position_w[:2], abs=1e-3)
        assert (one.length_m, one.width_m, one.height_m) == pytest.approx(
            (other.length_m, other.width_m, other.height_m), abs=2e-3
        )
        assert one.shape == other.shape
        assert one.yaw_rad == pytest.approx(other.yaw_rad, abs=1e-3)


def test_soil_is_sand_under_s_and_firm_under_stony_classes(seen: tuple[Perception, View]) -> None:
    found, view = seen
    letters = np.full(found.classes.shape, "S")
    letters[8, 4:8] = "m"
    world = build_world(scenario_of((replace(found, classes=letters), view)), 0)
    assert world.soil_map is not None
    assert [soil.name for soil in world.soil_map.soils] == [SOIL, FIRM_SOIL]
    (patch,) = world.scenario.soil.patch
    # The four windows lie left of the middle, at the depth of row 8: pixels 80 to 160 across, 160 to 180 down.
    x, y = patch.position_m
    assert 1.2 < x < 1.6
    assert 0.0 < y < 1.0
    bare = scenario_of((replace(found, classes=np.full(found.classes.shape, "S")), view))
    assert bare.soil.patch == ()


@pytest.mark.parametrize(("axis_deg", "turn_deg", "first"), [(0, 90, 1.0), (170, 90, 0.5), (0, -90, 0.5), (80, 0, 0.5)])
def test_sections_run_along_the_axis_on_the_ground(
    seen: tuple[Perception, View], axis_deg: float, turn_deg: float, first: float
) -> None:
    """A0 is the left probe of a level axis; an axis to the left of the line of sight begins at the right."""
    rock: ImageRock = structs.replace(
        seen[0].rocks[0], axis_rad=np.radians(axis_deg), sections_px=(5.0, *(7.0,) * 7, 10.0)
    )
    assert ground_sections(rock, np.radians(turn_deg))[0] == pytest.approx(first)


def test_sections_of_an_axis_across_the_one_on_the_ground_are_an_ellipse(seen: tuple[Perception, View]) -> None:
    rock = structs.replace(seen[0].rocks[0], axis_rad=np.pi / 2, sections_px=(5.0, *(7.0,) * 7, 10.0))
    sections = ground_sections(rock, np.pi / 2)
    assert sections[4] == 1.0
    assert sections == tuple(reversed(sections))


def test_gltf_holds_ground_classes_rocks_and_paths(seen: tuple[Perception, View]) -> None:
    found, view = seen
    assert found.observation is not None
    paths = picture_paths(found.observation, view, ROVER.footprint())
    data = terrain_glb(found, view, [path.points_w for path in paths], REACH_M)
    model = trimesh.load_scene(io.BytesIO(data), file_type="glb")
    assert set(model.geometry) == {"ground", "classes", "rocks", "paths"}
    rocks = model.geometry["rocks"]
    assert rocks.is_watertight
    (rock,) = placed_rocks(found, view)
    low, high = rocks.bounds
    assert high[1] == pytest.approx(rock.height_m, abs=1e-6)  # y is up
    assert low[0] < rock.position_w[0] < high[0]
    reach = np.hypot(*model.geometry["classes"].vertices[:, [0, 2]].T)
    assert reach.max() == pytest.approx(REACH_M, rel=1e-6)
    for name in ("ground", "classes", "paths"):
        assert (model.geometry[name].face_normals[:, 1] > 0.99).all()


def flat(*obstacles: Obstacle) -> World:
    terrain = Terrain(kind="flat", size_m=(14.0, 10.0), resolution_m=0.1)
    scenario = Scenario(
        name="flat", terrain=terrain, rocks=Rocks(cfa=0.0), obstacle=obstacles, goal=Goal(position_m=(3.0, 0.0))
    )
    return build_world(scenario, 0)


WAY = Way(((0.0, 0.0), (1.5, 0.0), (3.0, 0.0)), 1.0)


def test_a_free_way_is_driven_safely_and_measured() -> None:
    beside = Obstacle(kind="rock", position_m=(1.5, 1.2), radius_m=0.2, height_m=0.3)
    drive = drive_way(flat(beside), ROVER, WAY)
    assert drive.safe
    assert drive.figures["reason"] == "goal"
    assert drive.figures["largest_cross_track_m"] < 0.1
    # Rock edge at y = 1.0, hull to half of its width.
    assert drive.figures["clearance_m"] == pytest.approx(1.0 - ROVER.footprint().width_m / 2, abs=0.05)
    assert drive.track_w[-1] == pytest.approx((3.0, 0.0), abs=0.4)


def test_a_way_through_a_rock_fails() -> None:
    drive = drive_way(flat(Obstacle(kind="rock", position_m=(1.6, 0.0), radius_m=0.4, height_m=0.4)), ROVER, WAY)
    assert not drive.safe
    assert drive.figures["reason"] != "goal" or drive.figures["collisions"] > 0
    assert drive.figures["clearance_m"] < 0.05


def test_cross_track_is_the_distance_from_the_nearest_leg() -> None:
    way = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    places = np.array([[1.0, 0.3], [2.5, 1.0], [-1.0, 0.0], [2.0, 2.0]])
    assert cross_track_m(places, way) == pytest.approx([0.3, 0.5, 1.0, 0.0])


def test_verify_end_to_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture, camera = written(tmp_path / "a.png", scene()), tmp_path / "camera.toml"
    camera.write_text(CAMERA_TOML, encoding="utf-8")
    out = tmp_path / "out"
    assert main(["perceive", str(picture), "--camera", str(camera), "--verify", "--out", str(out)]) == 0
    table = json.loads((out / "a.json").read_text(encoding="utf-8"))
    told = table["verification"]
    assert told["scale"] == "camera"
    assert told["best_verified_path"] == 0
    assert [item["path"] for item in told["paths"]] == list(range(len(table["waypoints"])))
    first = told["paths"][0]
    assert first["verdict"] == "verified"
    assert first["distance_m"] == pytest.approx(7.0, abs=1.0)
    assert {"fault", "max_tilt_deg", "min_stability_margin", "mean_slip", "max_sinkage_m", "energy_J"} <= set(first)
    assert (out / "a_verify.png").stat().st_size > 10_000
    assert "path 1 verified" in capsys.readouterr().out


def test_verify_without_a_camera_names_the_one_assumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = written(tmp_path / "a.png", np.zeros((240, 320), dtype=np.uint8))
    assert main(["perceive", str(picture), "--verify", "--out", str(tmp_path / "out")]) == 1
    told = capsys.readouterr()
    assert "75.2 deg across, 25 deg down and 1.1 m above level ground" in told.err
    assert "over ground that is not seen" in told.out
    table = json.loads((tmp_path / "out" / "a.json").read_text(encoding="utf-8"))
    assert table["verification"]["scale"] == "assumed"
    assert table["verification"]["best_verified_path"] is None


def test_a_plan_from_a_real_picture_is_driven(tmp_path: Path) -> None:
    picture = data_path("mars", "nav", "ai4mars_3265.png")
    assert main(["perceive", str(picture), "--verify", "--out", str(tmp_path)]) in {0, 1}
    table = json.loads((tmp_path / "ai4mars_3265.json").read_text(encoding="utf-8"))
    assert len(table["verification"]["paths"]) == len(table["waypoints"]) > 0
    scenario = load_scenario(str(tmp_path / "ai4mars_3265_scenario.toml"))
    placed = sum(item.kind == "rock" for item in scenario.obstacle)
    assert 0 < placed <= len(table["rocks"])


def track(*corners: tuple[float, float]) -> FloatArray:
    return dense(np.array(corners), 0.05)


def test_unseen_ground_is_what_the_picture_does_not_show(seen: tuple[Perception, View]) -> None:
    found, view = seen
    assert unseen_m(found, view, track((0.0, 0.0), (6.0, 0.0)), REACH_M) == 0.0
    # Sideways nothing is in view; the first metre is where the rover was set down.
    assert unseen_m(found, view, track((0.0, 0.0), (0.0, 4.0)), REACH_M) == pytest.approx(3.0, abs=0.06)
    assert unseen_m(found, view, track((0.0, 0.0), (12.0, 0.0)), REACH_M) == pytest.approx(2.0, abs=0.06)
    unknown = replace(found, classes=np.full(found.classes.shape, "U"))
    assert unseen_m(unknown, view, track((0.0, 0.0), (6.0, 0.0)), REACH_M) == pytest.approx(5.0, abs=0.06)


@pytest.mark.parametrize(
    ("safe", "changed", "unseen", "verdict", "fault"),
    [
        (True, {}, 0.0, "verified", ""),
        (True, {}, 0.3, "unseen", ""),
        (True, {"clearance_m": -0.01}, 0.0, "failed", "over a rock too high to climb"),
        (False, {"reason": "timeout"}, 0.0, "failed", "timeout"),
        (False, {"violations": ["collision", "belly"]}, 0.3, "failed", "collision, belly"),
        (False, {"max_tilt_deg": 31.0}, 0.0, "failed", "leaned too far"),
    ],
)
def test_verdicts(safe: bool, changed: dict[str, object], unseen: float, verdict: str, fault: str) -> None:
    figures = {"reason": "goal", "violations": [], "max_tilt_deg": 3.0, "clearance_m": None}
    check = Check(Drive(safe, figures | changed, np.zeros((1, 2))), unseen)
    assert (check.verdict.value, check.fault) == (verdict, fault)


def test_without_a_path_the_goal_lies_on_no_rock(seen: tuple[Perception, View]) -> None:
    found, view = seen
    (rock,) = found.rocks
    assert rock.placed is not None
    in_the_way = structs.replace(rock, placed=structs.replace(rock.placed, position_w=(8.0, 0.0, 0.0), length_m=1.4))
    assert way_ahead(found, view, 8.0)[-1] == pytest.approx((8.0, 0.0))
    assert way_ahead(replace(found, rocks=(in_the_way,)), view, 8.0)[-1] == pytest.approx((7.25, 0.0))


@pytest.mark.parametrize(
    ("size", "drawn"),
    [((320, 240), (960, 720)), ((1200, 900), (1200, 900)), ((500, 1), (1000, 2)), ((1, 500), (3, 1500))],
)
def test_the_overlay_has_the_size_of_the_picture_or_a_whole_multiple(
    seen: tuple[Perception, View], size: tuple[int, int], drawn: tuple[int, int]
) -> None:
    found, _ = seen
    picture = np.full((size[1], size[0], 3), 120, dtype=np.uint8)
    overlay = draw_overlay(picture, found, [np.array([[0.0, 0.0], [10.0, 10.0]])], [Verdict.VERIFIED])
    assert overlay.shape[1] == drawn[0]
    assert overlay.shape[0] > drawn[1]  # the legend is below
    assert (overlay == VERDICT_COLOURS[Verdict.VERIFIED]).all(axis=2).any() or min(size) == 1
