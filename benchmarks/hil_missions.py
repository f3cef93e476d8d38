"""Whole traverses under a doubled autopilot, physics side and MAVLink side in one: how many seeds reach the goal.

    OMP_NUM_THREADS=1 uv run python benchmarks/hil_missions.py [SCENARIO] [--autopilot px4] [--seeds 10] [--first 0]

The doubles imitate ArduRover 4.6 and PX4, and are neither: this shows that our side of both links, the planner and the
physics hold together, and nothing about how well the autopilots drive.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rover_sim.hil.session import Watchers
from rover_sim.traverse import Status
from tests import ardupilot_mission, px4_mission
from worlds.scenario import Scenario, load_scenario


def line(status: Status) -> None:
    """Every 10 s of a traverse."""
    if round(status.time_s * 2) % 20 == 0:
        print(f"   {status.time_s:6.1f} s  {status.goal_distance_m:5.1f} m  {status.doing}", flush=True)


def run(autopilot: str, scenario: Scenario, seed: int, watchers: Watchers) -> tuple[dict[str, Any], str]:
    """The summary of one traverse, and what else there is to say."""
    if autopilot == "px4":
        summary, px4 = px4_mission.mission(scenario, seed, watchers)
        slip, worst_m = summary["hil"]["lockstep"], max(px4.errors_m, default=0.0)
        return summary, f", {slip['most_steps']} steps of slip, estimate off by {worst_m:.2f} m at most"
    summary, ardupilot = ardupilot_mission.mission(scenario, seed, watchers)
    return summary, ", drove a torn mission" if ardupilot.rover.started_torn else ""


def main() -> int:
    """Print a line a seed and the number of successes; exit code 1 below nine in ten."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="?", default="rock-field")
    parser.add_argument("--autopilot", choices=("ardupilot", "px4"), default="ardupilot")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--show", action="store_true", help="a line every 10 s of a traverse")
    args = parser.parse_args()
    scenario, reached = load_scenario(args.scenario), 0
    for seed in range(args.first, args.first + args.seeds):
        begin_s = time.perf_counter()
        watchers = Watchers(show=line, say=print) if args.show else Watchers(say=print)
        summary, trouble = run(args.autopilot, scenario, seed, watchers)
        wall_s = time.perf_counter() - begin_s
        reached += summary["success"]
        print(
            f"seed {seed}: {summary['reason']:10} {summary['sim_time_s']:6.1f} s, {summary['distance_m']:5.1f} m, "
            f"{summary['missions_sent']} missions, {summary['collisions']} touches, {wall_s:.0f} s of wall time"
            f"{trouble} {summary['detail']}",
            flush=True,
        )
    print(f"{scenario.name}: {reached} of {args.seeds} reached the goal under the double of {args.autopilot}")
    return 0 if reached >= 0.9 * args.seeds else 1


if __name__ == "__main__":
    sys.exit(main())
