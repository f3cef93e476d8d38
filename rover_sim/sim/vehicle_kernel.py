"""One compiled call a step: rover pose to wheel motion, soil forces and belly forces."""

from __future__ import annotations

from numba import njit

from rover_sim.sim.belly_kernel import belly_wrench
from rover_sim.sim.wheel_kernel import wheel_forces
from worlds.types import FloatArray

BODY_COLUMNS = 18
MOTION_COLUMNS = 13


@njit(cache=True)
def body_motion(raw: FloatArray, body: FloatArray) -> None:
    """Position, velocity, rate and rotation matrix (18,) from ``raw`` (13,): position, quaternion, velocity, rate."""
    x, y, z, w = raw[3], raw[4], raw[5], raw[6]
    body[0:3] = raw[0:3]
    body[3:9] = raw[7:13]
    body[9], body[10], body[11] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    body[12], body[13], body[14] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    body[15], body[16], body[17] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)


@njit(cache=True)
def wheel_motion(body: FloatArray, hubs: FloatArray, joint_rate: FloatArray, motion: FloatArray) -> None:
    """Motion (n, 13) of wheels on axles along body y; ``hubs`` (n, 3) relative to the centre of mass."""
    wx, wy, wz = body[6], body[7], body[8]
    ax, ay, az = body[10], body[13], body[16]
    own = wx * ax + wy * ay + wz * az
    for i in range(hubs.shape[0]):
        px, py, pz = hubs[i]
        rx = body[9] * px + body[10] * py + body[11] * pz
        ry = body[12] * px + body[13] * py + body[14] * pz
        rz = body[15] * px + body[16] * py + body[17] * pz
        m = motion[i]
        m[0], m[1], m[2] = body[0] + rx, body[1] + ry, body[2] + rz
        m[3] = body[3] + wy * rz - wz * ry
        m[4] = body[4] + wz * rx - wx * rz
        m[5] = body[5] + wx * ry - wy * rx
        m[6], m[7], m[8] = ax, ay, az
        m[9], m[10], m[11] = wx, wy, wz
        m[12] = joint_rate[i] + own


@njit(cache=True)
def ground_forces(
    ground: FloatArray,
    grid: tuple[float, float, float],
    table: FloatArray,
    wheel_constants: FloatArray,
    belly_points: FloatArray,
    belly_constants: FloatArray,
    hubs: FloatArray,
    raw: FloatArray,
    body: FloatArray,
    motion: FloatArray,
    state: FloatArray,
    result: FloatArray,
    wrench: FloatArray,
    dt: float,
) -> int:
    """All that the ground does to the rover in a step; points of the belly that touch.

    ``raw`` (13 + n,): position, quaternion, velocity and rate of the chassis' centre of mass, then joint rates.
    Writes ``body``, ``motion``, ``state``, ``result`` (see `wheel_kernel`) and ``wrench`` (see `belly_kernel`).
    """
    body_motion(raw, body)
    wheel_motion(body, hubs, raw[13:], motion)
    wheel_forces(ground, grid, table, wheel_constants, motion, state, result, dt)
    return belly_wrench(ground, grid, belly_points, body, belly_constants, wrench)
