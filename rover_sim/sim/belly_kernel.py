"""The compiled check of the hull against the ground: points under the belly, spring, damper and friction."""

from __future__ import annotations

from math import sqrt

from numba import njit

from rover_sim.sim.ground_kernel import ground_height
from worlds.types import FloatArray

_SLIDING_SPEED = 0.02  # m/s over which friction builds up


@njit(cache=True)
def belly_wrench(
    ground: FloatArray,
    grid: tuple[float, float, float],
    points: FloatArray,
    body: FloatArray,
    constants: FloatArray,
    wrench: FloatArray,
) -> int:
    """Write force (N) and moment about the centre of mass (N m), world axes, into ``wrench`` (6,); points in contact.

    ``points`` (n, 3) relative to the centre of mass in body axes; ``body`` (18,): its position, velocity, rate (world)
    and the rotation body to world, row by row; ``constants``: stiffness N/m, damping N s/m, friction coefficient.
    """
    x0, y0, inverse = grid
    stiffness, damping, friction = constants
    wrench[:] = 0.0
    touching = 0
    for i in range(points.shape[0]):
        px, py, pz = points[i]
        rx = body[9] * px + body[10] * py + body[11] * pz
        ry = body[12] * px + body[13] * py + body[14] * pz
        rz = body[15] * px + body[16] * py + body[17] * pz
        depth = ground_height(ground, x0, y0, inverse, body[0] + rx, body[1] + ry) - (body[2] + rz)
        if depth <= 0.0:
            continue
        touching += 1
        vx = body[3] + body[7] * rz - body[8] * ry
        vy = body[4] + body[8] * rx - body[6] * rz
        vz = body[5] + body[6] * ry - body[7] * rx
        up = max(stiffness * depth - damping * min(depth / 0.005, 1.0) * vz, 0.0)
        drag = friction * up / max(sqrt(vx * vx + vy * vy), _SLIDING_SPEED)
        fx, fy = -drag * vx, -drag * vy
        wrench[0] += fx
        wrench[1] += fy
        wrench[2] += up
        wrench[3] += ry * up - rz * fy
        wrench[4] += rz * fx - rx * up
        wrench[5] += rx * fy - ry * fx
    return touching
