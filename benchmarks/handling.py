"""How the shipped rovers answer throttle on level ground, and the ArduPilot gains that follow.

OMP_NUM_THREADS=1 uv run python benchmarks/handling.py [--rovers husky ...] [--soils mars_sand:3.71 ...]
"""

from __future__ import annotations

import argparse
import sys

from rover_sim.hil.ardupilot_parameters import parameters
from rover_sim.hil.handling import measure_handling
from rover_sim.sim.rover import load_rover, rover_names
from worlds.soil_file import load_soil

SOILS = ("firm:9.81", "mars_sand:3.71", "loose_sand:3.71")
GAINS = ("CRUISE_SPEED", "ATC_STR_RAT_FF", "ATC_STR_RAT_MAX", "WP_PIVOT_RATE")


def main() -> int:
    """Print a line for each rover on each soil."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rovers", nargs="+", default=rover_names())
    parser.add_argument("--soils", nargs="+", default=SOILS, metavar="NAME:GRAVITY")
    args = parser.parse_args()
    print("rover        soil        g m/s2  turn rad/s  60 % m/s  full m/s  " + "  ".join(GAINS))
    for name in args.rovers:
        rover = load_rover(name)
        for soil, gravity in (text.split(":") for text in args.soils):
            found = measure_handling(rover, load_soil(soil), float(gravity))
            gains = parameters(rover, found, goal_radius_m=0.5)
            shown = "  ".join(f"{gains[gain]:{len(gain)}.3f}" for gain in GAINS)
            print(
                f"{name:12} {soil:11} {float(gravity):6.2f}  {found.turn_rate_rad_s:10.3f}  {found.cruise_m_s:8.3f}  "
                f"{found.full_m_s:8.3f}  {shown}",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
