"""``rover-sim hil``: our world as the physics of an autopilot that is not ours; one module an autopilot."""

from __future__ import annotations

import argparse
from importlib import import_module

AUTOPILOTS = {
    "ardupilot": "ArduPilot Rover, by its JSON interface",
    "px4": "PX4, by its MAVLink simulator interface, as a program or on a board",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """The autopilots, each with the arguments of its own module."""
    autopilots = parser.add_subparsers(dest="autopilot_kind", metavar="AUTOPILOT", required=True)
    for name, text in AUTOPILOTS.items():
        import_module(f"rover_sim.commands.hil_{name}").configure(autopilots.add_parser(name, help=text))


def execute(args: argparse.Namespace) -> int:
    """Be the physics of the one that was named."""
    return int(import_module(f"rover_sim.commands.hil_{args.autopilot_kind}").execute(args))
