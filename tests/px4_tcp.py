"""The doubled PX4 as a program of its own, to try ``rover-sim hil px4`` with; it is not PX4.

    uv run python -m tests.px4_tcp SCENARIO [--seed 0] [--port 4560] [--mavlink udpout:127.0.0.1:14540]

It knows where home is from the scenario, and how the rover handles from the same measurement as ``--write-params``.
Ends when the simulator does, or says what it would not stand.
"""

from __future__ import annotations

import argparse
import sys

from rover_sim.driven_rover import home
from rover_sim.hil.handling import measure_handling
from rover_sim.hil.px4_parameters import parameters
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.transport import open_link
from rover_sim.sim.rover import load_rover
from tests.px4_checks import ViolationError
from tests.px4_double import Px4Process
from tests.px4_vehicle import JoinedPx4
from worlds.build import build_world
from worlds.scenario import Origin, load_scenario


def main() -> int:
    """0 when the simulator has ended, 1 with what was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--port", type=int, default=4560)
    parser.add_argument("--mavlink", default="udpout:127.0.0.1:14540")
    args = parser.parse_args()
    scenario = load_scenario(args.scenario)
    world, rover = build_world(scenario, args.seed, source=args.scenario), load_rover(scenario.rover.model)
    place = LocalFrame(world.origin).to_geo(home(world))
    handling = measure_handling(rover, world.soil, scenario.gravity_m_s2)
    values = parameters(rover, handling, scenario.goal.radius_m, board=False)
    origin = Origin(place.latitude_deg, place.longitude_deg, place.altitude_m)
    vehicle = JoinedPx4(open_link(args.mavlink), origin, values)
    process = Px4Process(args.port, vehicle.px4, within_s=600.0)
    try:
        process.live()
    except (ViolationError, OSError) as error:
        sys.stderr.write(f"px4 double: {error}\n")
        return 1
    sys.stdout.write(f"px4 double: {vehicle.px4.checks.believed.sensors} steps, all as PX4 wants them\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
