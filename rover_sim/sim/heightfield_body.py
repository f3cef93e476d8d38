"""A height field as a static PyBullet body, for rays and PyBullet's own renderer."""

from __future__ import annotations

import numpy as np

from rover_sim.sim.bullet import pybullet
from worlds.errors import InputError
from worlds.types import HeightField

MOST_SAMPLES = 1448 * 1448  # PyBullet's shared buffer holds 8 MB; beyond it heights turn to garbage, without an error


def add_heightfield(client: int, field: HeightField) -> int:
    """Add ``field`` to a physics client where it lies in the world; body id.

    Raises `InputError` for a field that PyBullet cannot hold.
    """
    rows, columns = field.heights_m.shape
    if rows * columns > MOST_SAMPLES:
        raise InputError(f"terrain: {columns} x {rows} samples: PyBullet holds at most {MOST_SAMPLES} in all")
    # PyBullet's "rows" count the fast axis, x, and its origin is the middle of the box that bounds the heights.
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_HEIGHTFIELD,
        meshScale=[field.resolution_m, field.resolution_m, 1.0],
        heightfieldData=np.ascontiguousarray(field.heights_m).ravel().tolist(),
        numHeightfieldRows=columns,
        numHeightfieldColumns=rows,
        physicsClientId=client,
    )
    middle = [
        0.5 * sum(field.x_limits_m),
        0.5 * sum(field.y_limits_m),
        0.5 * float(field.heights_m.min() + field.heights_m.max()),
    ]
    body = pybullet.createMultiBody(0.0, shape, basePosition=middle, physicsClientId=client)
    return int(body)
