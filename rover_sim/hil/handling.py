"""How a rover answers full and part throttle on level ground, measured: what an autopilot's gains are made from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rover_sim.sim.rover import RoverModel
from rover_sim.sim.simulation import Simulation
from rover_sim.slope.rig import Stretch, drive, plane_world
from rover_sim.slope.turning import turned_rad
from worlds.soil import Soil

CRUISE_SHARE = 0.6  # of full speed, at which the cruise speed is told
_RUN_IN_S, _MEASURED_S = 2.0, 2.0
_SPARE_M = 4.0


@dataclass(frozen=True)
class Handling:
    """Steady motion under steady outputs."""

    turn_rate_rad_s: float  # one side full ahead, the other full astern
    cruise_m_s: float  # both sides at `CRUISE_SHARE`
    full_m_s: float  # both sides full ahead


def measure_handling(rover: RoverModel, soil: Soil, gravity_m_s2: float) -> Handling:
    """Three short drives in our own physics, ruts and slip included."""
    turning = _steady(rover, soil, gravity_m_s2, 1.0, -1.0)
    cruising = _steady(rover, soil, gravity_m_s2, CRUISE_SHARE, CRUISE_SHARE)
    rushing = _steady(rover, soil, gravity_m_s2, 1.0, 1.0)
    return Handling(-turned_rad(turning) / turning.time_s, _speed_m_s(cruising), _speed_m_s(rushing))


def _steady(rover: RoverModel, soil: Soil, gravity_m_s2: float, left: float, right: float) -> Stretch:
    """A stretch under constant shares of full speed, once it is steady."""
    full, half = rover.motor.max_speed_rad_s, len(rover.wheel.positions_m) // 2
    way_m = full * rover.wheel.radius_m * (_RUN_IN_S + _MEASURED_S)
    world = plane_world(soil, gravity_m_s2, 0.0, 0.0, 2.0 * (way_m + _SPARE_M))
    speeds = [left * full] * half + [right * full] * half
    with Simulation(world, rover, np.random.default_rng(0)) as simulation:
        drive(simulation, speeds, _RUN_IN_S)
        return drive(simulation, speeds, _MEASURED_S)


def _speed_m_s(stretch: Stretch) -> float:
    return float(np.linalg.norm(stretch.way_w)) / stretch.time_s
