"""One traverse under the doubled PX4, HIL side and MAVLink side in one, in memory and on one clock."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import Any

from rover_sim.driven_rover import home
from rover_sim.hil.autopilot_link import AutopilotLink
from rover_sim.hil.handling import measure_handling
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.px4_parameters import parameters
from rover_sim.hil.px4_peer import Px4Peer
from rover_sim.hil.px4_session import STEPS_PER_S, Clockwork, Px4Session
from rover_sim.hil.session import NOBODY, Driven, Watchers
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.traverse import RunOptions, Status, Traverse
from tests.px4_double import MemoryPx4
from tests.px4_vehicle import JoinedPx4
from worlds.build import build_world
from worlds.scenario import Origin, Scenario
from worlds.types import World


class Px4Starts:
    """Starts PX4s one after another, each with a link of its own for missions."""

    def __init__(self, world: World, rover: RoverModel) -> None:
        scenario, place = world.scenario, LocalFrame(world.origin).to_geo(home(world))
        handling = measure_handling(rover, world.soil, scenario.gravity_m_s2)
        self._values = parameters(rover, handling, scenario.goal.radius_m, board=False)
        self._origin = Origin(place.latitude_deg, place.longitude_deg, place.altitude_m)
        self.hil = MemoryPx4()
        self.start()

    def start(self) -> None:
        """A new PX4, instead of one that was there."""
        self.planners_end, theirs = memory_link()
        self.vehicle = JoinedPx4(theirs, self._origin, self._values)
        self.hil.connect(self.vehicle.px4)


def mission(
    scenario: Scenario, seed: int, watchers: Watchers = NOBODY, restart_s: float = inf
) -> tuple[dict[str, Any], JoinedPx4]:
    """One traverse from a cold start of PX4: its summary, and the vehicle. ``restart_s``: PX4 is started again then."""
    world, rover = build_world(scenario, seed), load_rover(scenario.rover.model)
    frame, starts = LocalFrame(world.origin), Px4Starts(world, rover)
    first = starts.vehicle

    def begin() -> Driven:
        link, outputs = AutopilotLink(frame, home(world), starts.planners_end), OutputDriver(rover.footprint())
        return Driven(Traverse(world, rover, outputs, link, RunOptions(link_grace_s=31.0), STEPS_PER_S), outputs)

    def meet(driven: Driven) -> Px4Peer:
        x, y, z = driven.traverse.simulation.chassis_motion[:3].tolist()
        return Px4Peer(starts.hil, frame, (x, y, z), "memory")

    def show(status: Status) -> None:
        watchers.show(status)
        if status.time_s >= restart_s and starts.vehicle is first:
            starts.start()

    clockwork = Clockwork(starts.hil.wait, lambda _: 0.0, 60.0)
    with Px4Session(begin, meet, clockwork, replace(watchers, show=show)) as session:
        return session.run(), starts.vehicle
