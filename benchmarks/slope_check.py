"""Parked drift and slip against slope of the default rover, beside the reference bands.

Run: uv run python benchmarks/slope_check.py
"""

from __future__ import annotations

import sys
from math import cos, radians, sin, tan
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.world import TIME_STEP_S
from worlds.geometry import quaternion_from_euler
from worlds.scenario import Scenario, SoilChoice
from worlds.shapes import NO_ROCKS, SolidShapes
from worlds.soil import soil_preset
from worlds.types import HeightField, Pose, World

Band = tuple[float, float]
# Slip-slope bands of published curves: loose sand (Sutoh form, EX1), firm natural ground (Cuadriga field data).
BANDS: dict[str, dict[float, Band]] = {
    "loose_sand": {
        0: (0.02, 0.10),
        5: (0.05, 0.15),
        10: (0.14, 0.24),
        15: (0.28, 0.45),
        17.5: (0.37, 0.60),
        20: (0.50, 9.9),
        25: (0.98, 9.9),
    },
    "firm": {0: (-0.03, 0.03), 5: (-0.03, 0.03), 10: (-0.04, 0.04), 15: (0.02, 0.12), 20: (0.12, 0.28)},
}


def tilted_world(slope_deg: float, soil: str, gravity: float, azimuth_deg: float = 0.0) -> World:
    """A plane of 16 m that rises toward ``azimuth_deg``; the rover stands in the middle, heading east."""
    axis = np.arange(-8.0, 8.01, 0.1)
    rise = np.cos(radians(azimuth_deg)) * axis[None, :] + np.sin(radians(azimuth_deg)) * axis[:, None]
    ground = HeightField(rise * tan(radians(slope_deg)), 0.1, (-8.0, -8.0))
    scenario = Scenario(name="slope", gravity_m_s2=gravity, soil=SoilChoice(preset=soil))
    start = Pose(np.zeros(3), quaternion_from_euler(0.0, 0.0, 0.0))
    return World(
        scenario, 0, ground, NO_ROCKS, (), SolidShapes(NO_ROCKS, (), ground), soil_preset(soil), start, (5.0, 0.0, 0.0)
    )


def climb(rover: RoverModel, world: World, slope_deg: float, speed_m_s: float = 0.1, dt: float = TIME_STEP_S) -> float:
    """Mean slip of a steady climb: 1 - way made good / way of the wheels."""
    radius = rover.wheel_shape().shear_radius_m
    command = [speed_m_s / radius] * 4
    with Simulation(world, rover, np.random.default_rng(0), time_step_s=dt) as simulation:
        for _ in range(round(5.0 / dt)):
            simulation.step(command)
        begin = simulation.state.pose.position_w
        for _ in range(round(4.0 / dt)):
            simulation.step(command)
        way = simulation.state.pose.position_w - begin
    made_good = way[0] * cos(radians(slope_deg)) + way[2] * sin(radians(slope_deg))
    return 1.0 - float(made_good) / (speed_m_s * 4.0)


def parked_drift(rover: RoverModel, world: World, seconds: float = 60.0) -> float:
    """Way (m) that a rover with held wheels moves."""
    with Simulation(world, rover, np.random.default_rng(0)) as simulation:
        begin = simulation.state.pose.position_w
        for _ in range(round(seconds / simulation.dt)):
            simulation.step([0.0] * 4)
        return float(np.linalg.norm(simulation.state.pose.position_w - begin))


def main() -> int:
    """Print the table; exit code 1 where a point at Earth gravity is outside."""
    rover = load_rover("husky")
    outside = 0
    for soil, bands in BANDS.items():
        for azimuth in (0.0, 90.0):
            drift = parked_drift(rover, tilted_world(15.0, soil, 9.81, azimuth))
            outside += drift >= 0.01
            print(f"{soil:11s} parked 60 s at 15 deg, slope toward {azimuth:3.0f} deg: {1e3 * drift:6.3f} mm  limit 10")
        for gravity in (9.81, 3.71):
            for slope_deg, (low, high) in bands.items():
                slip = climb(rover, tilted_world(slope_deg, soil, gravity), slope_deg)
                inside = low <= slip <= high
                outside += gravity == 9.81 and not inside
                verdict = "inside" if inside else "OUTSIDE"
                print(f"{soil:11s} g {gravity:4.2f} {slope_deg:5.1f} deg  slip {slip:6.3f}  [{low}, {high}]  {verdict}")
    print(f"{outside} outside at g 9.81")
    return int(outside > 0)


if __name__ == "__main__":
    sys.exit(main())
