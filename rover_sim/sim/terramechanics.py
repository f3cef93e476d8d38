"""Wheels on soft ground: the typed side of the compiled wheel-soil step."""

from __future__ import annotations

from math import hypot, pi, sqrt, tan

import numpy as np

from rover_sim.sim import soil_kernels as kernel
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.rut_kernels import Ruts
from rover_sim.sim.ruts import RutField, no_ruts
from worlds.soil import Soil
from worlds.types import ByteArray, FloatArray, HeightField, SoilMap
from worlds.wong_reece import WheelTable, wheel_table

_VERTICAL_DAMPING_RATIO = 0.5
_SETTLING_RATE_1_s = 20.0  # how fast soil gives way under a growing load
_LARGEST_LOAD = 2.0  # of the table, in weights of the whole rover
_SMALLEST_LOAD_GRAVITY = 1.0  # m/s2; tables reach that low even in free fall
_EARTH_GRAVITY = 9.80665  # m/s2, at which soils are weighed


class WheelSoil:
    """Soil under the wheels of one rover; holds what the soil remembers (shear, plastic sinkage, ruts).

    ``soil_map`` says where another soil than ``soil`` lies; without ``ruts`` the ground does not deform.
    """

    def __init__(
        self,
        ground: HeightField,
        soil: Soil,
        rover: RoverModel,
        gravity_m_s2: float,
        *,
        soil_map: SoilMap | None = None,
        ruts: RutField | None = None,
    ) -> None:
        self.count = len(rover.wheel.positions_m)
        self.ground = np.ascontiguousarray(ground.heights_m, dtype=np.float64)
        self.grid = (float(ground.origin_m[0]), float(ground.origin_m[1]), 1.0 / ground.resolution_m)
        weight = rover.mass_kg * max(gravity_m_s2, _SMALLEST_LOAD_GRAVITY)
        soils = (soil,) if soil_map is None else soil_map.soils
        tables = [wheel_table(each, rover.wheel_shape(), _LARGEST_LOAD * weight) for each in soils]
        self.soils: ByteArray = np.zeros((1, 1), np.uint8) if soil_map is None else np.ascontiguousarray(soil_map.index)
        self.tables = np.stack([_per_load(table) for table in tables])
        self.constants = np.stack(
            [_constants(each, rover, table, gravity_m_s2) for each, table in zip(soils, tables, strict=True)]
        )
        self.ruts = ruts
        self._no_ruts = no_ruts()
        self.state = np.zeros((self.count, kernel.STATE_COLUMNS))
        self.state[:, kernel.PRESSED_X] = np.inf  # nowhere yet
        self.result = np.zeros((self.count, kernel.RESULT_COLUMNS))

    @property
    def rut_view(self) -> Ruts:
        """The ruts as the compiled step takes them, with room for one more step."""
        if self.ruts is None:
            return self._no_ruts
        self.ruts.reserve()
        return self.ruts.view

    @property
    def work_J(self) -> tuple[float, float, float]:
        """Work that all wheels have done on the soil: by shear, against its drag, and along its normal."""
        shear, drag, normal = self.state[:, kernel.WORK_SHEAR : kernel.WORK_NORMAL + 1].sum(axis=0)
        return float(shear), float(drag), float(normal)

    def forget_work(self) -> None:
        """Count the work from here."""
        self.state[:, kernel.WORK_SHEAR : kernel.WORK_NORMAL + 1] = 0.0

    def settle(self, loads_N: FloatArray, pull: tuple[float, float], places_w: FloatArray | None = None) -> FloatArray:
        """Put wheels of ``loads_N`` (n,) at rest; depth of each rim below the ground (n,), elastic part included.

        ``pull``: the share of its load with which each wheel holds the rover, forward and to the left; ``places_w``
        (n, 2): where the wheels stand, which matters where several soils lie.
        """
        depth = np.zeros(self.count)
        for i, load in enumerate(loads_N):
            soil = 0 if places_w is None else int(kernel.soil_at(self.soils, self.grid, *places_w[i]))
            table, constants = self.tables[soil], self.constants[soil]
            _, _, sinkage, contact = kernel.steady(table, constants, 0.0, load, 0.0)
            share = _holding_slip(table, constants, load, hypot(*pull)) * contact / max(hypot(*pull), 1e-9)
            self.state[i, : kernel.PRIOR + 1] = (share * pull[0], share * pull[1], sinkage, contact, 0.0, 0.0)
            depth[i] = sinkage + load / constants[kernel.STIFFNESS]
        return depth

    def step(self, motion: FloatArray, dt: float) -> FloatArray:
        """Advance by ``dt``; ``motion`` (n, 13) and the returned array (n, 13) as in `soil_kernels.wheel_forces`."""
        kernel.wheel_forces(
            self.ground,
            self.grid,
            self.soils,
            self.rut_view,
            self.tables,
            self.constants,
            motion,
            self.state,
            self.result,
            dt,
        )
        return self.result


def _holding_slip(table: FloatArray, constants: FloatArray, load_N: float, pull: float) -> float:
    """Shear displacement in contact lengths that holds ``pull`` times the load; 1 if the soil cannot."""
    slips = np.linspace(0.0, 1.0, 401)
    thrust = [kernel.steady(table, constants, 0.0, load_N, slip)[0] for slip in slips]
    return float(np.interp(pull, np.maximum.accumulate(thrust) - thrust[0], slips))


def _per_load(table: WheelTable) -> FloatArray:
    """The table with thrust and resistance per load, which is smoother; its empty first row continues the second."""
    values = table.values.copy()
    loads = (np.arange(values.shape[1]) * table.load_step) ** 2
    values[:, 1:, :, :2] /= loads[1:, None, None]
    values[:, 0, :, :2] = values[:, 1, :, :2]
    return values


def _constants(soil: Soil, rover: RoverModel, table: WheelTable, gravity_m_s2: float) -> FloatArray:
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
    constants[kernel.LOAD_STEP] = table.load_step
    constants[kernel.SETTLING] = _SETTLING_RATE_1_s
    constants[kernel.SHEAR_MODULUS] = soil.shear_modulus_m
    constants[kernel.DEEPEST_RUT] = table.deepest_rut_m
    passive = tan(0.25 * pi + 0.5 * soil.friction_angle_rad) ** 2  # Rankine's K_p
    constants[kernel.PASSIVE_COHESION] = 2.0 * soil.cohesion_Pa * sqrt(passive)
    constants[kernel.PASSIVE_WEIGHT] = 0.5 * soil.unit_weight_N_m3 * gravity_m_s2 / _EARTH_GRAVITY * passive
    return constants
