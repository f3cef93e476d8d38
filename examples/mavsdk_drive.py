"""Drive a served rover through MAVSDK: a mission, a place, a velocity, and back home.

In one terminal ``rover-sim serve``, in another ``python examples/mavsdk_drive.py``. MAVSDK is in the extra ``test``, or
``pip install mavsdk``. Works with every persona.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.offboard import Offboard, VelocityBodyYawspeed
from mavsdk.plugins.telemetry import Telemetry

METRES_A_DEGREE = 111_200.0  # of latitude


def waypoint(latitude_deg: float, longitude_deg: float) -> MissionItem:
    """A waypoint that is driven through at 0.6 m/s; MAVSDK's own acceptance radius of 3 m is a plane's."""
    return MissionItem(latitude_deg, longitude_deg, 0.0, speed_m_s=0.6, is_fly_through=True, acceptance_radius_m=0.3)


def drive(system: object, metres: float) -> None:
    """The whole round, a few metres east of where the rover stands."""
    action, mission, offboard, telemetry = Action(system), Mission(system), Offboard(system), Telemetry(system)
    while not telemetry.health_all_ok() or math.isnan(telemetry.position().latitude_deg):
        time.sleep(0.1)
    here = telemetry.position()
    east_deg = 1.0 / (METRES_A_DEGREE * math.cos(math.radians(here.latitude_deg)))

    def place(share: float) -> tuple[float, float]:
        return here.latitude_deg, here.longitude_deg + share * metres * east_deg

    mission.upload_mission(MissionPlan([waypoint(*place(0.5)), waypoint(*place(1.0))]))
    action.arm()
    mission.start_mission()
    while not mission.is_mission_finished():
        time.sleep(0.2)
    print("mission done")

    action.goto_location(*place(1.3), here.absolute_altitude_m, math.nan)
    time.sleep(3.0)
    print(f"on the way to a place at {telemetry.velocity_ned().east_m_s:.1f} m/s east")

    offboard.set_velocity_body(VelocityBodyYawspeed(0.3, 0.0, 0.0, 15.0))  # a bend to the right
    offboard.start()
    time.sleep(3.0)
    offboard.stop()
    print("drove a bend")

    action.return_to_launch()
    time.sleep(5.0)
    action.hold()
    action.disarm()
    for plugin in (action, mission, offboard, telemetry):
        plugin.destroy()


def main() -> int:
    """Find the rover and drive it; 1 if there is none."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", default="udpin://127.0.0.1:14540", help="MAVSDK's link (default: %(default)s)")
    parser.add_argument("--metres", type=float, default=4.0, help="length of the drive (default: %(default)s)")
    arguments = parser.parse_args()
    client = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    client.add_any_connection(arguments.url)
    system = client.first_autopilot(20.0)
    try:
        if system is None:
            print(f"no rover on {arguments.url}: start `rover-sim serve` first", file=sys.stderr)
            return 1
        drive(system, arguments.metres)
    finally:
        client.destroy()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
