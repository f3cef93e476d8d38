"""Drawbar test: a load vehicle holds the rover at an imposed slip on level ground, and the tow force is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_sim.sim.simulation import Simulation
from rover_sim.sim.world import set_gravity
from rover_sim.slope.rig import Setup, plane_world
from worlds.soil_file import load_soil
from worlds.wong_reece import steady_wheel

IMPOSED_SLIPS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 0.95)

# The load vehicle: its brake follows the speed it is to hold, proportionally and with an integral part.
_STEPS = 4  # of the physics between two settings of the brake
_STIFFNESS_1_S = 20.0
_RESET_1_S = 10.0
_RUN_IN = 1.2  # wheelbases made good: the rear wheels are then in the ruts of the front ones
_SHORTEST_RUN_IN = 2.0  # wheelbases of wheel travel
_MEASURED_WAY = 0.5
_SIZE_M = 12.0


@dataclass(frozen=True)
class DrawbarPoint:
    """Pull of the rover at one slip."""

    soil: str
    gravity_m_s2: float
    rover: str
    slip: float
    pull_N: float  # tow force; negative where the rover has to be pushed
    pull_per_weight: float
    power_W: float
    sinkage_m: float
    steady_wheel_per_weight: float  # the same of as many steady Wong-Reece wheels, equal loads, fresh soil


class _LoadVehicle:
    """Holds the speed of a rover by a force at its centre of mass, which a level part of gravity stands for."""

    def __init__(self, simulation: Simulation, speed_m_s: float, gravity_m_s2: float) -> None:
        self._simulation, self._speed, self._gravity = simulation, speed_m_s, gravity_m_s2
        self._held_m_s2 = 0.0

    def tow(self, wheel_speeds_rad_s: Sequence[float], seconds: float) -> float:
        """Drive for a while; the mean tow per mass (m/s2)."""
        tows = []
        for _ in range(round(seconds / self._simulation.dt / _STEPS)):
            tows.append(self._brake())
            for _ in range(_STEPS):
                self._simulation.step(wheel_speeds_rad_s)
        return float(np.mean(tows))

    def _brake(self) -> float:
        """Set the tow until the next call; the force per mass (m/s2)."""
        error = float(self._simulation.state.linear_velocity_w[0]) - self._speed
        self._held_m_s2 += _STIFFNESS_1_S * _RESET_1_S * error * _STEPS * self._simulation.dt
        tow = _STIFFNESS_1_S * error + self._held_m_s2
        set_gravity(self._simulation.client, (-tow, 0.0, -self._gravity))
        return tow


def measure_drawbar(setup: Setup, slip: float) -> DrawbarPoint:
    """Tow force, power and sinkage at an imposed slip below 1, averaged once they are steady."""
    rover, soil = setup.model(), load_soil(setup.soil)
    shape = rover.wheel_shape()
    speeds = [setup.speed_m_s / shape.shear_radius_m] * len(rover.wheel.positions_m)
    wheelbase_s = rover.wheelbase_m / setup.speed_m_s
    world = plane_world(soil, setup.gravity_m_s2, 0.0, 0.0, max(_SIZE_M, 10.0 * rover.wheelbase_m))
    with Simulation(world, rover, np.random.default_rng(0)) as simulation:
        vehicle = _LoadVehicle(simulation, (1.0 - slip) * setup.speed_m_s, setup.gravity_m_s2)
        vehicle.tow(speeds, max(_RUN_IN / (1.0 - slip), _SHORTEST_RUN_IN) * wheelbase_s)
        begin = simulation.state
        tow = vehicle.tow(speeds, _MEASURED_WAY * wheelbase_s)
        end = simulation.state
    weight = rover.mass_kg * setup.gravity_m_s2
    count = len(rover.wheel.positions_m)
    way = float(end.pose.position_w[0] - begin.pose.position_w[0])
    wheel_way = setup.speed_m_s * (end.time_s - begin.time_s)
    pull = rover.mass_kg * tow
    return DrawbarPoint(
        soil=setup.soil,
        gravity_m_s2=setup.gravity_m_s2,
        rover=setup.rover,
        slip=round(1.0 - way / wheel_way, 5),
        pull_N=round(pull, 3),
        pull_per_weight=round(pull / weight, 5),
        power_W=round((end.energy_J - begin.energy_J) / (end.time_s - begin.time_s), 3),
        sinkage_m=round(float(end.sinkage_m.mean()), 6),
        steady_wheel_per_weight=round(count * steady_wheel(soil, shape, weight / count, slip).drawbar_N / weight, 5),
    )
