"""``rover-sim hil ardupilot``: the physics of ArduPilot Rover, and the planner that sends it missions."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rover_sim.arguments import seconds, seed

if TYPE_CHECKING:
    from rover_sim.commands.hil_stage import Stage
    from rover_sim.hil.ardupilot import ArduPilotSession
    from rover_sim.hil.lockstep import Peer

DEFAULT_PORT = 9002


def configure(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("scenario", nargs="?", default="demo", help="shipped name or TOML path (default: demo)")
    parser.add_argument("--seed", type=seed, default=0, help="world and sensor noise, 0 to 2^32 - 1 (default: 0)")
    parser.add_argument(
        "--bind",
        default=f"127.0.0.1:{DEFAULT_PORT}",
        metavar="HOST:PORT",
        help=f"where the autopilot asks for the physics (default: 127.0.0.1:{DEFAULT_PORT})",
    )
    parser.add_argument(
        "--autopilot",
        default="udpin:127.0.0.1:14550",
        metavar="URL",
        help="its MAVLink, to which missions are sent (default: udpin:127.0.0.1:14550)",
    )
    parser.add_argument("--out", type=Path, help="folder for the results (default: runs/hil-NAME-SEED)")
    parser.add_argument("--write-params", type=Path, metavar="FILE", help="first write parameters that fit the rover")
    parser.add_argument(
        "--wait", type=seconds, default=60.0, metavar="S", help="wait so long for the autopilot's packets (default: 60)"
    )


def execute(args: argparse.Namespace) -> int:
    """Drive until the traverse ends: 0 at the goal, 1 if it was not reached, 3 where the link failed."""
    from rover_sim.commands.hil_stage import conduct

    return conduct(args, "ardupilot", lambda stage: _session(args, stage))


@contextmanager
def _session(args: argparse.Namespace, stage: Stage) -> Iterator[ArduPilotSession]:
    from rover_sim.commands.hil_stage import say
    from rover_sim.driven_rover import home
    from rover_sim.hil.ardupilot import ArduPilotSession, Clockwork
    from rover_sim.hil.ardupilot_frame import ArduPilotFrame
    from rover_sim.hil.lockstep import Lockstep
    from rover_sim.hil.servo_port import ServoPort
    from rover_sim.pacing import WallClock

    if args.write_params is not None:
        _write_parameters(args.write_params, stage)
    with ServoPort(args.bind) as port:
        lockstep = Lockstep(loopback_only=port.on_loopback)
        clock, frame = WallClock(), ArduPilotFrame(stage.world.origin, home(stage.world))
        clockwork = Clockwork(clock.elapsed_s, lambda span_s: clock.wait_until(clock.elapsed_s() + span_s), args.wait)
        with ArduPilotSession(port, lockstep, lambda: stage.begin(frame=frame), clockwork, stage.watchers) as session:
            say(f"waiting at {args.bind}; start the autopilot as: {_command(args, port.address, stage)}")
            yield session
        for reason, count in lockstep.dropped.items():
            say(f"dropped datagrams, {reason}: {count}")


def _write_parameters(path: Path, stage: Stage) -> None:
    """Measure how the rover handles and write what follows; raises InputError."""
    from rover_sim.commands.hil_stage import write_parameters
    from rover_sim.hil.ardupilot_parameters import parameter_text, parameters

    goal_radius_m = stage.world.scenario.goal.radius_m
    write_parameters(
        path,
        stage,
        "ArduPilot Rover",
        lambda handling, about: parameter_text(parameters(stage.rover, handling, goal_radius_m), about),
    )


def _command(args: argparse.Namespace, address: Peer, stage: Stage) -> str:
    """The line that starts ArduPilot's simulator beside us."""
    from rover_sim.driven_rover import STEPS_PER_S
    from rover_sim.mavlink.transport import parse_url

    place, heading_deg = stage.start
    home = f"{place.latitude_deg:.7f},{place.longitude_deg:.7f},{place.altitude_m:.2f},{heading_deg:.1f}"
    parts = ["ardurover", f"--model JSON:{address[0]}", f"--home {home}", f"--rate {STEPS_PER_S}", "--wipe"]
    if address[1] != DEFAULT_PORT:
        parts.append(f"--sim-port-out {address[1]}")
    if args.write_params is not None:
        parts.append(f"--defaults {args.write_params}")
    url = parse_url(args.autopilot)
    if url.kind == "udpin":
        parts.append(f"--serial0=udpclient:{url.host}:{url.port} --serial1=none: --serial2=none:")
    return " ".join(parts)
