"""``rover-sim run``: one closed-loop traverse, with a progress bar, a table at the end and a run folder."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rover_sim.arguments import seed


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
        "--no-gnss",
        action="store_true",
        help="no satellite receiver: wheels, inertial unit, compass and the rocks that two cameras see tell the place",
    )
    parser.add_argument(
        "--record-video", action="store_true", help="also write camera.mp4: every picture with what was seen in it"
    )


def execute(args: argparse.Namespace) -> int:
    """Run the traverse; 0 if the goal was reached, 1 if not."""
    from rover_sim import run_folder
    from rover_sim.commands.traverse_display import expected_s, print_plan, print_summary, progress_bar
    from rover_sim.fault_log import idle_notes
    from rover_sim.files import output_folder
    from rover_sim.mavlink.faults import parse_faults
    from rover_sim.sights import Sights
    from rover_sim.sim.rover import load_rover
    from rover_sim.stop_flag import stop_flag
    from rover_sim.traverse import RunOptions, open_traverse
    from worlds.build import build_world
    from worlds.scenario import load_scenario, without_gnss

    scenario = load_scenario(args.scenario)
    if args.no_gnss:
        scenario = without_gnss(scenario)
    rover = load_rover(scenario.rover.model)
    folder = args.out or Path("runs") / f"{scenario.name}-{args.seed}"
    faults = None if args.link is None else parse_faults(args.link)
    options = RunOptions(connect=tuple(args.connect), faults=faults, realtime=args.realtime)
    with stop_flag() as stopped, progress_bar(scenario.name, args.seed) as show:
        world = build_world(scenario, args.seed, source=args.scenario)
        for note in (*world.notes, *idle_notes(scenario.event, "built-in")):
            print(f"rover-sim run: {note}", file=sys.stderr)  # noqa: T201 - one line that a user must see
        output_folder(folder)
        video = folder / run_folder.VIDEO if args.record_video else None
        half_way_s = expected_s(scenario) / 2
        with open_traverse(world, rover, options, folder / run_folder.TLOG) as traverse:
            run_folder.clear(folder)
            print_plan(traverse.route)
            with Sights(half_way_s, video, scenario.camera.rate_hz) as sights:
                summary = traverse.run(show, stopped, sights.take)
                run_folder.write(folder, traverse, sights, summary)
    print_summary(summary, folder)
    return 0 if summary["success"] else 1
