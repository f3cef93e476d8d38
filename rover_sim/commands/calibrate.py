"""``rover-sim calibrate``: a camera file from pictures of a checkerboard or a grid of circles."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_sim.errors import InputError

if TYPE_CHECKING:
    from perception.calibration import Calibration
    from worlds.types import FloatArray

PATTERNS = ("checkerboard", "circles", "acircles")
MODELS = ("brown", "fisheye")
BOARD_LIMITS = (2, 100)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("images", nargs="+", type=Path, metavar="IMAGE", help="pictures of the board, all of one size")
    parser.add_argument(
        "--board", required=True, metavar="COLUMNSxROWS", help="inner corners, or circles, along a row and rows: 9x6"
    )
    parser.add_argument(
        "--square-mm", type=float, required=True, metavar="MM", help="side of a square, or distance of two rows"
    )
    parser.add_argument("--pattern", choices=PATTERNS, default="checkerboard", help="default: checkerboard")
    parser.add_argument("--model", choices=MODELS, default="brown", help="of the lens (default: brown)")
    parser.add_argument("--height-m", type=float, metavar="M", help="of the camera over the ground, for the file")
    parser.add_argument("--pitch-deg", type=float, metavar="DEG", help="of the camera, positive down, for the file")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE.toml",
        default=Path("camera.toml"),
        help="camera file to write, FILE.json and FILE.png with it (default: camera.toml)",
    )


def execute(args: argparse.Namespace) -> int:
    """Find the boards, solve for the camera, write it, and print the error of each picture."""
    from rich.console import Console

    from perception.calibration import board_points, calibrate
    from rover_sim.files import atomic_path, output_folder, write_json, write_text
    from rover_sim.report.calibration_plot import save_calibration

    board = check_arguments(args)
    places = board_points(args.pattern, board, args.square_mm / 1e3)
    boards, without, size_px = read_boards(args.images, args.pattern, board)
    try:
        found = calibrate([points for _, points in boards], places, size_px, args.model)
    except ValueError as error:
        raise InputError(f"{args.images[0]} and {len(args.images) - 1} more: {error}{_unseen(without)}") from error
    names = [path.name for path, _ in boards]
    output_folder(args.out.parent)
    write_text(args.out, camera_toml(found, args.height_m, args.pitch_deg))
    write_json(args.out.with_suffix(".json"), report(found, names, [path.name for path in without]))
    with atomic_path(args.out.with_suffix(".png")) as temporary:
        save_calibration(temporary, found, [points for _, points in boards], names)
    lines = [*picture_lines(found, names), *(f"{path.name}: no board of {args.board} found" for path in without)]
    lens = found.camera.lens
    assert lens is not None
    lines.append(
        f"{args.out}: focal length {found.camera.focal_px:.1f} px, "
        f"centre {lens.centre_px[0]:.1f} {lens.centre_px[1]:.1f}, "
        f"error {found.rms_px:.3f} px rms over {int(found.used.sum())} pictures"
    )
    Console().print("\n".join(lines), soft_wrap=True, highlight=False, markup=False)
    return 0


def check_arguments(args: argparse.Namespace) -> tuple[int, int]:
    """Columns and rows of the board; InputError for what cannot be."""
    match = re.fullmatch(r"(\d+)x(\d+)", args.board)
    if not match or not all(BOARD_LIMITS[0] <= int(n) <= BOARD_LIMITS[1] for n in match.groups()):
        low, high = BOARD_LIMITS
        raise InputError(
            f"--board {args.board}: give columns and rows of inner corners or circles, {low} to {high}: 9x6"
        )
    limits = {"square_mm": (1e-3, 1e5), "height_m": (0.01, 1000.0), "pitch_deg": (-89.0, 89.0)}
    for name, (low_value, high_value) in limits.items():
        value = getattr(args, name)
        if value is not None and not low_value <= value <= high_value:
            option = f"--{name.replace('_', '-')}"
            raise InputError(f"{option} {value:g}: allowed are {low_value:g} to {high_value:g}")
    if args.out.suffix != ".toml":
        raise InputError(f"--out {args.out}: must be named FILE.toml, as camera files are")
    return int(match[1]), int(match[2])


def read_boards(
    images: list[Path], pattern: Any, board: tuple[int, int]
) -> tuple[list[tuple[Path, FloatArray]], list[Path], tuple[int, int]]:
    """Pictures with a board and its points, pictures without one, and their size; all must have the same."""
    import cv2
    import numpy as np
    from rich.console import Console
    from rich.progress import track

    from perception.calibration import find_board
    from rover_sim.pictures import read_picture

    boards, without, sizes = [], [], dict[tuple[int, int], Path]()
    console = Console(stderr=True)
    hidden = len(images) < 2 or not console.is_terminal
    for path in track(images, "finding boards", console=console, disable=hidden, transient=True):
        picture = read_picture(path)
        grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        sizes.setdefault((grey.shape[1], grey.shape[0]), path)
        if len(sizes) > 1:
            (one, first), (two, other) = sizes.items()
            raise InputError(f"{other}: is {two[0]} x {two[1]} px, {first} is {one[0]} x {one[1]}; give one size")
        points = find_board(grey, pattern, board)
        if points is None:
            without.append(path)
        else:
            boards.append((path, points))
    return boards, without, next(iter(sizes))


def camera_toml(found: Calibration, height_m: float | None, pitch_deg: float | None) -> str:
    """Text of the camera file; what calibration cannot know stays a comment for a person to fill in."""
    camera, lens = found.camera, found.camera.lens
    assert lens is not None
    focal = (camera.focal_px, camera.focal_px * lens.aspect)
    return "\n".join(
        [
            f"width = {camera.width_px}",
            f"height = {camera.height_px}",
            "# pitch_deg = 25.0   # to fill in: looking down is positive"
            if pitch_deg is None
            else f"pitch_deg = {pitch_deg}",
            "# height_m = 1.1     # to fill in: over the ground" if height_m is None else f"height_m = {height_m}",
            "",
            "[lens]",
            f'model = "{lens.model}"',
            f"focal_px = [{', '.join(repr(value) for value in focal)}]",
            f"centre_px = [{', '.join(repr(value) for value in lens.centre_px)}]",
            f"coefficients = [{', '.join(repr(value) for value in lens.coefficients)}]",
            f"reprojection_px = {found.rms_px:.4f}",
            "",
        ]
    )


def report(found: Calibration, names: list[str], without: list[str]) -> dict[str, Any]:
    """The table of the JSON file."""
    pictures: list[dict[str, Any]] = [
        {"name": name, "board": True, "used": bool(use), "error_px": round(float(error), 4)}
        for name, use, error in zip(names, found.used, found.error_px, strict=True)
    ]
    pictures += [{"name": name, "board": False, "used": False, "error_px": None} for name in without]
    return {"reprojection_px": round(found.rms_px, 4), "pictures": pictures}


def picture_lines(found: Calibration, names: list[str]) -> list[str]:
    """A line a picture with its error."""
    return [
        f"{name}: {error:.3f} px" + ("" if use else ", left out: far above the others; is the whole board sharp in it?")
        for name, use, error in zip(names, found.used, found.error_px, strict=True)
    ]


def _unseen(without: list[Path]) -> str:
    if not without:
        return ""
    some = ", ".join(path.name for path in without[:5]) + (" ..." if len(without) > 5 else "")
    return f"; no such board in {some}"
