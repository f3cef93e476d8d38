"""``rover-sim perceive``: rocks, terrain classes and paths in any picture, and paths verified in simulation."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rover_sim.arguments import sun_deg, worker_count
from rover_sim.errors import InputError
from rover_sim.parallel import Lost, cores, in_processes

if TYPE_CHECKING:
    from rover_sim.picture_report import Order, Report

OUTPUTS = (".json", "_rocks.png", "_overlay.png", "_terrain.glb", "_scenario.toml")
VERIFY_OUTPUTS = ("_verify.png",)
SHARE = 12  # pictures that are worth the start of one more process; a picture to verify is worth it alone
EXIT_UNVERIFIED, EXIT_INPUT = 1, 2


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "images",
        nargs="+",
        type=Path,
        metavar="IMAGE",
        help="picture, 8 or 16 bits, grey or colour; of a folder all its pictures",
    )
    parser.add_argument(
        "--camera",
        type=Path,
        metavar="FILE",
        help="TOML with width, height, pitch_deg, height_m and fov_deg or a [lens] of `rover-sim calibrate`; without "
        "it a default camera is assumed and neither rocks nor waypoints are reported in metres",
    )
    parser.add_argument(
        "--right",
        type=Path,
        metavar="IMAGE",
        help="the same moment by a second camera to the right; the camera file then has [stereo] with baseline_m",
    )
    parser.add_argument(
        "--sun",
        type=sun_deg,
        metavar="ELEVATION,AZIMUTH",
        help="of the sun in degrees, azimuth counter-clockwise from where the camera looks (45: ahead, to the left); "
        "shadows then tell heights of rocks too",
    )
    parser.add_argument(
        "--verify",
        action="store_true",
        help="drive every path in the virtual terrain of its picture; exit code 1 if a picture has no verified path",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("perceived"), help="default: perceived")
    parser.add_argument(
        "--knowledge", default="mars", metavar="NAME", help="mars, rendered or a TOML file (default: mars)"
    )
    parser.add_argument("--workers", type=worker_count, default=cores(), metavar="N", help="processes (default: cores)")


def execute(args: argparse.Namespace) -> int:
    """Perceive each picture.

    0: all is done; 1: with --verify, some picture has no verified path; 2: some picture, or another
    input, was wrong. A wrong picture among others is one line, and the others are done.
    """
    from perception.knowledge_base import load_knowledge
    from rover_sim.camera_file import baseline_m, load_camera
    from rover_sim.files import output_folder
    from rover_sim.picture_report import Order

    images = pictures_of(args.images)
    check_names(images, args.out, (*OUTPUTS, *VERIFY_OUTPUTS) if args.verify else OUTPUTS)
    load_knowledge(args.knowledge)  # its faults are told before any picture is read
    camera = load_camera(args.camera) if args.camera else None
    if args.right is not None:
        baseline_m(camera)
        if len(images) > 1:
            raise InputError(f"--right {args.right}: belongs to one picture, and {len(images)} are given")
    order = Order(
        output_folder(args.out), args.knowledge, camera, verify=args.verify, right=args.right, sun_deg=args.sun
    )
    if args.verify and camera is None:
        _tell(_assumption())
    reports = _reports(images, order, args.workers)
    return _sum_up(images, reports, args.out, verified=args.verify)


def pictures_of(places: Sequence[Path]) -> list[Path]:
    """The pictures, and those in folders in the order of their names; InputError for a folder without any.

    In a folder the outlines ``STEM_mask.png`` beside a picture STEM are labels, as `score` and `learn` read them.
    """
    from rover_sim.learning.labels import ENDINGS
    from rover_sim.pictures import ALLOWED

    images: list[Path] = []
    for place in places:
        if not place.is_dir():
            images.append(place)
            continue
        inside = sorted(path for path in place.iterdir() if path.suffix.lower() in ENDINGS and path.is_file())
        labels = {f"{path.stem}_mask.png" for path in inside}
        inside = [path for path in inside if path.name not in labels]
        if not inside:
            raise InputError(f"{place}: a folder without a picture; give {ALLOWED}, or a folder of them")
        images.extend(inside)
    return images


def check_names(images: Sequence[Path], folder: Path, endings: Sequence[str]) -> None:
    """Raise InputError where two pictures would write the same file, or one would write over another."""
    by_stem: dict[str, Path] = {}
    for image in images:
        other = by_stem.setdefault(image.stem, image)
        if other is not image:
            raise InputError(f"{image}: has the same name as {other}, so their results would be too; run them apart")
    inputs = {image.resolve() for image in images}
    for image in images:
        for ending in endings:
            target = (folder / f"{image.stem}{ending}").resolve()
            if target in inputs:
                raise InputError(f"--out {folder}: {target.name} is one of the pictures; give another folder")


def _reports(images: Sequence[Path], order: Order, workers: int) -> list[Report]:
    """The report of each picture, in their order, with a progress bar; faults are told as they come."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    hidden = len(images) == 1 or not console.is_terminal
    done: dict[int, Report] = {}
    with Progress(*columns, console=console, disable=hidden, transient=True) as progress:
        bar = progress.add_task("perceiving", total=len(images))
        for place, report in _made(images, order, workers):
            done[place] = report
            progress.advance(bar)
            if report.fault:
                progress.console.print(
                    f"rover-sim perceive: {report.fault}", soft_wrap=True, highlight=False, markup=False
                )
    return [done[place] for place in range(len(images))]


def _made(images: Sequence[Path], order: Order, workers: int) -> Iterator[tuple[int, Report]]:
    """Place and report of each picture as it is done."""
    from rover_sim.picture_report import Report, report_picture

    tasks = [partial(report_picture, order, path) for path in images]
    workers = min(workers, len(tasks) if order.verify else -(-len(tasks) // SHARE))
    if workers == 1:
        yield from ((place, task()) for place, task in enumerate(tasks))
        return
    for place, result in in_processes(tasks, workers):
        yield place, Report(fault=f"{images[place]}: {result.text}") if isinstance(result, Lost) else result


def _sum_up(images: Sequence[Path], reports: Sequence[Report], folder: Path, *, verified: bool) -> int:
    """Print a line a picture and one for all of several; the exit code."""
    from rich.console import Console

    good = [report for report in reports if not report.fault]
    lines = [report.line for report in good]
    if len(images) > 1:
        total = f"{len(good)} of {len(images)} pictures perceived, results in {folder}"
        count = sum(report.verified > 0 for report in good)
        lines.append(f"{total}; {count} with a verified path" if verified else total)
    if lines:
        Console().print("\n".join(lines), soft_wrap=True, highlight=False, markup=False)
    if len(good) < len(images):
        return EXIT_INPUT
    return EXIT_UNVERIFIED if verified and any(report.verified == 0 for report in good) else 0


def _assumption() -> str:
    from rover_sim.camera_file import default_camera

    usual = default_camera((320, 240))
    return (
        f"no --camera: assumed are {usual.fov_deg:g} deg across, {usual.pitch_deg:g} deg down and "
        f"{usual.height_m:g} m above level ground, so the size of the virtual terrain is a guess"
    )


def _tell(text: str) -> None:
    sys.stderr.write(f"rover-sim perceive: {text}\n")
