"""``rover-sim hil px4``: the simulator of PX4, as a program or on a board, and the planner that sends it missions."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rover_sim.arguments import factor, seconds, seed

if TYPE_CHECKING:
    from rover_sim.commands.hil_stage import Stage
    from rover_sim.hil.px4_peer import Profile, Px4Peer
    from rover_sim.hil.px4_session import Px4Session
    from rover_sim.hil.session import Driven
    from rover_sim.mavlink.tcp import TcpServer
    from rover_sim.mavlink.transport import Transport

DEFAULT_BIND = "127.0.0.1:4560"
DEFAULT_AUTOPILOT = "udpin:127.0.0.1:14540"


def configure(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("scenario", nargs="?", default="demo", help="shipped name or TOML path (default: demo)")
    parser.add_argument("--seed", type=seed, default=0, help="world and sensor noise, 0 to 2^32 - 1 (default: 0)")
    parser.add_argument(
        "--bind",
        default=DEFAULT_BIND,
        metavar="HOST:PORT",
        help=f"where PX4 connects to its simulator, or a board as /dev/ttyACM0,921600 (default: {DEFAULT_BIND})",
    )
    parser.add_argument(
        "--autopilot",
        metavar="URL",
        help=f"its MAVLink, to which missions are sent (default: {DEFAULT_AUTOPILOT}; of a board: the same line)",
    )
    parser.add_argument(
        "--connect",
        action="append",
        default=[],
        metavar="URL",
        help="pass a board's line on to a ground station, e.g. udpout:127.0.0.1:14550; repeatable",
    )
    parser.add_argument(
        "--speed", type=factor, default=1.0, help="of the wall clock, once PX4 is armed; a board has 1 (default)"
    )
    parser.add_argument("--out", type=Path, help="folder for the results (default: runs/hil-NAME-SEED)")
    parser.add_argument("--write-params", type=Path, metavar="FILE", help="first write parameters that fit the rover")
    parser.add_argument("--wait", type=seconds, default=60.0, metavar="S", help="wait so long for PX4 (default: 60)")


def execute(args: argparse.Namespace) -> int:
    """Drive until the traverse ends: 0 at the goal, 1 if it was not reached, 3 where the link failed."""
    from rover_sim.commands.hil_stage import conduct
    from rover_sim.hil.serial_board import is_board

    board = is_board(args.bind)
    _check(args, board=board)
    if args.autopilot is None:
        args.autopilot = args.bind if board else DEFAULT_AUTOPILOT
    return conduct(args, "px4", lambda stage: _session(args, stage, board=board))


def _check(args: argparse.Namespace, *, board: bool) -> None:
    from rover_sim.errors import InputError

    if args.connect and not board:
        raise InputError("--connect: for a board's line only; PX4 as a program talks to ground stations itself")
    if args.speed != 1.0 and board:
        raise InputError(f"--speed {args.speed:g}: a board has a clock of its own; allowed: 1")


@contextmanager
def _session(args: argparse.Namespace, stage: Stage, *, board: bool) -> Iterator[Px4Session]:
    from rover_sim.commands.hil_stage import say
    from rover_sim.hil.px4_peer import BOARD, PROGRAM
    from rover_sim.hil.px4_session import STEPS_PER_S, Clockwork, Px4Session, figures_text
    from rover_sim.hil.serial_board import SharedLine, open_board
    from rover_sim.pacing import Pace, wait_for_news

    if args.write_params is not None:
        _write_parameters(args.write_params, stage, board=board)
    profile = BOARD if board else PROGRAM
    clockwork = Clockwork(wait_for_news, Pace(profile.forgiven_s).left_s, args.wait, args.speed)
    with ExitStack() as opened:
        line = None
        if board:
            line = SharedLine(open_board(args.bind), args.connect)
            opened.callback(line.close)

        def begin() -> Driven:
            shared = line is not None and args.autopilot == args.bind
            return stage.begin(STEPS_PER_S, line.planner if line is not None and shared else None)

        def meet(driven: Driven) -> Px4Peer:
            transport: Transport = _opened_port(args.bind) if line is None else line.simulator
            opened.callback(transport.close)
            return _peer(args.bind, stage, driven, transport, profile)

        with Px4Session(begin, meet, clockwork, stage.watchers) as session:
            yield session
            say(figures_text(session.figures))


def _opened_port(bind: str) -> TcpServer:
    from rover_sim.commands.hil_stage import say
    from rover_sim.hil.px4_link import open_port

    port = open_port(bind)
    say(f"PX4 is expected at {bind}; start it with its simulator_mavlink at port {port.port}")
    return port


def _peer(bind: str, stage: Stage, driven: Driven, transport: Transport, profile: Profile) -> Px4Peer:
    from rover_sim.hil.px4_peer import Px4Peer
    from rover_sim.mavlink.geodesy import LocalFrame

    x, y, z = driven.traverse.simulation.chassis_motion[:3].tolist()
    return Px4Peer(transport, LocalFrame(stage.world.origin), (x, y, z), bind, profile)


def _write_parameters(path: Path, stage: Stage, *, board: bool) -> None:
    """Measure how the rover handles and write what follows; raises InputError."""
    from rover_sim.commands.hil_stage import write_parameters
    from rover_sim.hil.px4_parameters import parameter_text, parameters

    goal_radius_m = stage.world.scenario.goal.radius_m
    write_parameters(
        path,
        stage,
        "PX4",
        lambda handling, about: parameter_text(parameters(stage.rover, handling, goal_radius_m, board=board), about),
    )
