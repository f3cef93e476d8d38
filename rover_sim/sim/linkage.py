"""Passive arms between chassis and wheels as the arrays that the compiled step reads, and where they put the mass."""

from __future__ import annotations

import numpy as np

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


def mass_centre_w(
    rover: RoverModel, mass_kg: float, offsets: FloatArray, body: FloatArray, hubs_w: FloatArray, arms: FloatArray
) -> FloatArray:
    """Centre of mass (3,) in the world from ``body`` (18,), hubs (n, 3) and arms as `motion_kernels` moved them.

    ``mass_kg`` of the rover and `arm_offsets` are what the rover says each time anew, and takes long to say.
    """
    total = rover.chassis.mass_kg * body[:3] + rover.wheel.mass_kg * hubs_w.sum(axis=0)
    rotation = body[9:18].reshape(3, 3)
    for arm, row, (x, y, z) in zip(rover.suspension.arm, arms, offsets, strict=True):
        sin, cos = row[kernel.ARM_SIN], row[kernel.ARM_COS]
        place = (
            row[kernel.ARM_X] + cos * x + sin * z,
            row[kernel.ARM_PIVOT + 1] + y,
            row[kernel.ARM_Z] - sin * x + cos * z,
        )
        total = total + arm.mass_kg * (body[:3] + rotation @ place)
    return np.asarray(total / mass_kg)


def _relative(rover: RoverModel, places_b: tuple[Vector3, ...]) -> FloatArray:
    return np.asarray(np.subtract(places_b, rover.chassis.centre_of_mass_m))
