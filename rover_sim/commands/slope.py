"""``rover-sim slope``: slope and traction stress test against published curves."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rover_sim.arguments import worker_count
from rover_sim.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rover_sim.slope.campaign import Campaign, Point

SOILS = ("loose_sand", "firm")  # those with published bands
STEEPEST_DEG = 45.0
MOST_SLOPES = 91
DIRECTIONS: tuple[Literal["up", "down", "across"], ...] = ("up", "down", "across")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "--soil",
        action="append",
        metavar="NAME",
        help=f"preset or TOML file; repeatable (default: {' and '.join(SOILS)})",
    )
    parser.add_argument(
        "--slopes",
        type=parse_slopes,
        default=parse_slopes("0:30:5"),
        metavar="FROM:TO:STEP",
        help="degrees, both ends included, or a list such as 0,10,17.5 (default: 0:30:5)",
    )
    parser.add_argument(
        "--direction", action="append", choices=DIRECTIONS, help="way over the slope; repeatable (default: all three)"
    )
    parser.add_argument("--gravity", type=_in(0.1, 30.0), default=9.81, metavar="G", help="m/s2 (default: 9.81)")
    parser.add_argument("--rover", default="husky", metavar="MODEL", help="shipped name or TOML file (default: husky)")
    parser.add_argument("--load", type=_in(0.0, 1e4), default=0.0, metavar="KG", help="on the deck (default: none)")
    parser.add_argument("--speed", type=_in(0.01, 5.0), default=0.1, metavar="M/S", help="of the rims (default: 0.1)")
    parser.add_argument("--workers", type=worker_count, default=0, metavar="N", help="processes (default: one a core)")
    parser.add_argument("--out", type=Path, default=Path("slope"), metavar="DIR", help="default: slope")


def parse_slopes(text: str) -> tuple[float, ...]:
    """Slopes in degrees from FROM:TO:STEP, ends included, or from a list; raises the argparse error otherwise."""
    wrong = argparse.ArgumentTypeError(
        f"{text!r}: give FROM:TO:STEP as in 0:30:5, or a list as in 0,10,17.5; "
        f"0 to {STEEPEST_DEG:g} degrees, rising, at most {MOST_SLOPES} of them"
    )
    try:
        slopes = _span(text) if ":" in text else [float(word) for word in text.split(",")]
    except ValueError as error:
        raise wrong from error
    rising = all(low < high for low, high in pairwise(slopes))
    if not slopes or len(slopes) > MOST_SLOPES or not rising or not 0.0 <= slopes[0] <= slopes[-1] <= STEEPEST_DEG:
        raise wrong
    return tuple(slopes)


def _span(text: str) -> list[float]:
    """FROM:TO:STEP with both ends; raises ValueError for anything else."""
    first, last, step = (float(word) for word in text.split(":"))
    if not all(map(math.isfinite, (first, last, step))) or step <= 0.0 or (last - first) / step > MOST_SLOPES:
        raise ValueError
    return [round(first + step * place, 9) for place in range(int((last - first) / step + 1e-9) + 1)]


def _in(low: float, high: float) -> Callable[[str], float]:
    """A parser of numbers from ``low`` to ``high``."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number from {low:g} to {high:g}")
        return value

    return parse


def execute(args: argparse.Namespace) -> int:
    """Measure everything; 0 also where points lie outside their bands, as the files say which."""
    from rover_sim import parallel
    from rover_sim.files import output_folder
    from rover_sim.report.slope_plot import save_slope_plot
    from rover_sim.slope import files

    campaign = _campaign(args)
    tasks = campaign.tasks()
    folder = output_folder(args.out)
    files.clear(folder)
    points: dict[int, Point] = {}
    workers = min(args.workers or parallel.cores(), len(tasks))
    try:
        with parallel.terminable(), _progress_bar(len(tasks)) as show:
            for place, point in parallel.run_tasks(tasks, workers):
                points[place] = point
                files.write(folder, campaign, points, complete=len(points) == len(tasks))
                show(point)
    finally:
        if points:
            save_slope_plot(folder / files.PNG, campaign, points)
            _print_results(points, folder)
    return 0


def _campaign(args: argparse.Namespace) -> Campaign:
    """What to measure; raises InputError for soils, rovers and speeds that cannot be."""
    from rover_sim.slope.campaign import Campaign
    from worlds.soil_file import load_soil

    campaign = Campaign(
        soils=tuple(dict.fromkeys(args.soil or SOILS)),
        slopes_deg=args.slopes,
        directions=tuple(dict.fromkeys(args.direction or DIRECTIONS)),
        gravity_m_s2=args.gravity,
        rover=args.rover,
        load_kg=args.load,
        speed_m_s=args.speed,
    )
    try:
        for soil in campaign.soils:
            load_soil(soil)
        fastest = campaign.setups()[0].model().footprint().max_speed_m_s
    except InputError as error:
        # Said of the keys of a scenario; here they are options.
        raise InputError(str(error).replace("soil.preset =", "--soil").replace("rover.model =", "--rover")) from error
    if args.speed > fastest:
        raise InputError(f"--speed {args.speed:g}: the {args.rover} reaches {fastest:.2f} m/s; give that or less")
    return campaign


@contextmanager
def _progress_bar(total: int) -> Iterator[Callable[[Point], None]]:
    """Bar over the tests that are done, with the last of them."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("slope"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[last]}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("slope", total=total, last="starting")
        yield lambda point: progress.update(task, advance=1, last=_describe(point))


def _describe(point: Point) -> str:
    """A point in a few words."""
    from rover_sim.slope.drawbar import DrawbarPoint
    from rover_sim.slope.rig import SlopePoint
    from rover_sim.slope.turning import TurnPoint

    match point:
        case SlopePoint():
            return f"{point.soil} {point.direction} {point.slope_deg:g} deg: slip {point.slip:.2f}"
        case TurnPoint():
            return f"{point.soil} turn: radius {point.command_radius_m:.2f} m"
        case DrawbarPoint():
            return f"{point.soil} drawbar: slip {point.slip:.2f}"
        case _:
            return f"tilt table: {point.axis}"


def _print_results(points: Mapping[int, Point], folder: Path) -> None:
    """Tables of the drives, the turns and the tilt table, the verdict, and where the files are."""
    from rich.console import Console

    from rover_sim.report.slope_tables import tables, verdict

    console = Console()
    for table in tables(points):
        console.print(table)
    console.print(verdict(points), soft_wrap=True, highlight=False)
    left = ", ".join(sorted(path.name for path in folder.iterdir() if path.name.startswith("slope.")))
    console.print(f"{folder}: {left}", soft_wrap=True, highlight=False)
