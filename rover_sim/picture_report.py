"""All that `perceive` makes of one picture: the files, and the line that sums them up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import Perception, View, by_two_eyes, examine, on_ground
from rover_sim.camera_file import CameraFile, baseline_m, camera_view, default_camera
from rover_sim.errors import InputError
from rover_sim.files import atomic_path, write_json, write_text
from rover_sim.given_way import Way
from rover_sim.picture_paths import GOAL_RANGE_M, PicturePath, picture_paths
from rover_sim.picture_result import result_table, verification_table
from rover_sim.pictures import read_picture
from rover_sim.report.perceived_overlay import draw_overlay
from rover_sim.report.virtual_terrain import terrain_glb
from rover_sim.sim.rover import load_rover
from rover_sim.verdict import Verdict
from rover_sim.verify import Check, drive_way
from rover_sim.virtual_terrain import unseen_m, virtual_scenario, way_ahead
from worlds.build import build_world
from worlds.geometry import to_sun
from worlds.scenario import dump_scenario
from worlds.types import ByteArray, Footprint

ROVER = "husky"
SEED = 0  # of the sensors' noise in a verification


@dataclass(frozen=True)
class Order:
    """What is asked for of every picture."""

    folder: Path
    knowledge: str
    camera: CameraFile | None
    verify: bool = False
    right: Path | None = None  # picture of a second camera
    sun_deg: tuple[float, float] | None = None  # elevation, and azimuth from where the camera looks


@dataclass(frozen=True)
class Report:
    """What one picture came to; ``fault`` is the line of one that could not be read."""

    line: str = ""
    fault: str = ""
    verified: int = 0  # paths


@dataclass(frozen=True, eq=False)
class _Scene:
    """One picture, what it showed and what was planned in it."""

    path: Path
    target: Path  # folder and stem of its files
    found: Perception
    view: View
    paths: tuple[PicturePath, ...]
    footprint: Footprint
    reach_m: float

    def file(self, ending: str) -> Path:
        """One of its files."""
        return self.target.with_name(f"{self.target.name}{ending}")


def report_picture(order: Order, path: Path) -> Report:
    """Write all results of one picture; a picture that cannot be read makes a fault."""
    try:
        picture = read_picture(path)
        size = (picture.shape[1], picture.shape[0])
        view = _under_sun(camera_view(order.camera or default_camera(size), size, str(path)), order.sun_deg)
        right = _second_picture(order.right, picture, path) if order.right else None
    except InputError as error:
        return Report(fault=str(error))
    scene = _look(order, path, picture, right, view)
    table = {
        "image": path.name,
        "sun_deg": order.sun_deg,
        **result_table(scene.found, scene.paths, size, order.camera, _knowledge(order.knowledge).name),
    }
    _write_terrain(scene)
    checks: list[Check] = []
    if order.verify:
        checks, under = _check(scene)
        table["verification"] = verification_table(ROVER, checks, under, metric=order.camera is not None)
    pixels = [item.points_px for item in scene.paths]
    overlay = draw_overlay(picture, scene.found, pixels, [check.verdict for check in checks])
    mask = cv2.resize(scene.found.mask * np.uint8(255), size, interpolation=cv2.INTER_NEAREST)
    _write_png(scene.file("_rocks.png"), np.asarray(mask, dtype=np.uint8))
    _write_png(scene.file("_overlay.png"), overlay[..., ::-1])
    scene.file("_verify.png").unlink(missing_ok=True)  # an earlier run's says nothing of this one
    if order.verify:
        _write_map(scene, overlay, checks, known_camera=order.camera is not None)
    write_json(scene.file(".json"), table)
    return Report(_line(scene, checks if order.verify else None), verified=_count(checks))


def _under_sun(view: View, sun_deg: tuple[float, float] | None) -> View:
    return view if sun_deg is None else replace(view, to_sun_w=to_sun(sun_deg[1], sun_deg[0]))


def _second_picture(path: Path, left: ByteArray, left_path: Path) -> ByteArray:
    right = read_picture(path)
    if right.shape[:2] != left.shape[:2]:
        sizes = f"is {right.shape[1]} x {right.shape[0]} px, {left_path} is {left.shape[1]} x {left.shape[0]}"
        raise InputError(f"{path}: {sizes}; both pictures of a pair must have one size")
    return right


@cache
def _knowledge(name: str) -> Knowledge:
    return load_knowledge(name)


def _look(order: Order, path: Path, picture: ByteArray, right: ByteArray | None, view: View) -> _Scene:
    """What a picture shows, with the help of a second one where there is one, and paths in it."""
    knowledge, footprint = _knowledge(order.knowledge), load_rover(ROVER).footprint()
    # An assumed camera knows nothing of this picture's horizon.
    seen = examine(picture, knowledge, view if order.camera else None)
    if right is None:
        found = on_ground(seen, view, 0.0, knowledge)
    else:
        found = by_two_eyes(seen, view, (picture, right), baseline_m(order.camera), 0.0, knowledge)
    assert found.observation is not None
    paths = picture_paths(found.observation, view, footprint)
    return _Scene(path, order.folder / path.stem, found, view, paths, footprint, knowledge.ground.max_range_m)


def _write_terrain(scene: _Scene) -> None:
    """The virtual terrain model as glTF and as a scenario."""
    found, view = scene.found, scene.view
    with atomic_path(scene.file("_terrain.glb")) as temporary:
        temporary.write_bytes(terrain_glb(found, view, [path.points_w for path in scene.paths], scene.reach_m))
    # Without a path the goal is what could not be reached, so that `run` can try it from nearer.
    way = scene.paths[0].whole_w if scene.paths else way_ahead(found, view, GOAL_RANGE_M)
    scenario, _ = virtual_scenario(scene.path.stem, found, view, ROVER, scene.footprint, way, scene.reach_m)
    write_text(scene.file("_scenario.toml"), dump_scenario(scenario))


def _check(scene: _Scene) -> tuple[list[Check], tuple[int, ...]]:
    """Every path driven through the virtual terrain, and the rocks left out of it."""
    found, view, rover = scene.found, scene.view, load_rover(ROVER)
    checks: list[Check] = []
    under: tuple[int, ...] = ()
    for path in scene.paths:
        scenario, under = virtual_scenario(
            scene.path.stem, found, view, ROVER, scene.footprint, path.whole_w, scene.reach_m
        )
        points = tuple((float(x), float(y)) for x, y in path.whole_w)
        drive = drive_way(build_world(scenario, SEED), rover, Way(points, path.traversability))
        checks.append(Check(drive, unseen_m(found, view, drive.track_w, scene.reach_m)))
    return checks, under


def _write_map(scene: _Scene, overlay: ByteArray, checks: Sequence[Check], *, known_camera: bool) -> None:
    from rover_sim.report.verify_map import save_verify_map

    scale = "camera file" if known_camera else "assumed camera: the scale is a guess"
    title = f"{scene.path.name}: {_count(checks)} of {len(checks)} paths verified ({scale})"
    driven = [(path.whole_w, check) for path, check in zip(scene.paths, checks, strict=True)]
    save_verify_map(
        scene.file("_verify.png"), overlay, scene.found, scene.view, driven, scene.footprint, scene.reach_m, title
    )


def _write_png(path: Path, picture: ByteArray) -> None:
    with atomic_path(path) as temporary:
        temporary.write_bytes(cv2.imencode(".png", picture)[1].tobytes())


def _line(scene: _Scene, checks: Sequence[Check] | None) -> str:
    letters = "".join(scene.found.classes.ravel().tolist())
    counts = " ".join(f"{letter} {letters.count(letter)}" for letter in "SVmMBU" if letter in letters)
    line = f"{scene.path.name}: {len(scene.found.rocks)} rocks, {len(scene.paths)} paths, classes {counts}"
    if checks is None:
        return line
    return f"{line}; {', '.join(map(_verdict, range(1, len(checks) + 1), checks)) or 'no path is free'}"


def _verdict(number: int, check: Check) -> str:
    """What became of a path, in a few words."""
    why = {
        Verdict.VERIFIED: "",
        Verdict.UNSEEN: f" ({check.unseen_m:.1f} m over ground that is not seen)",
        Verdict.FAILED: f" ({check.fault})",
    }
    return f"path {number} {check.verdict.value}{why[check.verdict]}"


def _count(checks: Sequence[Check]) -> int:
    return sum(check.verdict is Verdict.VERIFIED for check in checks)
