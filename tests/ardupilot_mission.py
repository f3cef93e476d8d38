"""One traverse under the doubled ArduPilot, JSON side and MAVLink side in one, in memory and on one clock."""

from __future__ import annotations

from typing import Any

from rover_sim.driven_rover import home
from rover_sim.hil.ardupilot import ArduPilotSession
from rover_sim.hil.ardupilot_frame import ArduPilotFrame
from rover_sim.hil.ardupilot_parameters import parameters
from rover_sim.hil.autopilot_link import AutopilotLink
from rover_sim.hil.handling import measure_handling
from rover_sim.hil.lockstep import Lockstep
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.session import NOBODY, Driven, Watchers
from rover_sim.mavlink.foreign_pursuit import Patience
from rover_sim.mavlink.memory import memory_link
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, Traverse
from tests.ardupilot_rig import MemoryPort
from tests.ardupilot_vehicle import JoinedVehicle
from worlds.build import build_world
from worlds.scenario import Origin, Scenario


def mission(
    scenario: Scenario, seed: int, watchers: Watchers = NOBODY, *, patience: Patience | None = None, mute: bool = False
) -> tuple[dict[str, Any], JoinedVehicle]:
    """One traverse from a cold start of the autopilot: its summary, and the vehicle; a mute one has no MAVLink."""
    patience = patience or Patience()
    world, rover = build_world(scenario, seed), load_rover(scenario.rover.model)
    ours, theirs = memory_link()
    frame = ArduPilotFrame(world.origin, home(world))
    place = frame.to_geo(home(world))
    fitted = parameters(rover, measure_handling(rover, world.soil, scenario.gravity_m_s2), scenario.goal.radius_m)
    origin = Origin(place.latitude_deg, place.longitude_deg, place.altitude_m)
    vehicle = JoinedVehicle(memory_link()[1] if mute else theirs, origin, fitted, seed)
    port = MemoryPort(vehicle.json)

    def begin() -> Driven:
        link, outputs = AutopilotLink(frame, home(world), ours, None, patience), OutputDriver(rover.footprint())
        options = RunOptions(link_grace_s=patience.vehicle_s + 1.0, autopilot="ardupilot")
        return Driven(Traverse(world, rover, outputs, link, options), outputs)

    with ArduPilotSession(port, Lockstep(loopback_only=True), begin, port.clockwork(), watchers) as session:
        summary = session.run()
    port.take()
    return summary, vehicle
