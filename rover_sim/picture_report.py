"""All that `perceive` makes of one picture: the files, and the line that sums them up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from perception.knowledge_base import Knowledge, load_knowledge
from perception.pipeline import Perception, View, examine, on_ground
from rover_sim.camera_file import CameraFile, camera_view, default_camera
from rover_sim.errors import InputError
from rover_sim.files import atomic_path, write_json, write_text
from rover_sim.given_way import Way
from rover_sim.picture_paths import GOAL_RANGE_M, PicturePath, picture_paths
from rover_sim.picture_result import result_table, verification_table
from rover_sim.pictures import read_picture
from rover_sim.report.perceived_overlay import draw_overlay
from rover_sim.report.virtual_terrain import terrain_glb
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.verdict import Verdict
from rover_sim.verify import Check, drive_way
from rover_sim.virtual_terrain import unseen_m, virtual_scenario, way_ahead
from worlds.build import build_world
from worlds.scenario import dump_scenario
from worlds.types import ByteArray

ROVER = "husky"
SEED = 0  # of the sensors' noise in a verification


@dataclass(frozen=True)
class Order:
    """What is asked for of every picture."""

    folder: Path
    knowledge: str
    camera: CameraFile | None
    verify: bool = False


@dataclass(frozen=True)
class Report:
    """What one picture came to; ``fault`` is the line of one that could not be read."""

    line: str = ""
    fault: str = ""
    verified: int = 0  # paths


def report_picture(order: Order, path: Path) -> Report:
    """Write all results of one picture; a picture that cannot be read makes a fault."""
    try:
        picture = read_picture(path)
        size = (picture.shape[1], picture.shape[0])
        view = camera_view(order.camera or default_camera(size), size, str(path))
    except InputError as error:
        return Report(fault=str(error))
    knowledge, rover = _knowledge(order.knowledge), load_rover(ROVER)
    # An assumed camera knows nothing of this picture's horizon.
    seen = examine(picture, knowledge, view if order.camera else None)
    found = on_ground(seen, view, 0.0, knowledge)
    assert found.observation is not None
    paths = picture_paths(found.observation, view, rover.footprint())
    table: dict[str, Any] = {
        "image": path.name,
        **result_table(found, paths, size, order.camera, knowledge.name),
    }
    target = order.folder / path.stem
    _write_terrain(target, path.stem, found, view, paths, rover, knowledge)
    checks: list[Check] = []
    if order.verify:
        checks, under = _check(path.stem, found, view, paths, rover, knowledge)
        table["verification"] = verification_table(ROVER, checks, under, metric=order.camera is not None)
    overlay = draw_overlay(picture, found, [item.points_px for item in paths], [check.verdict for check in checks])
    mask = np.asarray(cv2.resize(found.mask * np.uint8(255), size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
    _write_png(target, "_rocks.png", mask)
    _write_png(target, "_overlay.png", overlay[..., ::-1])
    if order.verify:
        _write_map(target, path.name, overlay, found, view, paths, checks, rover, knowledge, order)
    write_json(target.with_name(f"{path.stem}.json"), table)
    line = _line(path.name, found, paths, table["classes"], checks if order.verify else None)
    return Report(line, verified=_count(checks))


@cache
def _knowledge(name: str) -> Knowledge:
    return load_knowledge(name)


def _write_terrain(
    target: Path,
    name: str,
    found: Perception,
    view: View,
    paths: Sequence[PicturePath],
    rover: RoverModel,
    knowledge: Knowledge,
) -> None:
    """The virtual terrain model as glTF and as a scenario."""
    reach = knowledge.ground.max_range_m
    with atomic_path(target.with_name(f"{target.name}_terrain.glb")) as temporary:
        temporary.write_bytes(terrain_glb(found, view, [path.points_w for path in paths], reach))
    # Without a path the goal is what could not be reached, so that `run` can try it from nearer.
    way = paths[0].whole_w if paths else way_ahead(found, view, GOAL_RANGE_M)
    scenario, _ = virtual_scenario(name, found, view, ROVER, rover.footprint(), way, reach)
    write_text(target.with_name(f"{target.name}_scenario.toml"), dump_scenario(scenario))


def _check(
    name: str, found: Perception, view: View, paths: Sequence[PicturePath], rover: RoverModel, knowledge: Knowledge
) -> tuple[list[Check], tuple[int, ...]]:
    """Every path driven through the virtual terrain, and the rocks left out of it."""
    checks: list[Check] = []
    under: tuple[int, ...] = ()
    for path in paths:
        reach = knowledge.ground.max_range_m
        scenario, under = virtual_scenario(name, found, view, ROVER, rover.footprint(), path.whole_w, reach)
        points = tuple((float(x), float(y)) for x, y in path.whole_w)
        drive = drive_way(build_world(scenario, SEED), rover, Way(points, path.traversability))
        checks.append(Check(drive, unseen_m(found, view, drive.track_w, reach)))
    return checks, under


def _write_map(
    target: Path,
    name: str,
    overlay: ByteArray,
    found: Perception,
    view: View,
    paths: Sequence[PicturePath],
    checks: Sequence[Check],
    rover: RoverModel,
    knowledge: Knowledge,
    order: Order,
) -> None:
    from rover_sim.report.verify_map import save_verify_map

    scale = "camera file" if order.camera else "assumed camera: the scale is a guess"
    title = f"{name}: {_count(checks)} of {len(checks)} paths verified ({scale})"
    save_verify_map(
        target.with_name(f"{target.name}_verify.png"),
        overlay,
        found,
        view,
        [(path.whole_w, check) for path, check in zip(paths, checks, strict=True)],
        rover.footprint(),
        knowledge.ground.max_range_m,
        title,
    )


def _write_png(target: Path, ending: str, picture: ByteArray) -> None:
    with atomic_path(target.with_name(f"{target.name}{ending}")) as temporary:
        temporary.write_bytes(cv2.imencode(".png", picture)[1].tobytes())


def _line(
    name: str, found: Perception, paths: Sequence[PicturePath], rows: Sequence[str], checks: Sequence[Check] | None
) -> str:
    letters = "".join(rows)
    counts = " ".join(f"{letter} {letters.count(letter)}" for letter in "SVmMBU" if letter in letters)
    line = f"{name}: {len(found.rocks)} rocks, {len(paths)} paths, classes {counts}"
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
