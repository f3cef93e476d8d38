"""Command line: one parser, each command imported only when it runs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from rover_sim import __version__
from rover_sim.errors import InputError, LinkError

COMMANDS = {
    "run": "one closed-loop traverse: perceive, plan, upload missions, drive",
    "hil": "be the physics of ArduPilot or PX4, and plan for it",
    "serve": "the rover as a live MAVLink vehicle for a ground station",
    "handover": "upload a plan to an autopilot that is not ours, and follow it",
    "teleop": "steer a rover by keyboard or gamepad",
    "trials": "many traverses over a grid of conditions, with a report",
    "slope": "slope and traction stress test against published curves",
    "perceive": "the perception pipeline on any picture",
    "calibrate": "a camera file from pictures of a board",
    "score": "rocks or terrain classes against labels",
    "learn": "from labelled pictures to a knowledge file, cross-validated",
    "world": "make or picture a world",
}
EXIT_INPUT = 2
EXIT_LINK = 3
EXIT_INTERRUPTED = 130


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like every other user error."""

    def error(self, message: str) -> NoReturn:
        """Print the one line and end with exit code 2."""
        self.exit(EXIT_INPUT, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _listing() -> str:
    """The commands and what they do, for the help text."""
    return "commands:\n" + "\n".join(f"  {name:<10}{text}" for name, text in COMMANDS.items())


def build_parser(command: str | None) -> argparse.ArgumentParser:
    """Parser with the arguments of ``command`` only, so that no other command is imported."""
    parser = _Parser(
        prog="rover-sim",
        description="A skid-steer rover on soft, rock-strewn ground that sees, plans and sends MAVLink missions.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=_listing(),
    )
    parser.add_argument("--version", action="version", version=f"rover-sim {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=_Parser)
    for name, text in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=text, description=text)
        if name == command:
            import_module(f"rover_sim.commands.{name}").configure(subparser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the return value is the exit code of ``docs/architecture.md``."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    command = next((word for word in arguments if word in COMMANDS), None)
    parsed = build_parser(command).parse_args(arguments)
    try:
        return int(import_module(f"rover_sim.commands.{parsed.command}").execute(parsed))
    except (InputError, LinkError) as error:
        print(f"rover-sim {parsed.command}: {error}", file=sys.stderr)  # noqa: T201 - the one line a user gets
        return EXIT_INPUT if isinstance(error, InputError) else EXIT_LINK
    except KeyboardInterrupt:
        print(f"rover-sim {parsed.command}: interrupted", file=sys.stderr)  # noqa: T201 - the same
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of a pipe went away (`| head`): nothing is left to say.
        sys.stderr.close()
        return 0
