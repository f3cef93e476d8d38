"""One traverse under the doubled PX4, HIL side and MAVLink side in one, in memory and on one clock."""

from __future__ import annotations

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
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, Traverse
from tests.px4_double import MemoryPx4
from tests.px4_vehicle import JoinedPx4
from worlds.build import build_world
from worlds.scenario import Origin, Scenario


def mission(scenario: Scenario, seed: int, watchers: Watchers = NOBODY) -> tuple[dict[str, Any], JoinedPx4]:
    """One traverse from a cold start of PX4: its summary, and the vehicle."""
    world, rover = build_world(scenario, seed), load_rover(scenario.rover.model)
    ours, theirs = memory_link()
    place = LocalFrame(world.origin).to_geo(home(world))
    origin = Origin(place.latitude_deg, place.longitude_deg, place.altitude_m)
    handling = measure_handling(rover, world.soil, scenario.gravity_m_s2)
    vehicle = JoinedPx4(theirs, origin, parameters(rover, handling, scenario.goal.radius_m, board=False))
    link, outputs = AutopilotLink(LocalFrame(world.origin), home(world), ours), OutputDriver(rover.footprint())
    traverse = Traverse(world, rover, outputs, link, RunOptions(link_grace_s=31.0), STEPS_PER_S)
    hil = MemoryPx4(vehicle.px4)
    x, y, z = traverse.simulation.chassis_motion[:3].tolist()
    peer = Px4Peer(hil, LocalFrame(world.origin), (x, y, z), "memory")
    clockwork = Clockwork(hil.wait, lambda _: 0.0, 60.0)
    try:
        return Px4Session(peer, Driven(traverse, outputs), clockwork, watchers).run(), vehicle
    finally:
        traverse.close()
