"""``rover-sim handover``: a plan of ours to an autopilot that is not, or to a ground station's file."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_sim.arguments import seed
from rover_sim.errors import InputError, LinkError

if TYPE_CHECKING:
    from rover_sim.handover import Ending, Handover
    from rover_sim.handover_plans import HandoverPlan, Spot

    PlanAt = Callable[[Spot], HandoverPlan]

TLOG, SUMMARY = "telemetry.tlog", "summary.json"
_TICK_S = 0.02
_VEHICLE = "vehicle"


def configure(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("scenario", nargs="?", help="plan once from the start of this world (name or TOML path)")
    parser.add_argument("--run", type=Path, metavar="DIR", help="or: the last mission of this run's folder")
    parser.add_argument("--mission", type=Path, metavar="FILE", help="or: the mission of a .plan or .waypoints file")
    parser.add_argument(
        "--picture", type=Path, metavar="STEM.json", help="or: a path that `perceive --camera` found; needs --at"
    )
    parser.add_argument("--path", type=_number, metavar="N", help="which path of the picture (default: the best)")
    parser.add_argument(
        "--at",
        type=_place,
        metavar="LAT,LON",
        help="where the rover stands, degrees; of a scenario: its start; `vehicle`: where the autopilot says",
    )
    parser.add_argument(
        "--heading",
        type=_heading,
        metavar="DEG",
        help="where it looks, compass (default: north; vehicle: as it says)",
    )
    parser.add_argument("--seed", type=seed, default=0, help="of the scenario's world, 0 to 2^32 - 1 (default: 0)")
    parser.add_argument("--speed", type=_speed, metavar="M/S", help="of a picture's or scenario's plan")
    parser.add_argument("--autopilot", metavar="URL", help="upload to the autopilot on this link and read back")
    parser.add_argument("--to-file", type=Path, metavar="FILE", help="write a .plan or .waypoints file")
    parser.add_argument("--arm-and-start", action="store_true", help="arm, drive the mission, follow it to its end")
    parser.add_argument("--wait", type=_seconds, default=30.0, metavar="S", help="for a heartbeat (default: 30)")
    parser.add_argument("--ready", type=_seconds, default=120.0, metavar="S", help="for readiness (default: 120)")
    parser.add_argument("--limit", type=_seconds, default=1800.0, metavar="S", help="of the drive (default: 1800)")
    parser.add_argument("--signing-key", type=Path, metavar="FILE", help="sign, and hear signed frames only")
    parser.add_argument("--out", type=Path, default=Path("runs/handover"), help="folder (default: runs/handover)")


def execute(args: argparse.Namespace) -> int:
    """0: on board as sent, or driven to the end; 1: the vehicle did not do it; 2: wrong input; 3: no link."""
    if args.autopilot is None and args.to_file is None:
        raise InputError("nothing to do; allowed: --autopilot URL, --to-file FILE or both")
    if args.arm_and_start and args.autopilot is None:
        raise InputError("--arm-and-start: needs --autopilot URL")
    plan, plan_at = _plan(args)
    if args.to_file is not None:
        from rover_sim.handover_plans import write_mission_file

        write_mission_file(args.to_file, plan.items)
        print(f"{args.to_file}: {len(plan.places)} waypoints of {plan.source}")  # noqa: T201 - what the command leaves
    return 0 if args.autopilot is None else _to_autopilot(args, plan, plan_at)


def _plan(args: argparse.Namespace) -> tuple[HandoverPlan, PlanAt | None]:
    """The one plan that was asked for, and how it is made once the vehicle says where it stands.

    Raises InputError for no plan, or more than one.
    """
    given = [name for name in ("scenario", "run", "mission", "picture") if getattr(args, name) is not None]
    if len(given) != 1:
        raise InputError(f"{len(given)} plans given; allowed: one of SCENARIO, --run, --mission, --picture")
    for option, needs in (("path", ("picture",)), ("at", ("picture", "scenario")), ("speed", ("picture", "scenario"))):
        if getattr(args, option) is not None and given[0] not in needs:
            raise InputError(f"--{option}: allowed: with {' or '.join(needs)}; a mission has its own")
    if args.heading is not None and args.at is None:
        raise InputError("--heading: allowed: with --at")
    from rover_sim.handover_plans import plan_of_file, plan_of_run

    if args.run is not None:
        return plan_of_run(args.run), None
    if args.mission is not None:
        return plan_of_file(args.mission), None
    if args.picture is not None:
        return _picture_plan(args)
    if args.at == _VEHICLE:
        raise InputError("--at vehicle: allowed: with --picture; a scenario is planned before")
    return _scenario_plan(args, None if args.at is None else _spot(args)), None


def _picture_plan(args: argparse.Namespace) -> tuple[HandoverPlan, PlanAt | None]:
    from rover_sim.handover_plans import Spot, way_of_picture

    if args.at is None:
        raise InputError("--picture: needs --at LAT,LON, and --heading DEG unless the rover looks north")
    way = way_of_picture(args.picture, args.path, args.speed)
    if args.at != _VEHICLE:
        return way.at(_spot(args)), None
    if args.autopilot is None or args.to_file is not None:
        raise InputError("--at vehicle: allowed: with --autopilot URL and without --to-file")
    turned = args.heading
    # Until the vehicle says where it is, the plan lies nowhere in particular: only its length is of use.
    return way.at(Spot(0.0, 0.0)), lambda spot: way.at(spot if turned is None else replace(spot, heading_deg=turned))


def _spot(args: argparse.Namespace) -> Spot:
    from rover_sim.handover_plans import Spot

    latitude_deg, longitude_deg = args.at
    return Spot(latitude_deg, longitude_deg, args.heading or 0.0)


def _scenario_plan(args: argparse.Namespace, spot: Spot | None) -> HandoverPlan:
    from rover_sim.handover_look import plan_of_scenario
    from worlds.build import build_world
    from worlds.scenario import load_scenario

    return plan_of_scenario(
        build_world(load_scenario(args.scenario), args.seed, source=args.scenario), spot, args.speed
    )


def _to_autopilot(args: argparse.Namespace, plan: HandoverPlan, plan_at: PlanAt | None) -> int:
    from rover_sim.files import output_folder, write_json
    from rover_sim.handover import Handover, summary
    from rover_sim.mavlink.endpoint import Link
    from rover_sim.mavlink.foreign_companion import ForeignCompanion
    from rover_sim.mavlink.foreign_pursuit import Patience
    from rover_sim.mavlink.signing import open_signing
    from rover_sim.mavlink.tlog import TlogWriter
    from rover_sim.mavlink.transport import open_link
    from rover_sim.pacing import unix_time_s
    from rover_sim.stop_flag import stop_flag

    folder = output_folder(args.out)
    signing = open_signing(args.signing_key, unix_time_s, folder)
    (folder / SUMMARY).unlink(missing_ok=True)
    with ExitStack() as closing:
        transport = open_link(args.autopilot)
        closing.callback(transport.close)
        log = TlogWriter(folder / TLOG, unix_time_s())
        closing.callback(log.close)
        closing.callback(signing.close)
        patience = Patience(vehicle_s=args.wait, ready_s=args.ready)
        companion = ForeignCompanion(Link(transport, {}), Link(log, {}), patience, signing)
        handover = Handover(companion, plan, start=args.arm_and_start, limit_s=args.limit, plan_at=plan_at)
        with stop_flag() as stopped, _display() as show:
            ending = _until_the_end(handover, stopped, show)
        write_json(folder / SUMMARY, summary(handover, ending, args.autopilot))
    return _tell(ending, args, folder)


def _until_the_end(handover: Handover, stopped: Callable[[], bool], show: Callable[[str], None]) -> Ending:
    """At the pace of the wall clock."""
    from rover_sim.pacing import WallClock

    clock, aborted = WallClock(), False
    while True:
        ending = handover.step(clock.elapsed_s())
        if ending is None and stopped() and not aborted:
            aborted, ending = True, handover.abort("interrupted")
        if ending is not None:
            return ending
        show(handover.doing)
        handover.companion.endpoint.wait(_TICK_S)


def _tell(ending: Ending, args: argparse.Namespace, folder: Path) -> int:
    """One line, and the exit code; raises what has an exit code of its own."""
    from rover_sim.handover import HandoverEnd

    if ending.end in (HandoverEnd.NO_VEHICLE, HandoverEnd.LINK_LOST):
        raise LinkError(f"--autopilot {args.autopilot}: {ending.detail}")
    if ending.end is HandoverEnd.WRONG_VEHICLE:
        raise InputError(f"--autopilot {args.autopilot}: {ending.detail}")
    if not ending.end.is_success:
        text = f"rover-sim handover: {ending.end.value.replace('_', ' ')}: {ending.detail}"
        print(text, file=sys.stderr)  # noqa: T201 - why it failed
        return 1
    print(f"{ending.detail}\n{folder}: {SUMMARY}, {TLOG}")  # noqa: T201 - what was done
    return 0


@contextmanager
def _display() -> Iterator[Callable[[str], None]]:
    """One line on a terminal that says what is going on."""
    from rich.console import Console

    with Console(stderr=True).status("") as line:
        shown: list[Any] = [""]

        def show(text: str) -> None:
            if text != shown[0]:
                shown[0] = text
                line.update(text)

        yield show


def _place(text: str) -> tuple[float, float] | str:
    if text == _VEHICLE:
        return text
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError:
        latitude = longitude = math.nan
    if not (-89.0 <= latitude <= 89.0 and -180.0 <= longitude <= 180.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not LAT,LON in degrees (-89 to 89, -180 to 180) or `vehicle`")
    return latitude, longitude


def _heading(text: str) -> float:
    return _within(text, -360.0, 360.0, "degrees clockwise from north")


def _speed(text: str) -> float:
    return _within(text, 0.05, 5.0, "m/s")


def _seconds(text: str) -> float:
    return _within(text, 0.1, 1e6, "seconds")


def _number(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0")
    return int(text)


def _within(text: str, least: float, most: float, unit: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of {unit} from {least:g} to {most:g}")
    return value
