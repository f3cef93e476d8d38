"""Speed of the whole closed loop: real-time factor on one core, and where the processor time goes.

    OMP_NUM_THREADS=1 uv run python benchmarks/loop_speed.py [SCENARIO] [--seeds 5] [--profile FILE]

Each seed is driven twice, the same drive both times: once as it is, for the factor, and once with a clock at the doors
of the stages. World, start-up and compilation are not counted (a drive before all others loads what is compiled), nor
is the report that `rover-sim run` writes after the drive, which has a line of its own. The floor is the physics alone
under the commands of the drive's trace. Times are processor time of one thread; figures are medians over the seeds.
"""

from __future__ import annotations

import argparse
import cProfile
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import cv2
import msgspec
import numpy as np

from planner import localization, navigator
from rover_sim import onboard, run_folder, traverse
from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.driven_rover import TRACE_STEPS
from rover_sim.mavlink.stack import MavlinkStack
from rover_sim.scoring import ClassScore
from rover_sim.sights import Sights
from rover_sim.sim.rasteriser import Rasteriser
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from worlds.build import build_world
from worlds.scenario import Scenario, load_scenario
from worlds.types import FloatArray

TARGET, FLOOR = 20.0, 12.0
WARM_UP_S = 6.0  # simulated, of a drive that is not counted
STAGES: dict[str, tuple[tuple[Any, str], ...]] = {
    "physics": ((Simulation, "step"),),
    "sensors and localisation": ((Simulation, "read_sensors"), (localization, "localize")),
    "renderer": ((Rasteriser, "render"), (traverse, "add_noise")),
    "perception": ((onboard, "perceive"), (onboard, "tall_things"), (onboard, "ground_hue")),
    "planner": ((navigator, "step"),),
    "autopilot": ((Autopilot, "update"),),
    "MAVLink and its log": ((MavlinkStack, "tick"), (onboard.OnboardComputer, "tick")),
    "truth, judge and trace": ((traverse.Traverse, "_observe"),),
    "scoring of the classes": ((Rasteriser, "clasts"), (ClassScore, "add")),
}


class Clocks:
    """Processor time by stage; what one stage spends inside another counts for the inner one alone."""

    def __init__(self) -> None:
        self.spent_s: dict[str, float] = defaultdict(float)
        self._open: list[str] = []
        self._since_s = 0.0

    def door(self, stage: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """``work`` with its time booked on ``stage``."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._turn(stage)
            try:
                return work(*args, **kwargs)
            finally:
                self._turn(None)

        return timed

    def _turn(self, stage: str | None) -> None:
        now_s = time.process_time()
        if self._open:
            self.spent_s[self._open[-1]] += now_s - self._since_s
        self._since_s = now_s
        if stage is None:
            self._open.pop()
        else:
            self._open.append(stage)

    @contextmanager
    def at_all_doors(self) -> Iterator[None]:
        """While it lasts all stages are clocked."""
        with ExitStack() as stack:
            for stage, doors in STAGES.items():
                for owner, name in doors:
                    stack.enter_context(patch.object(owner, name, self.door(stage, getattr(owner, name))))
            yield


def drive(scenario: Scenario, seed: int) -> tuple[float, float, float, dict[str, FloatArray]]:
    """Processor seconds of a drive and of its report, the simulated seconds, and the trace."""
    world, rover = build_world(scenario, seed), load_rover(scenario.rover.model)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        with (
            traverse.open_traverse(world, rover, traverse.RunOptions(), folder / run_folder.TLOG) as run,
            Sights(30.0, None, scenario.camera.rate_hz) as sights,
        ):
            start = time.process_time()
            summary = run.run(on_sight=sights.take)
            driven = time.process_time()
            run_folder.write(folder, run, sights, summary)
            return driven - start, time.process_time() - driven, summary["sim_time_s"], run.recorder.arrays()


def physics_alone(scenario: Scenario, seed: int, trace: dict[str, FloatArray]) -> float:
    """Processor seconds of the physics under the commands of a trace."""
    world, rover = build_world(scenario, seed), load_rover(scenario.rover.model)
    commands = trace["wheel_command"].tolist()
    with Simulation(world, rover, np.random.default_rng(seed)) as simulation:
        start = time.process_time()
        for command in commands:
            for _ in range(TRACE_STEPS):
                simulation.step(command)
        return time.process_time() - start


def profiled(scenario: Scenario, seed: int, file: Path) -> None:
    """Write a profile of one drive, to be read by `pstats`."""
    profile = cProfile.Profile(time.process_time)
    profile.runcall(drive, scenario, seed)
    profile.dump_stats(file)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenario", nargs="?", default="rock-field")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--profile", type=Path, help="also write a profile of the first seed's drive")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)  # else processor time would add up over threads
    scenario = load_scenario(arguments.scenario)
    drive(shortened(scenario, WARM_UP_S), 0)
    factors, floors, reports, spent = [], [], [], []
    for seed in range(arguments.seeds):
        used_s, report_s, simulated_s, trace = drive(scenario, seed)
        clocks = Clocks()
        with clocks.at_all_doors():
            clocked_s, *_ = drive(scenario, seed)
        alone_s = physics_alone(scenario, seed, trace)
        parts = {stage: clocks.spent_s[stage] for stage in STAGES}
        parts["the rest"] = clocked_s - sum(parts.values())
        factors.append(simulated_s / used_s)
        floors.append(simulated_s / alone_s)
        reports.append(report_s)
        spent.append({stage: 1e3 * seconds / simulated_s for stage, seconds in parts.items()})
        print(
            f"seed {seed}: {simulated_s:6.1f} s simulated, factor {factors[-1]:5.1f}, physics alone {floors[-1]:5.1f}"
        )
    factor = float(np.median(factors))
    print(f"real-time factor {factor:.1f} (wanted {TARGET:g}, at least {FLOOR:g}); {1e3 / factor:.1f} ms a second")
    print(f"floor: the physics alone {np.median(floors):.1f}; report, once: {1e3 * np.median(reports):.0f} ms")
    for stage in spent[0]:
        print(f"{np.median([one[stage] for one in spent]):9.2f} ms a simulated second  {stage}")
    if arguments.profile is not None:
        profiled(scenario, 0, arguments.profile)
    sys.exit(factor < FLOOR)


def shortened(scenario: Scenario, limit_s: float) -> Scenario:
    """The scenario, given up after ``limit_s`` simulated seconds."""
    return msgspec.structs.replace(scenario, goal=msgspec.structs.replace(scenario.goal, time_limit_s=limit_s))


if __name__ == "__main__":
    main()
