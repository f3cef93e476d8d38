"""What ``rover-sim hil`` does for whichever autopilot: world, planner's link, traverse, run folder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from rover_sim import run_folder
from rover_sim.commands.traverse_display import expected_s, print_summary, progress_bar
from rover_sim.driven_rover import STEPS_PER_S, home
from rover_sim.errors import InputError
from rover_sim.fault_log import AutopilotKind, idle_notes
from rover_sim.files import output_folder, write_text
from rover_sim.hil.autopilot_link import AutopilotLink
from rover_sim.hil.handling import Handling, measure_handling
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.session import Driven, Watchers
from rover_sim.mavlink.foreign_pursuit import Patience
from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame, heading_deg
from rover_sim.mavlink.transport import Transport, open_link, parse_url
from rover_sim.outcome import Reason
from rover_sim.sights import Sights
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.stop_flag import stop_flag
from rover_sim.traverse import RunOptions, Traverse
from worlds.build import build_world
from worlds.geometry import euler_from_quaternion
from worlds.scenario import load_scenario
from worlds.types import World

EXIT_LINK = 3
_PATIENCE = Patience()


class Session(Protocol):
    """A traverse under an autopilot outside."""

    @property
    def traverse(self) -> Traverse:
        """The traverse, which may become another one."""
        ...

    def run(self) -> dict[str, Any]:
        """Serve until the traverse ends and return its summary."""
        ...


@dataclass(frozen=True)
class Stage:
    """All that a session needs but its own link to the autopilot."""

    world: World
    rover: RoverModel
    folder: Path
    url: str  # of the autopilot's MAVLink
    kind: AutopilotKind
    watchers: Watchers

    def begin(
        self, steps_per_s: int = STEPS_PER_S, missions: Transport | None = None, frame: LocalFrame | None = None
    ) -> Driven:
        """The traverse from its start, with a new link for the missions unless one is given.

        ``frame``: as the autopilot lays the world on the Earth, where that is not the ellipsoid.
        """
        transport = open_link(self.url) if missions is None else missions
        place = LocalFrame(self.world.origin) if frame is None else frame
        link = AutopilotLink(place, home(self.world), transport, self.folder / run_folder.TLOG, _PATIENCE)
        outputs = OutputDriver(self.rover.footprint())
        # Before that the companion itself gives up an autopilot that says nothing, and says what it waited for.
        options = RunOptions(link_grace_s=_PATIENCE.vehicle_s + 1.0, autopilot=self.kind)
        return Driven(Traverse(self.world, self.rover, outputs, link, options, steps_per_s), outputs)

    @property
    def start(self) -> tuple[GeoPoint, float]:
        """Where the rover stands at first, and its compass heading in degrees: the autopilot's home."""
        yaw_rad = euler_from_quaternion(self.world.start.quaternion_w)[2]
        return LocalFrame(self.world.origin).to_geo(home(self.world)), heading_deg(yaw_rad)


def conduct(
    args: argparse.Namespace, kind: AutopilotKind, open_session: Callable[[Stage], AbstractContextManager[Session]]
) -> int:
    """Drive until the traverse ends: 0 at the goal, 1 if it was not reached, 3 where the link failed."""
    scenario = load_scenario(args.scenario)
    rover = load_rover(scenario.rover.model)
    parse_url(args.autopilot)
    folder = args.out or Path("runs") / f"hil-{scenario.name}-{args.seed}"
    with stop_flag() as stopped, progress_bar(scenario.name, args.seed) as show:
        world = build_world(scenario, args.seed, source=args.scenario)
        for note in (*world.notes, *idle_notes(scenario.event, kind)):
            say(note)
        output_folder(folder)
        with Sights(expected_s(scenario) / 2, None, scenario.camera.rate_hz) as sights:
            stage = Stage(world, rover, folder, args.autopilot, kind, Watchers(show, stopped, sights.take, say))
            with open_session(stage) as session:
                run_folder.clear(folder)
                summary = session.run()
                run_folder.write(folder, session.traverse, sights, summary)
    print_summary(summary, folder)
    if summary["reason"] == Reason.LINK_LOST:
        return EXIT_LINK
    return 0 if summary["success"] else 1


def write_parameters(path: Path, stage: Stage, title: str, text_of: Callable[[Handling, str], str]) -> None:
    """Measure how the rover handles on the world's soil, and write the file that follows from it; raises InputError.

    ``text_of`` makes it of the handling and a line that says what it is for.
    """
    gravity = stage.world.scenario.gravity_m_s2
    handling = measure_handling(stage.rover, stage.world.soil, gravity)
    about = f"{title} for {stage.rover.name} on {stage.world.soil.name}, {gravity:g} m/s2"
    try:
        write_text(path, text_of(handling, about))
    except OSError as error:
        raise InputError(f"--write-params {path}: {error.strerror}; give a file that may be written") from error


def say(text: str) -> None:
    """A line that the user should read."""
    print(f"rover-sim hil: {text}", file=sys.stderr)  # noqa: T201 - what it is for
