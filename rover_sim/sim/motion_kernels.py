"""Compiled motion of a rover's body, arms and wheels, from what PyBullet says of them.

Called from `soil_kernels`, whose stored machine code has to be renewed (save that file anew) after a change here.
"""

from __future__ import annotations

from math import cos, sin

from numba import njit

from worlds.types import FloatArray

# Columns of the motion of body and wheels.
BODY_COLUMNS = 18
MOTION_COLUMNS = 13
# Columns of a passive arm: what it sits on, its pivot with every arm level, then its motion in body axes.
ARM_PARENT, ARM_PIVOT, ARM_SIN, ARM_COS, ARM_X, ARM_Z, ARM_VX, ARM_VZ, ARM_RATE = 0, 1, 4, 5, 6, 7, 8, 9, 10
ARM_COLUMNS = 11


@njit(cache=True)
def body_motion(raw: FloatArray, body: FloatArray) -> None:
    """Position, velocity, rate and rotation matrix (18,) from ``raw`` (13,): position, quaternion, velocity, rate."""
    x, y, z, w = raw[3], raw[4], raw[5], raw[6]
    for k in range(3):  # a slice assignment would take numba two seconds to compile
        body[k], body[3 + k], body[6 + k] = raw[k], raw[7 + k], raw[10 + k]
    body[9], body[10], body[11] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    body[12], body[13], body[14] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    body[15], body[16], body[17] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)


@njit(cache=True)
def arm_motion(raw: FloatArray, wheels: int, arms: FloatArray) -> None:
    """Where passive arms (m, ARM_COLUMNS) on joints about body y are, and how they move against the chassis.

    ``raw`` holds their angles and then their rates behind the joint rates of the ``wheels``. Arms come after the
    arm that they sit on; angles turn x towards -z.
    """
    count = arms.shape[0]
    for k in range(count):
        own, parent = arms[k], int(arms[k, ARM_PARENT])
        angle, rate = raw[13 + wheels + k], raw[13 + wheels + count + k]
        s, c = sin(angle), cos(angle)
        x, z, vx, vz = own[ARM_PIVOT], own[ARM_PIVOT + 2], 0.0, 0.0
        if parent >= 0:
            up = arms[parent]
            dx, dz = x - up[ARM_PIVOT], z - up[ARM_PIVOT + 2]
            rx, rz = up[ARM_COS] * dx + up[ARM_SIN] * dz, up[ARM_COS] * dz - up[ARM_SIN] * dx
            x, z = up[ARM_X] + rx, up[ARM_Z] + rz
            vx, vz = up[ARM_VX] + up[ARM_RATE] * rz, up[ARM_VZ] - up[ARM_RATE] * rx
            s, c = s * up[ARM_COS] + c * up[ARM_SIN], c * up[ARM_COS] - s * up[ARM_SIN]
            rate += up[ARM_RATE]
        own[ARM_SIN], own[ARM_COS], own[ARM_X], own[ARM_Z] = s, c, x, z
        own[ARM_VX], own[ARM_VZ], own[ARM_RATE] = vx, vz, rate


@njit(cache=True)
def wheel_motion(body: FloatArray, hubs: FloatArray, arms: FloatArray, raw: FloatArray, motion: FloatArray) -> None:
    """Motion (n, 13) of wheels on axles along body y; ``hubs`` (n, 4) relative to the centre of mass, and their arm."""
    wx, wy, wz = body[6], body[7], body[8]
    ax, ay, az = body[10], body[13], body[16]
    turning = wx * ax + wy * ay + wz * az
    for i in range(hubs.shape[0]):
        px, py, pz = hubs[i, 0], hubs[i, 1], hubs[i, 2]
        ux, uz, swing = 0.0, 0.0, 0.0  # velocity and rate against the chassis
        if hubs[i, 3] >= 0.0:
            arm = arms[int(hubs[i, 3])]
            dx, dz = px - arm[ARM_PIVOT], pz - arm[ARM_PIVOT + 2]
            lx, lz = arm[ARM_COS] * dx + arm[ARM_SIN] * dz, arm[ARM_COS] * dz - arm[ARM_SIN] * dx
            px, pz, swing = arm[ARM_X] + lx, arm[ARM_Z] + lz, arm[ARM_RATE]
            ux, uz = arm[ARM_VX] + swing * lz, arm[ARM_VZ] - swing * lx
        rx = body[9] * px + body[10] * py + body[11] * pz
        ry = body[12] * px + body[13] * py + body[14] * pz
        rz = body[15] * px + body[16] * py + body[17] * pz
        m = motion[i]
        m[0], m[1], m[2] = body[0] + rx, body[1] + ry, body[2] + rz
        m[3] = body[3] + wy * rz - wz * ry + body[9] * ux + body[11] * uz
        m[4] = body[4] + wz * rx - wx * rz + body[12] * ux + body[14] * uz
        m[5] = body[5] + wx * ry - wy * rx + body[15] * ux + body[17] * uz
        m[6], m[7], m[8] = ax, ay, az
        m[9], m[10], m[11] = wx + swing * ax, wy + swing * ay, wz + swing * az
        m[12] = raw[13 + i] + turning + swing


@njit(cache=True)
def locate(raw: FloatArray, hubs: FloatArray, arms: FloatArray, body: FloatArray, motion: FloatArray) -> None:
    """Where body, arms and wheels are and how they move: writes ``body``, ``arms`` and ``motion``."""
    body_motion(raw, body)
    arm_motion(raw, hubs.shape[0], arms)
    wheel_motion(body, hubs, arms, raw, motion)
