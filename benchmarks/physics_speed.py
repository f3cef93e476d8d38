"""Speed of the physics without a camera, on one core, beside raw PyBullet on a plane in the same run.

Run: OMP_NUM_THREADS=1 uv run python benchmarks/physics_speed.py [SECONDS]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rover_sim.sim import world as physics
from rover_sim.sim.bullet import pybullet
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from worlds.build import build_world
from worlds.scenario import Goal, RoverChoice, Scenario
from worlds.types import Pose, World

COMMAND = [2.0, 2.0, 1.9, 1.9]


def rock_field() -> World:
    """Fractal ground of 40 x 40 m at 8 cm, about 2,500 rocks with a mesh (CFA 5 %)."""
    scenario = Scenario(name="speed", rover=RoverChoice(start_m=(-15.0, 0.0)), goal=Goal(position_m=(15.0, 0.0)))
    return build_world(scenario, 1)


def soil_seconds(seconds: float) -> tuple[float, float, int]:
    """CPU time of a drive and of its compiled soil calls alone, and how many steps met a rock."""
    with Simulation(rock_field(), load_rover("husky"), np.random.default_rng(0)) as simulation:
        steps, met = round(seconds / simulation.dt), 0
        begin = time.process_time()
        for step in range(steps):
            simulation.step(COMMAND)
            if step % 24 == 0:
                met += bool(simulation.state.wheel_contacts)
        total = time.process_time() - begin
        begin = time.process_time()
        for _ in range(2000):
            simulation._ground.step(simulation.dt)  # noqa: SLF001 - timed alone
        kernel = (time.process_time() - begin) / 2000
        return total / steps, kernel, 24 * met


def raw_seconds(seconds: float) -> float:
    """CPU time a step of the same rover on PyBullet's own plane, wheels by Bullet contact."""
    client = physics.connect(3.71)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0.0, plane, physicsClientId=client)
    rover = load_rover("husky")
    start = Pose(np.array([0.0, 0.0, rover.wheel.radius_m + 0.01]), np.array([0.0, 0.0, 0.0, 1.0]))
    body = physics.add_rover(client, rover, start)
    physics.drive_wheels(client, body, COMMAND, rover.motor.max_torque_Nm)
    steps = round(seconds / physics.TIME_STEP_S)
    begin = time.process_time()
    for _ in range(steps):
        pybullet.stepSimulation(physicsClientId=client)
    total = time.process_time() - begin
    pybullet.disconnect(physicsClientId=client)
    return total / steps


def main() -> int:
    """Print microseconds a step, real-time factors and their ratio."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    soil, kernel, met = soil_seconds(seconds)
    raw = raw_seconds(seconds)
    dt = physics.TIME_STEP_S
    print(f"soil forces in a rock field: {1e6 * soil:6.1f} us a step, {dt / soil:6.1f} x real time")
    print(f"  of that the compiled soil: {1e6 * kernel:6.1f} us a step; a wheel on rock in about {met} steps")
    print(f"raw PyBullet on a plane:     {1e6 * raw:6.1f} us a step, {dt / raw:6.1f} x real time")
    print(f"ratio soil / raw: {soil / raw:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
