"""Passive arms between chassis and wheels as the arrays that the compiled step reads, and where they put the mass."""

from __future__ import annotations

import numpy as np
from numba import njit

from rover_sim.sim import motion_kernels as kernel
from rover_sim.sim.rover import RoverModel
from worlds.types import FloatArray, Vector3


def hub_table(rover: RoverModel) -> FloatArray:
    """Hubs (n, 4): place relative to the chassis' centre of mass with every arm level, and number of the arm or -1."""
    numbers = rover.suspension.arm_numbers()
    arms = [numbers[name] for name in rover.suspension.wheel_arms] or [-1] * len(rover.wheel.positions_m)
    return np.column_stack([_relative(rover, rover.wheel.positions_m), arms])


def arm_table(rover: RoverModel) -> FloatArray:
    """Arms (m, ARM_COLUMNS) of `motion_kernels.arm_motion`: parent and pivot are filled in, the motion is zero."""
    table = np.zeros((len(rover.suspension.arm), kernel.ARM_COLUMNS))
    numbers = rover.suspension.arm_numbers()
    for row, arm in zip(table, rover.suspension.arm, strict=True):
        row[kernel.ARM_PARENT] = numbers[arm.parent]
        row[kernel.ARM_PIVOT : kernel.ARM_PIVOT + 3] = _relative(rover, (arm.pivot_m,))[0]
    return table


def arm_offsets(rover: RoverModel) -> FloatArray:
    """Centre of mass of each arm (m, 3) from its pivot, with every arm level."""
    arms = rover.suspension.arm
    return np.array([np.subtract(arm.centre_of_mass_m, arm.pivot_m) for arm in arms]).reshape(-1, 3)


def masses(rover: RoverModel) -> FloatArray:
    """Mass (2 + m,) of the chassis, of a wheel and of each arm, kg."""
    return np.array([rover.chassis.mass_kg, rover.wheel.mass_kg, *(arm.mass_kg for arm in rover.suspension.arm)])


@njit(cache=True)
def mass_centre_w(
    masses_kg: FloatArray, offsets: FloatArray, body: FloatArray, motion: FloatArray, arms: FloatArray
) -> FloatArray:
    """Centre of mass (3,) in the world from ``body`` (18,), wheels (n, 13) and arms as `motion_kernels` moved them.

    ``masses_kg`` and ``offsets`` as of `masses` and `arm_offsets`.
    """
    centre, total = np.empty(3), masses_kg[0] + len(motion) * masses_kg[1]
    for axis in range(3):
        centre[axis] = masses_kg[0] * body[axis] + masses_kg[1] * np.sum(motion[:, axis])
    for k in range(len(arms)):
        arm, mass_kg, (x, y, z) = arms[k], masses_kg[2 + k], (offsets[k, 0], offsets[k, 1], offsets[k, 2])
        px = arm[kernel.ARM_X] + arm[kernel.ARM_COS] * x + arm[kernel.ARM_SIN] * z
        py = arm[kernel.ARM_PIVOT + 1] + y
        pz = arm[kernel.ARM_Z] - arm[kernel.ARM_SIN] * x + arm[kernel.ARM_COS] * z
        total += mass_kg
        for axis in range(3):
            turned = body[9 + 3 * axis] * px + body[10 + 3 * axis] * py + body[11 + 3 * axis] * pz
            centre[axis] += mass_kg * (body[axis] + turned)
    return np.asarray(centre / total)


def _relative(rover: RoverModel, places_b: tuple[Vector3, ...]) -> FloatArray:
    return np.asarray(np.subtract(places_b, rover.chassis.centre_of_mass_m))
