"""``rover-sim run``: one closed-loop traverse, with a progress bar, a table at the end and a run folder."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_sim.arguments import seed

if TYPE_CHECKING:
    from rover_sim.traverse import Status
    from worlds.scenario import Scenario

TABLE = {
    "reason": "reason",
    "detail": "",
    "sim_time_s": "simulated time, s",
    "wall_time_s": "wall time, s",
    "real_time_factor": "real-time factor",
    "distance_m": "distance driven, m",
    "straight_line_m": "straight line, m",
    "goal_distance_m": "left to the goal, m",
    "collisions": "collisions",
    "max_tilt_deg": "largest tilt, deg",
    "mean_slip": "mean slip ratio",
    "max_sinkage_m": "largest sinkage, m",
    "energy_J": "energy, J",
    "frames": "pictures",
    "missions_sent": "missions sent",
    "waypoints_sent": "waypoints sent",
    "ttam": "TTAM of the terrain classes, %",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("scenario", nargs="?", default="demo", help="shipped name or TOML path (default: demo)")
    parser.add_argument("--seed", type=seed, default=0, help="world and sensor noise, 0 to 2^32 - 1 (default: 0)")
    parser.add_argument("--out", type=Path, help="folder for the results (default: runs/NAME-SEED)")
    parser.add_argument("--realtime", action="store_true", help="no faster than the wall clock")
    parser.add_argument(
        "--connect",
        action="append",
        default=[],
        metavar="URL",
        help="serve the rover to a ground station, e.g. udpout:127.0.0.1:14550; repeatable, best with --realtime",
    )
    parser.add_argument(
        "--link",
        metavar="FAULTS",
        help='make all links bad, the planner\'s too, e.g. "loss=0.2,delay=0.3,jitter=0.1,dup=0.02,rate=9600"',
    )
    parser.add_argument(
        "--record-video", action="store_true", help="also write camera.mp4: every picture with what was seen in it"
    )


def execute(args: argparse.Namespace) -> int:
    """Run the traverse; 0 if the goal was reached, 1 if not."""
    from rover_sim import run_folder
    from rover_sim.files import output_folder
    from rover_sim.mavlink.faults import parse_faults
    from rover_sim.sights import Sights
    from rover_sim.sim.rover import load_rover
    from rover_sim.stop_flag import stop_flag
    from rover_sim.traverse import RunOptions, open_traverse
    from worlds.build import build_world
    from worlds.scenario import load_scenario

    scenario = load_scenario(args.scenario)
    rover = load_rover(scenario.rover.model)
    folder = args.out or Path("runs") / f"{scenario.name}-{args.seed}"
    faults = None if args.link is None else parse_faults(args.link)
    options = RunOptions(connect=tuple(args.connect), faults=faults, realtime=args.realtime)
    with stop_flag() as stopped, _progress_bar(scenario.name, args.seed) as show:
        world = build_world(scenario, args.seed, source=args.scenario)
        for note in world.notes:
            print(f"rover-sim run: {note}", file=sys.stderr)  # noqa: T201 - one line that a user must see
        run_folder.clear(output_folder(folder))
        video = folder / run_folder.VIDEO if args.record_video else None
        half_way_s = _expected_s(scenario) / 2
        with (
            open_traverse(world, rover, options, folder / run_folder.TLOG) as traverse,
            Sights(half_way_s, video, scenario.camera.rate_hz) as sights,
        ):
            summary = traverse.run(show, stopped, sights.take)
            run_folder.write(folder, traverse, sights, summary)
    _print_summary(summary, folder)
    return 0 if summary["success"] else 1


def _expected_s(scenario: Scenario) -> float:
    """About how long the traverse takes at half a metre a second."""
    goal, start = scenario.goal.position_m, scenario.rover.start_m
    return 2.0 * math.hypot(goal[0] - start[0], goal[1] - start[1])


@contextmanager
def _progress_bar(name: str, seed: int) -> Iterator[Callable[[Status], None]]:
    """Bar over the way to the goal, with simulated time, distance left, slip and what the rover does."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[numbers]}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(f"{name} seed {seed}", total=1.0, numbers="building the world")

        def show(status: Status) -> None:
            text = (
                f"t {status.time_s:5.1f} s  goal {status.goal_distance_m:5.1f} m  "
                f"slip {100 * status.slip:3.0f} %  {status.doing}"
            )
            progress.update(task, completed=status.share_done, numbers=text)

        yield show


def _print_summary(summary: dict[str, Any], folder: Path) -> None:
    """Table of the figures, then where the files are."""
    from rich.console import Console
    from rich.table import Table

    title = "goal reached" if summary["success"] else "goal not reached"
    table = Table(title=f"{summary['scenario']} seed {summary['seed']}: {title}", show_header=False)
    for key, label in TABLE.items():
        value = summary[key]
        if value not in (None, ""):
            table.add_row(label, f"{value:.3f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value))
    counts = [f"{kind.replace('_', ' ')} {count}" for kind, count in summary["event_counts"].items() if count]
    table.add_row("mobility events", ", ".join(counts) or "none")
    console = Console()
    console.print(table)
    left = ", ".join(sorted(path.name for path in folder.iterdir()))
    console.print(f"{folder}: {left}", soft_wrap=True)
