"""Slip of the default rover on the reference slopes, and how far it drifts when parked; exit code 1 where one is off.

Run: uv run python benchmarks/slope_check.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.slope.bands import band_slopes
from rover_sim.slope.rig import Setup, measure_slope, plane_world
from worlds.soil import soil_preset

PARKED_S = 60.0
LIMIT_M = 0.01


def parked_drift(soil: str, azimuth_deg: float) -> float:
    """Way (m) that a rover with held wheels moves on 15 degrees."""
    world = plane_world(soil_preset(soil), 9.81, 15.0, azimuth_deg, 8.0)
    with Simulation(world, load_rover("husky"), np.random.default_rng(0)) as simulation:
        begin = simulation.state.pose.position_w
        for _ in range(round(PARKED_S / simulation.dt)):
            simulation.step([0.0] * 4)
        return float(np.linalg.norm(simulation.state.pose.position_w - begin))


def main() -> int:
    """Print the table; exit code 1 where a point is off."""
    off = 0
    for soil in ("loose_sand", "firm"):
        for azimuth_deg in (0.0, 90.0):
            drift = parked_drift(soil, azimuth_deg)
            off += drift >= LIMIT_M
            print(f"{soil:11s} parked {PARKED_S:.0f} s at 15 deg toward {azimuth_deg:2.0f}: {1e3 * drift:.3f} mm of 10")
        for slope_deg in band_slopes(soil):
            point = measure_slope(Setup(soil, 9.81, "husky", 0.0, 0.1), "up", slope_deg)
            off += point.inside is False
            print(f"{soil:11s} {slope_deg:4.1f} deg  slip {point.slip:6.3f}  {point.band}  inside: {point.inside}")
    print(f"{off} off")
    return int(off > 0)


if __name__ == "__main__":
    sys.exit(main())
