"""The alarm of tip-over in random runs: how long before the tip it comes, what it misses, how often it is for nothing.

Rovers with their centre of mass raised by up to 0.6 track widths drive at random speed over slopes of up to 40 degrees,
against steps, over ledges, and are pushed by up to their own weight for up to 1.5 s; three gravities, three soils. The
tip is what the judge of a traverse calls so, a tilt of 60 degrees; the lead is also counted to the last moment at which
the rover, at rest, would have stayed up. No alarm can be 0.3 s ahead of that where a rover at speed trips over an edge.

Run: OMP_NUM_THREADS=1 uv run python benchmarks/tip_alarm.py [RUNS] [FIRST_SEED] [PROCESSES]
"""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from math import cos, pi, radians, sin, tan
from multiprocessing import get_context
from pathlib import Path

import msgspec
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rover_sim.outcome import Limits
from rover_sim.sim.mobility_events import TIP_OVER, MobilityLog
from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.sim.simulation import Simulation
from worlds.geometry import quaternion_from_euler
from worlds.scenario import Scenario
from worlds.shapes import NO_ROCKS, SolidShapes
from worlds.soil import soil_preset
from worlds.types import Cylinder, FloatArray, HeightField, Pose, Vector3, World

LOOK_STEPS, STEPS_PER_S, SECONDS = 10, 240, 5.0
NEEDED_S = 0.3
CELL_M, SIDE_M = 0.08, 12.0
STABLE_RAD = 0.25  # tip angle that a rover must have left where a run begins


@dataclass(frozen=True)
class Trial:
    """One random run."""

    kind: str
    rover: RoverModel
    world: World
    wheel_speeds: tuple[float, ...]
    push_w: Vector3 = (0.0, 0.0, 0.0)
    push_s: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Outcome:
    """What came of it; leads are seconds, None without an alarm at that moment."""

    kind: str
    tipped: bool
    alarmed: bool
    lead_s: float | None
    lead_to_unstable_s: float | None
    least_angle_rad: float


def raised_rover(rng: np.random.Generator) -> RoverModel:
    """A shipped four-wheeled rover with its load somewhere above its deck."""
    rover = load_rover(str(rng.choice(["husky", "jackal"])))
    x, y = rng.uniform(-0.09, 0.09) * rover.track_m, rng.uniform(-0.05, 0.05) * rover.track_m
    z = rover.chassis.centre_of_mass_m[2] + rng.uniform(0.0, 0.6) * rover.track_m
    chassis = msgspec.structs.replace(rover.chassis, centre_of_mass_m=(float(x), float(y), float(z)))
    return msgspec.structs.replace(rover, chassis=chassis)


def heights(kind: str, rover: RoverModel, rng: np.random.Generator) -> FloatArray:
    """A plane, with a ledge to fall off beside or ahead of the rover where ``kind`` says so."""
    axis = np.arange(-SIDE_M / 2, SIDE_M / 2 + 1e-9, CELL_M)
    x, y = np.meshgrid(axis, axis)
    azimuth = rng.uniform(0.0, 2.0 * pi)
    steepness = tan(radians(rng.uniform(0.0, 40.0 if kind == "slope" else 20.0)))
    ground = steepness * (x * cos(azimuth) + y * sin(azimuth))
    if kind == "ledge":
        turn, drop = rng.uniform(-0.5, 0.5), rng.uniform(0.5, 2.0) * rover.wheel.radius_m
        beyond = y * cos(turn) - x * sin(turn) - rng.uniform(-0.15, 0.65) * rover.track_m
        ground = ground - drop * np.clip(beyond / 0.1, 0.0, 1.0)
    return np.asarray(ground)


def draw(seed: int) -> Trial:
    """The trial of a seed."""
    rng = np.random.default_rng(seed)
    kind = str(rng.choice(["slope", "ledge", "step", "push"]))
    rover = raised_rover(rng)
    gravity = float(rng.choice([1.62, 3.71, 9.81]))
    soil = str(rng.choice(["firm", "loose_sand", "upland_sandy_loam"]))
    ground = HeightField(heights(kind, rover, rng), CELL_M, (-SIDE_M / 2, -SIDE_M / 2))
    steps: tuple[Cylinder, ...] = ()
    if kind == "step":
        radius, height = rng.uniform(0.2, 1.0), rng.uniform(0.3, 1.3) * rover.wheel.radius_m
        place = (float(0.7 + radius + rng.uniform(0.0, 0.4)), float(rng.uniform(-0.5, 0.5) * radius), 0.0)
        steps = (Cylinder(1, place, float(radius), float(height)),)
    start = Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0))
    scenario = Scenario(name=kind, gravity_m_s2=gravity)
    shapes = SolidShapes(NO_ROCKS, steps, ground)
    world = World(scenario, seed, ground, NO_ROCKS, steps, shapes, soil_preset(soil), start, (5.0, 0.0, 0.0))
    speed = rng.uniform(0.0, 1.0) * min(rover.motor.max_speed_rad_s * rover.wheel.radius_m, 1.2)
    turn = rng.uniform(-0.6, 0.6)
    sides = [float(speed * (1.0 + sign * turn) / rover.wheel.radius_m) for sign in (-1, 1)]
    wheels = (sides[0], sides[0], sides[1], sides[1])
    if kind != "push":
        return Trial(kind, rover, world, wheels)
    angle, force = rng.uniform(0.0, 2.0 * pi), rng.uniform(0.2, 1.0) * rover.mass_kg * gravity
    begin, length = rng.uniform(0.5, 1.5), rng.uniform(0.1, 1.5)
    push = (float(force * cos(angle)), float(force * sin(angle)), 0.0)
    return Trial(kind, rover, world, wheels, push, (float(begin), float(begin + length)))


def run(seed: int) -> Outcome:
    """The first trial of ``seed`` that begins on firm feet."""
    for again in range(50):
        trial = draw(seed + 1_000_000 * again)
        with Simulation(trial.world, trial.rover, np.random.default_rng(0)) as simulation:
            if float(simulation.state.tip_angle_rad.min()) > STABLE_RAD:
                return drive(trial, simulation)
    raise RuntimeError(f"no steady start for seed {seed}")


def drive(trial: Trial, simulation: Simulation) -> Outcome:
    """Drive until the rover has tipped, has left the map, or the time is over."""
    log = MobilityLog(trial.rover, trial.world.scenario.gravity_m_s2)
    since_s = unstable_s = lead_to_unstable_s = None
    least, begin_s, end_s = 9.9, *trial.push_s
    for step in range(int(SECONDS * STEPS_PER_S)):
        if begin_s <= simulation.time_s < end_s:
            simulation.push(trial.push_w)
        simulation.step(trial.wheel_speeds)
        if step % LOOK_STEPS:
            continue
        state = simulation.state
        log.look(state, LOOK_STEPS / STEPS_PER_S)
        alarm = bool(log.memory.active[TIP_OVER, -1])
        since_s = (state.time_s if since_s is None else since_s) if alarm else None
        left = float(state.tip_angle_rad.min())
        least = min(least, left)
        if left > 0.0:
            unstable_s = None
        elif unstable_s is None:
            unstable_s = state.time_s
            lead_to_unstable_s = None if since_s is None else state.time_s - since_s
        if state.tilt_rad > Limits().tip_rad:
            lead_s = None if since_s is None else state.time_s - since_s
            return Outcome(trial.kind, True, since_s is not None, lead_s, lead_to_unstable_s, least)
        if state.off_map:
            break
    return Outcome(trial.kind, False, any(event.kind == "imminent_tip_over" for event in log.events), None, None, least)


def report(outcomes: list[Outcome]) -> int:
    """Print the figures; the number of tips that came without 0.3 s of alarm."""
    tips = [outcome for outcome in outcomes if outcome.tipped]
    kinds = Counter(outcome.kind for outcome in tips)
    print(f"{len(outcomes)} runs, {len(tips)} tipped: {', '.join(f'{k} {n}' for k, n in sorted(kinds.items()))}")
    missed = [outcome for outcome in tips if outcome.lead_s is None or outcome.lead_s < NEEDED_S]
    for name, leads in (
        ("the tip (tilt 60 deg)", [outcome.lead_s or 0.0 for outcome in tips]),
        ("the last stable moment", [outcome.lead_to_unstable_s or 0.0 for outcome in tips]),
    ):
        spread = " ".join(f"{value:.2f}" for value in np.percentile(leads, [0, 1, 5, 25, 50, 75])) if leads else "-"
        short = sum(lead < NEEDED_S for lead in leads)
        print(f"lead to {name}: min, 1, 5, 25, 50, 75 %: {spread} s; under {NEEDED_S} s: {short}")
    quiet = [outcome for outcome in outcomes if not outcome.tipped]
    told = [outcome for outcome in quiet if outcome.alarmed]
    close = sum(outcome.least_angle_rad < STABLE_RAD for outcome in told)
    print(
        f"{len(quiet)} runs without a tip: alarm in {len(told)}, of which {close} came within {STABLE_RAD} rad of one"
    )
    print(f"missed: {len(missed)}")
    return len(missed)


def main() -> int:
    """Run the trials; exit code 1 where the alarm missed a tip."""
    runs, first, processes = (int(text) for text in [*sys.argv[1:], *("1000", "0", "2")[len(sys.argv) - 1 :]])
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        return int(report(list(pool.map(run, range(first, first + runs), chunksize=10))) > 0)


if __name__ == "__main__":
    sys.exit(main())
