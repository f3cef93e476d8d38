"""``rover-sim serve``: the rover as a live MAVLink vehicle until Ctrl-C."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rover_sim.arguments import seed

if TYPE_CHECKING:
    from rover_sim.live import LiveStatus
    from rover_sim.mavlink.signing import Signing

PERSONAS = ("ardupilot", "px4", "generic")
# Where QGroundControl and MAVSDK listen when nobody tells them otherwise.
DEFAULT_LINKS = ("udpout:127.0.0.1:14550", "udpout:127.0.0.1:14540")


def configure(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("scenario", nargs="?", default="demo", help="shipped name or TOML path (default: demo)")
    parser.add_argument("--seed", type=seed, default=0, help="world and sensor noise, 0 to 2^32 - 1 (default: 0)")
    parser.add_argument("--out", type=Path, help="folder for log, trace and mission (default: runs/serve-NAME-SEED)")
    parser.add_argument(
        "--persona", choices=PERSONAS, default="ardupilot", help="as whose vehicle it answers (default: ardupilot)"
    )
    for option, what in (("--connect", "send to"), ("--listen", "wait at")):
        parser.add_argument(
            option,
            action="append",
            default=[],
            metavar="URL",
            help=f"{what} this link; repeatable (default of both: {' and '.join(DEFAULT_LINKS)})",
        )
    parser.add_argument("--params", type=Path, metavar="FILE", help="take parameters from FILE and keep changes there")
    parser.add_argument(
        "--plan", type=Path, metavar="FILE", help="begin with mission, fence and rally points of a .plan file"
    )
    parser.add_argument(
        "--signing-key", type=Path, metavar="FILE", help="sign, and obey signed frames only; key or passphrase in FILE"
    )
    parser.add_argument(
        "--link", metavar="FAULTS", help='make all links bad, e.g. "loss=0.2,delay=0.3" (docs/mavlink.md)'
    )


def execute(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C (0), or until the rover leaves the map (1)."""
    from rover_sim import live
    from rover_sim.fault_log import idle_notes
    from rover_sim.files import output_folder
    from rover_sim.mavlink.faults import parse_faults
    from rover_sim.mavlink.persona import PERSONAS as TABLE
    from rover_sim.mavlink.signing import open_signing
    from rover_sim.pacing import unix_time_s
    from rover_sim.sim.rover import load_rover
    from rover_sim.stop_flag import stop_flag
    from worlds.build import build_world
    from worlds.scenario import load_scenario

    scenario = load_scenario(args.scenario)
    rover = load_rover(scenario.rover.model)
    folder = args.out or Path("runs") / f"serve-{scenario.name}-{args.seed}"
    urls = _urls(args.connect, args.listen)
    faults = None if args.link is None else parse_faults(args.link)
    signing = open_signing(args.signing_key, unix_time_s, folder)
    with stop_flag() as stopped, _display() as show:
        world = build_world(scenario, args.seed, source=args.scenario)
        for note in (*world.notes, *idle_notes(scenario.event, "built-in")):
            print(f"rover-sim serve: {note}", file=sys.stderr)  # noqa: T201 - one line that a user must see
        output_folder(folder)
        with live.LiveRover(
            world, rover, TABLE[args.persona], urls, folder / live.TLOG, faults, args.params, signing
        ) as vehicle:
            live.clear(folder)
            if args.plan is not None:
                vehicle.vehicle.load_plan(args.plan)
            print(f"rover-sim serve: {args.persona} rover on {', '.join(urls)}; Ctrl-C ends", file=sys.stderr)  # noqa: T201
            inside = vehicle.run(stopped, show)
            vehicle.save(folder)
        signing.close()
    print(f"{folder}: {', '.join(live.FILES)}")  # noqa: T201 - what the command leaves
    for note in _signing_notes(signing):
        print(f"rover-sim serve: {note}", file=sys.stderr)  # noqa: T201 - what a user must know of strangers
    if not inside:
        print("rover-sim serve: the rover left the map", file=sys.stderr)  # noqa: T201 - why it ended
    return 0 if inside else 1


def _signing_notes(signing: Signing) -> list[str]:
    refused = f"frames refused: {signing.refused} (unsigned, badly signed, old or from the future)"
    return [*([refused] if signing.refused else []), *([signing.trouble] if signing.trouble else [])]


def _urls(connect: list[str], listen: list[str]) -> tuple[str, ...]:
    """All links; raises InputError for one that cannot be waited at."""
    from rover_sim.errors import InputError
    from rover_sim.mavlink.transport import parse_url

    for text in listen:
        if parse_url(text).kind not in ("udpin", "tcpin"):
            raise InputError(f"--listen {text!r}: allowed: udpin:HOST:PORT or tcpin:HOST:PORT")
    return (*connect, *listen) or DEFAULT_LINKS


@contextmanager
def _display() -> Iterator[Callable[[LiveStatus], None]]:
    """One line on a terminal that says once a second how the rover is."""
    from rich.console import Console

    console = Console(stderr=True)
    with console.status("building the world") as line:

        def show(status: LiveStatus) -> None:
            armed = "armed" if status.armed else "disarmed"
            line.update(
                f"t {status.time_s:6.0f} s  {status.mode} {armed}  {status.speed_m_s:4.2f} m/s  "
                f"slip {100 * status.slip:3.0f} %  links {status.listeners}  "
                f"real-time factor {status.real_time_factor:4.2f}"
                + (f"  [red]{status.faults}[/red]" if status.faults else "")
            )

        yield show
