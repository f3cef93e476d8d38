"""Speed of the physics without a camera: soil wheels and ruts beside raw PyBullet and MuJoCo contact wheels.

    OMP_NUM_THREADS=1 uv run python benchmarks/physics_speed.py [--seconds 20] [--repeat 5] [--rocks 0.08:0.35 ...]

All drive the same commands over the same 20 m x 20 m of fractal ground (8 cm) with the same 300 rocks at 240 Hz. Sizes
follow the size-frequency law: 8 to 35 cm, 8 cm to 1.2 m, and, where the rover is nearly always stuck at something, 300
rocks of 20 cm to 1.2 m. Figures are medians of process CPU time over drives that begin at
different places; in each repetition the programs take turns, so that a busy machine slows all of them.
MuJoCo is optional: ``uv pip install mujoco``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.physics_peers import Driven, bullet_drive, mujoco_drive
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.world import TIME_STEP_S
from worlds.build import build_world
from worlds.rock_sizes import expected_number
from worlds.scenario import Goal, Rocks, RoverChoice, Scenario, Terrain
from worlds.shapes import SolidShapes
from worlds.types import World

SIDE_M = 20.0
ROCKS = 300
MIXES_M = ((0.08, 0.35), (0.08, 1.2), (0.2, 1.2))
STARTS_M = ((-5.0, -5.0), (-5.0, 5.0), (5.0, -5.0), (0.0, 0.0), (5.0, 5.0), (-7.0, 0.0), (0.0, -7.0))
TARGET, FLOOR = 100.0, 60.0
MOST_US = 10.0  # for four wheels

Drive = Callable[[World, RoverModel, int], Driven | None]


def command(step: int) -> tuple[float, float]:
    """Wheel speeds (rad/s) of the left and right side: bends to both sides and some backing out."""
    seconds = step * TIME_STEP_S % 16.0
    if seconds < 6.0:
        return 2.4, 2.0
    if seconds < 8.0:
        return -2.0, -1.2
    return (2.0, 2.4) if seconds < 14.0 else (-1.2, -2.0)


def field_of(sizes_m: tuple[float, float], start_m: tuple[float, float], seed: int) -> World:
    """Fractal ground with exactly `ROCKS` rocks that have a mesh, of these sizes."""
    smallest, largest = sizes_m
    wanted, low, high = 1.25 * ROCKS, 1e-4, 0.3
    for _ in range(40):
        middle = (low + high) / 2.0
        if expected_number(middle, smallest, largest, SIDE_M**2) < wanted:
            low = middle
        else:
            high = middle
    scenario = Scenario(
        name="speed",
        terrain=Terrain(size_m=(SIDE_M, SIDE_M), resolution_m=0.08),
        rocks=Rocks(cfa=high, min_diameter_m=smallest, max_diameter_m=largest, clear_radius_m=0.8),
        rover=RoverChoice(start_m=start_m),
        goal=Goal(position_m=(-start_m[0], -start_m[1])),
    )
    world = build_world(scenario, seed)
    kept = np.sort(np.random.default_rng(seed).permutation(len(world.rocks))[:ROCKS]).astype(np.int32)
    rocks = world.rocks.chosen(kept)
    assert len(rocks) == ROCKS
    return replace(world, rocks=rocks, shapes=SolidShapes(rocks, (), world.ground))


def our_drive(world: World, rover: RoverModel, steps: int) -> Driven:
    """This program, ruts on."""
    half = len(rover.wheel.positions_m) // 2
    commands = [[left] * half + [right] * half for left, right in map(command, range(steps))]
    spent = way = 0.0
    met = 0
    with Simulation(world, rover, np.random.default_rng(0)) as simulation:
        place = simulation.state.pose.position_w
        for second in np.array_split(np.arange(steps), max(1, steps // 240)):
            begin = time.process_time()
            for step in second:
                simulation.step(commands[step])
            spent += time.process_time() - begin
            met += bool(simulation.state.wheel_contacts)
            way += float(np.linalg.norm(simulation.state.pose.position_w - place))
            place = simulation.state.pose.position_w
    return Driven(spent / steps, way, met / max(1, steps // 240))


def peer(drive: Callable[[World, RoverModel, list[tuple[float, float]]], Driven | None]) -> Drive:
    """A peer that takes its commands as pairs."""
    return lambda world, rover, steps: drive(world, rover, [command(step) for step in range(steps)])


PROGRAMS: dict[str, Drive] = {
    "rover-sim, soil wheels and ruts": our_drive,
    "PyBullet, contact wheels": peer(bullet_drive),
    "MuJoCo, contact wheels": peer(mujoco_drive),
}


def measure(sizes_m: tuple[float, float], seconds: float, repeat: int) -> dict[str, list[Driven]]:
    """The drives of each program; none where a program is not installed."""
    rover, steps = load_rover("husky"), round(seconds / TIME_STEP_S)
    our_drive(field_of(sizes_m, STARTS_M[0], 0), rover, 240)  # compiles
    found: dict[str, list[Driven]] = {name: [] for name in PROGRAMS}
    for place in range(repeat):
        world = field_of(sizes_m, STARTS_M[place % len(STARTS_M)], place)
        for name, drive in PROGRAMS.items():
            driven = drive(world, rover, steps)
            if driven is not None:
                found[name].append(driven)
    return found


def describe(name: str, ours: list[Driven], others: list[Driven]) -> str:
    """A line of the table."""
    if not others:
        return f"  {name:32} not installed"
    factors = [TIME_STEP_S / driven.step_s for driven in others]
    ratio = median(other.step_s / own.step_s for own, other in zip(ours, others, strict=True))
    way = sum(driven.way_m for driven in others) / len(others)
    return (
        f"  {name:32} {median(factors):6.1f} x real time ({min(factors):.1f} to {max(factors):.1f}), "
        f"{way:4.1f} m a drive; rover-sim is {ratio:.2f} times as fast"
    )


def wheel_soil_us() -> float:
    """Processor time (us) of the compiled ground step of four wheels and the belly while they drive; median of many."""
    rover = load_rover("husky")
    with Simulation(field_of(MIXES_M[0], STARTS_M[0], 0), rover, np.random.default_rng(0)) as simulation:
        for _ in range(480):
            simulation.step([2.0] * len(rover.wheel.positions_m))
        ground, calls, times = simulation._ground, 200, []  # noqa: SLF001 - timed alone
        for _ in range(50):
            begin = time.process_time()
            for _ in range(calls):
                ground.step(simulation.dt)
            times.append((time.process_time() - begin) / calls)
    return 1e6 * median(times)


def _sizes(text: str) -> tuple[float, float]:
    """FROM:TO in metres."""
    smallest, largest = text.split(":")
    return float(smallest), float(largest)


def main() -> int:
    """Print a table for each mix of rocks; exit code 1 where the floor is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--rocks", type=_sizes, nargs="+", default=MIXES_M, metavar="FROM:TO", help="diameters in m")
    args = parser.parse_args()
    slowest = np.inf
    for sizes in args.rocks:
        found = measure(sizes, args.seconds, args.repeat)
        ours = next(iter(found.values()))
        slowest = min(slowest, TIME_STEP_S / median(driven.step_s for driven in ours))
        on_rock = 100.0 * sum(driven.on_rock or 0.0 for driven in ours) / len(ours)
        print(f"{ROCKS} rocks of {sizes[0]:g} to {sizes[1]:g} m, a wheel on rock {on_rock:.0f} % of the time")
        for name, driven in found.items():
            print(describe(name, ours, driven), flush=True)
    print(
        f"wheel-soil step of four wheels, ruts and belly included: {wheel_soil_us():.1f} us; to stay under {MOST_US:g}"
    )
    print(f"slowest median of rover-sim: {slowest:.1f} x real time; target {TARGET:g}, floor {FLOOR:g}")
    return 0 if slowest >= FLOOR else 1


if __name__ == "__main__":
    sys.exit(main())
