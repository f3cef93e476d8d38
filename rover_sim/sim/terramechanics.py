"""Wheels on soft ground: the typed side of the compiled wheel-soil step."""

from __future__ import annotations

from math import hypot, sqrt, tan

import numpy as np

from rover_sim.sim import soil_kernels as kernel
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.wong_reece import wheel_table
from worlds.soil import Soil
from worlds.types import FloatArray, HeightField

_VERTICAL_DAMPING_RATIO = 0.5
_SETTLING_RATE_1_s = 20.0  # how fast soil gives way under a growing load
_LARGEST_LOAD = 2.0  # of the table, in weights of the whole rover
_SMALLEST_LOAD_GRAVITY = 1.0  # m/s2; tables reach that low even in free fall


class WheelSoil:
    """Soil under the wheels of one rover; holds what the soil remembers (shear, plastic sinkage)."""

    def __init__(self, ground: HeightField, soil: Soil, rover: RoverModel, gravity_m_s2: float) -> None:
        self.count = len(rover.wheel.positions_m)
        self.ground = np.ascontiguousarray(ground.heights_m, dtype=np.float64)
        self.grid = (float(ground.origin_m[0]), float(ground.origin_m[1]), 1.0 / ground.resolution_m)
        weight = rover.mass_kg * max(gravity_m_s2, _SMALLEST_LOAD_GRAVITY)
        shape = rover.wheel_shape()
        table = wheel_table(soil, shape, _LARGEST_LOAD * weight)
        self.table = _per_load(table.values, table.load_step)
        self.constants = _constants(soil, rover, table.load_step)
        self.state = np.zeros((self.count, kernel.STATE_COLUMNS))
        self.result = np.zeros((self.count, kernel.RESULT_COLUMNS))

    def settle(self, loads_N: FloatArray, pull: tuple[float, float]) -> FloatArray:
        """Put wheels of ``loads_N`` (n,) at rest; depth of each rim below the ground (n,), elastic part included.

        ``pull``: the share of its load with which each wheel holds the rover, forward and to the left.
        """
        depth = np.zeros(self.count)
        for i, load in enumerate(loads_N):
            _, _, sinkage, contact = kernel.steady(self.table, self.constants[kernel.LOAD_STEP], load, 0.0)
            share = self._holding_slip(load, hypot(*pull)) * contact / max(hypot(*pull), 1e-9)
            self.state[i] = (share * pull[0], share * pull[1], sinkage, contact, 0.0)
            depth[i] = sinkage + load / self.constants[kernel.STIFFNESS]
        return depth

    def _holding_slip(self, load_N: float, pull: float) -> float:
        """Shear displacement in contact lengths that holds ``pull`` times the load; 1 if the soil cannot."""
        slips = np.linspace(0.0, 1.0, 401)
        thrust = [kernel.steady(self.table, self.constants[kernel.LOAD_STEP], load_N, slip)[0] for slip in slips]
        return float(np.interp(pull, np.maximum.accumulate(thrust) - thrust[0], slips))

    def step(self, motion: FloatArray, dt: float) -> FloatArray:
        """Advance by ``dt``; ``motion`` (n, 13) and the returned array (n, 13) as in `soil_kernels.wheel_forces`."""
        kernel.wheel_forces(self.ground, self.grid, self.table, self.constants, motion, self.state, self.result, dt)
        return self.result


def _per_load(values: FloatArray, load_step: float) -> FloatArray:
    """The table with thrust and resistance per load, which is smoother; its empty first row continues the second."""
    table = values.copy()
    loads = (np.arange(len(table)) * load_step) ** 2
    table[1:, :, :2] /= loads[1:, None, None]
    table[0, :, :2] = table[1, :, :2]
    return table


def _constants(soil: Soil, rover: RoverModel, load_step: float) -> FloatArray:
    wheel = rover.wheel
    share = rover.mass_kg / len(wheel.positions_m)
    shear_radius = rover.wheel_shape().shear_radius_m
    spin_mass = (0.5 * wheel.mass_kg * wheel.radius_m**2 + rover.motor.rotor_inertia_kg_m2) / shear_radius**2
    constants = np.zeros(kernel.CONSTANTS)
    constants[kernel.RADIUS] = wheel.radius_m
    constants[kernel.WIDTH] = wheel.width_m
    constants[kernel.SHEAR_RADIUS] = shear_radius
    constants[kernel.STIFFNESS] = wheel.stiffness_N_m
    constants[kernel.DAMPING] = 2.0 * _VERTICAL_DAMPING_RATIO * sqrt(wheel.stiffness_N_m * share)
    constants[kernel.SHEAR_DAMPING] = 2.0 * soil.damping_ratio * sqrt(share)
    constants[kernel.SPIN_MASS] = spin_mass
    constants[kernel.COHESION] = soil.cohesion_Pa
    constants[kernel.TAN_PHI] = tan(soil.friction_angle_rad)
    constants[kernel.LOAD_STEP] = load_step
    constants[kernel.SETTLING] = _SETTLING_RATE_1_s
    return constants
