"""``rover-sim perceive``: rocks, terrain classes and paths in any picture."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rover_sim.errors import InputError

if TYPE_CHECKING:
    from perception.pipeline import Knowledge, View
    from rover_sim.camera_file import CameraFile

OUTPUTS = (".json", "_rocks.png", "_overlay.png", "_terrain.glb")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("images", nargs="+", type=Path, metavar="IMAGE", help="picture, 8 or 16 bits, grey or colour")
    parser.add_argument(
        "--camera",
        type=Path,
        metavar="FILE",
        help="TOML with width, height, pitch_deg, height_m and fov_deg or a [lens] of `rover-sim calibrate`; without "
        "it a default camera is assumed and nothing is reported in metres",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("perceived"), help="default: perceived")
    parser.add_argument(
        "--knowledge", default="mars", metavar="NAME", help="mars, rendered or a TOML file (default: mars)"
    )


def execute(args: argparse.Namespace) -> int:
    """Perceive each picture; pictures that cannot be read are named at the end, after all others are done."""
    from rich.console import Console
    from rich.progress import track

    from perception.knowledge_base import load_knowledge
    from rover_sim.camera_file import load_camera
    from rover_sim.files import output_folder

    check_names(args.images, args.out)
    knowledge = load_knowledge(args.knowledge)
    camera = load_camera(args.camera) if args.camera else None
    folder = output_folder(args.out)
    console = Console(stderr=True)
    faults: list[str] = []
    lines: list[str] = []
    hidden = len(args.images) == 1 or not console.is_terminal
    for path in track(args.images, "perceiving", console=console, disable=hidden, transient=True):
        try:
            lines.append(perceive_file(path, folder, knowledge, camera))
        except InputError as error:
            faults.append(str(error))
    Console().print("\n".join(lines), soft_wrap=True, highlight=False, markup=False)
    if faults:
        raise InputError("; ".join(faults))
    return 0


def check_names(images: Sequence[Path], folder: Path) -> None:
    """Raise InputError where two pictures would write the same file, or one would write over another."""
    by_stem: dict[str, Path] = {}
    for image in images:
        other = by_stem.setdefault(image.stem, image)
        if other is not image:
            raise InputError(f"{image}: has the same name as {other}, so their results would be too; run them apart")
    inputs = {image.resolve() for image in images}
    for image in images:
        for ending in OUTPUTS:
            target = (folder / f"{image.stem}{ending}").resolve()
            if target in inputs:
                raise InputError(f"--out {folder}: {target.name} is one of the pictures; give another folder")


def perceive_file(path: Path, folder: Path, knowledge: Knowledge, camera: CameraFile | None) -> str:
    """Write all results of one picture; the answer is a line that sums them up."""
    import cv2
    import numpy as np

    from perception.pipeline import examine, on_ground
    from rover_sim.camera_file import camera_view, default_camera
    from rover_sim.files import atomic_path, write_json
    from rover_sim.picture_paths import picture_paths
    from rover_sim.picture_result import result_table
    from rover_sim.pictures import read_picture
    from rover_sim.report.perceived_overlay import draw_overlay
    from rover_sim.report.virtual_terrain import terrain_glb
    from rover_sim.sim.rover import load_rover

    picture = read_picture(path)
    size = (picture.shape[1], picture.shape[0])
    view: View = camera_view(camera or default_camera(size), size, str(path))
    # An assumed camera knows nothing of this picture's horizon.
    found = on_ground(examine(picture, knowledge, view if camera else None), view, 0.0, knowledge)
    assert found.observation is not None
    paths = picture_paths(found.observation, view, load_rover("husky").footprint())
    table = result_table(found, paths, size, camera, knowledge.name)
    stem = path.stem
    mask = cv2.resize(found.mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_NEAREST)
    overlay = draw_overlay(picture, found, [p.points_px for p in paths])
    for ending, data in (("_rocks.png", mask), ("_overlay.png", overlay[..., ::-1])):
        with atomic_path(folder / f"{stem}{ending}") as temporary:
            temporary.write_bytes(cv2.imencode(".png", data)[1].tobytes())
    with atomic_path(folder / f"{stem}_terrain.glb") as temporary:
        temporary.write_bytes(terrain_glb(found.rocks, knowledge.ground.max_range_m))
    write_json(folder / f"{stem}.json", {"image": path.name, **table})
    return f"{path.name}: {len(found.rocks)} rocks, {len(paths)} paths, classes {_class_counts(table['classes'])}"


def _class_counts(rows: Sequence[str]) -> str:
    letters = "".join(rows)
    return " ".join(f"{letter} {letters.count(letter)}" for letter in "SVmMBU" if letter in letters)
