"""The truth about a pose: a rigid rover settled on fine ground by geometry alone, for tests and benchmarks.

Of all leans near a first guess the one of least height of the centre of mass is sought, with the wheels as solid
cylinders that may not enter the ground. Heights are those of the bilinear surface; rims are sampled.
"""

from __future__ import annotations

from math import atan2, cos, floor, pi, sin, sqrt

import numba as nb
import numpy as np

from worlds.types import FloatArray, HeightField, RigidBody

RIM, ACROSS = 25, 5  # samples of a rim's lower half, and across a wheel
HULL_STEP_M = 0.01
START_STEP, LEAST_STEP = 0.03, 1e-5  # rad, of the search for the least height


def settle(ground: HeightField, poses: FloatArray, body: RigidBody, starts: FloatArray) -> FloatArray:
    """Roll, pitch, height of the centre of mass, clearance, least tip angle, hanging (N, S, 6) of ``poses`` (N, 3).

    Hanging is how high the lower of two wheels across a diagonal hangs: the body is held in its place, so two wheels of
    one side that press against a rock may seem to carry it, which is no rest. ``starts`` (S, 2): what is added to the
    lean of the ground under the wheels as a first guess.
    """
    grid = np.array([*ground.origin_m, ground.resolution_m])
    out = np.empty((len(poses), len(starts), 6))
    hull = np.concatenate([_underside(box) for box in body.undersides_m])
    sizes = np.array(
        [body.wheelbase_m / 2, body.track_m / 2, body.wheel_radius_m, body.wheel_width_m / 2, *body.centre_of_mass_m]
    )
    _settle_all(ground.heights_m, grid, poses, sizes, _rim(body), hull, starts, out)
    return out


def _underside(box: tuple[float, float, float, float, float]) -> FloatArray:
    rear, front, right, left, under = box
    along = np.linspace(rear, front, round((front - rear) / HULL_STEP_M) + 1)
    across = np.linspace(right, left, round((left - right) / HULL_STEP_M) + 1)
    x, y = np.meshgrid(along, across)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, under)])


def _rim(body: RigidBody) -> FloatArray:
    """Samples (M, 3) of a wheel: ahead, down and left of its hub."""
    angle = np.linspace(-pi / 2, pi / 2, RIM)
    left = np.linspace(-body.wheel_width_m / 2, body.wheel_width_m / 2, ACROSS)
    u, v = np.meshgrid(body.wheel_radius_m * np.sin(angle), left, indexing="ij")
    return np.column_stack([u.ravel(), np.sqrt(np.maximum(body.wheel_radius_m**2 - u.ravel() ** 2, 0.0)), v.ravel()])


@nb.njit(cache=True)
def _settle_all(
    heights: FloatArray, grid: FloatArray, poses: FloatArray, sizes: FloatArray, rim: FloatArray, hull: FloatArray,
    starts: FloatArray, out: FloatArray,
) -> None:  # fmt: skip
    by_wheel = np.empty(4)
    for n in range(poses.shape[0]):
        lean = _first_guess(heights, grid, poses[n], sizes)
        for k in range(starts.shape[0]):
            roll, pitch = lean[0] + starts[k, 0], lean[1] + starts[k, 1]
            roll, pitch, best = _descend(heights, grid, poses[n], sizes, rim, roll, pitch)
            body_z = best - _above(sizes[4], sizes[5], sizes[6], roll, pitch)
            out[n, k, 0], out[n, k, 1], out[n, k, 2] = roll, pitch, best
            out[n, k, 3] = _gap(heights, grid, poses[n], hull, roll, pitch, body_z)
            out[n, k, 4] = _tip_angle(sizes, roll, pitch)
            _mass_height(heights, grid, poses[n], sizes, rim, roll, pitch, by_wheel)
            by_wheel -= best
            out[n, k, 5] = -max(min(by_wheel[0], by_wheel[3]), min(by_wheel[1], by_wheel[2]))


@nb.njit(cache=True)
def _ground(heights: FloatArray, grid: FloatArray, x: float, y: float) -> float:
    u, v = (x - grid[0]) / grid[2], (y - grid[1]) / grid[2]
    ix, iy = min(max(floor(u), 0), heights.shape[1] - 2), min(max(floor(v), 0), heights.shape[0] - 2)
    u, v = u - ix, v - iy
    low = (1.0 - u) * heights[iy, ix] + u * heights[iy, ix + 1]
    return float((1.0 - v) * low + v * ((1.0 - u) * heights[iy + 1, ix] + u * heights[iy + 1, ix + 1]))


@nb.njit(cache=True)
def _above(x: float, y: float, z: float, roll: float, pitch: float) -> float:
    return -sin(pitch) * x + cos(pitch) * (sin(roll) * y + cos(roll) * z)


@nb.njit(cache=True)
def _place(pose: FloatArray, x: float, y: float, z: float, roll: float, pitch: float) -> tuple[float, float]:
    """World x and y of a body point."""
    ahead = cos(pitch) * x + sin(pitch) * (sin(roll) * y + cos(roll) * z)
    left = cos(roll) * y - sin(roll) * z
    c, s = cos(pose[2]), sin(pose[2])
    return pose[0] + ahead * c - left * s, pose[1] + ahead * s + left * c


@nb.njit(cache=True)
def _first_guess(heights: FloatArray, grid: FloatArray, pose: FloatArray, sizes: FloatArray) -> tuple[float, float]:
    h = np.empty(4)
    for i in range(4):
        x, y = (sizes[0] if i % 2 == 0 else -sizes[0]), (sizes[1] if i < 2 else -sizes[1])
        gx, gy = _place(pose, x, y, 0.0, 0.0, 0.0)
        h[i] = _ground(heights, grid, gx, gy)
    return atan2(h[0] + h[1] - h[2] - h[3], 4 * sizes[1]), atan2(h[1] + h[3] - h[0] - h[2], 4 * sizes[0])


@nb.njit(cache=True)
def _mass_height(
    heights: FloatArray, grid: FloatArray, pose: FloatArray, sizes: FloatArray, rim: FloatArray, roll: float,
    pitch: float, by_wheel: FloatArray,
) -> float:  # fmt: skip
    """Height of the centre of mass with this lean, lowered until a wheel stands; and until each (4,) would."""
    # Axis of the wheels, and the direction from the hub down to the rim's lowest point (heading frame).
    ax, ay, az = sin(pitch) * sin(roll), cos(roll), cos(pitch) * sin(roll)
    level = sqrt(1.0 - az * az)
    dx, dy = ax * az / level, ay * az / level
    ex, ey = ay / level, -ax / level
    c, s = cos(pose[2]), sin(pose[2])
    mass = _above(sizes[4], sizes[5], sizes[6], roll, pitch)
    for i in range(4):
        x, y = (sizes[0] if i % 2 == 0 else -sizes[0]), (sizes[1] if i < 2 else -sizes[1])
        hx, hy = _place(pose, x, y, 0.0, roll, pitch)
        needed = -1e9
        for m in range(rim.shape[0]):
            u, p, v = rim[m]
            qx, qy = v * ax + u * ex + p * dx, v * ay + u * ey + p * dy
            ground = _ground(heights, grid, hx + qx * c - qy * s, hy + qx * s + qy * c)
            needed = max(needed, ground + p * level - v * az)
        by_wheel[i] = needed - _above(x, y, 0.0, roll, pitch) + mass
    return float(by_wheel.max())


@nb.njit(cache=True)
def _descend(
    heights: FloatArray, grid: FloatArray, pose: FloatArray, sizes: FloatArray, rim: FloatArray, roll: float,
    pitch: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Least height nearby: steps to the least of the highest of four planes, one a wheel, that secants give.

    Where none of these helps, steps are tried in directions that turn by the golden angle: a wheel has creases of its
    own.
    """
    here, ahead, left, probe = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    best = _mass_height(heights, grid, pose, sizes, rim, roll, pitch, here)
    reach, angle = START_STEP, 0.0
    while reach > LEAST_STEP:
        _mass_height(heights, grid, pose, sizes, rim, roll + 0.3 * reach, pitch, ahead)
        _mass_height(heights, grid, pose, sizes, rim, roll, pitch + 0.3 * reach, left)
        r, p = _least_of_planes(here, (ahead - here) / (0.3 * reach), (left - here) / (0.3 * reach), reach)
        value = _mass_height(heights, grid, pose, sizes, rim, roll + r, pitch + p, probe)
        for _ in range(8):
            if value < best - 1e-9:
                break
            angle += 2.399963
            r, p = reach * cos(angle), reach * sin(angle)
            value = _mass_height(heights, grid, pose, sizes, rim, roll + r, pitch + p, probe)
        if value < best - 1e-9:
            best, roll, pitch, reach = value, roll + r, pitch + p, min(1.5 * reach, START_STEP)
            here[:] = probe
        else:
            reach *= 0.5
    return roll, pitch, best


@nb.njit(cache=True)
def _least_of_planes(level: FloatArray, along: FloatArray, across: FloatArray, reach: float) -> tuple[float, float]:
    """Where within ``reach`` the highest of four planes is least: at a corner, or where three planes or edges meet."""
    best, x, y = 1e9, 0.0, 0.0
    # Lines on which two planes are as high, and the edges of the square: a u + b v = d.
    lines = np.empty((10, 3))
    count = 0
    for i in range(4):
        for j in range(i):
            lines[count] = along[i] - along[j], across[i] - across[j], level[j] - level[i]
            count += 1
    lines[6], lines[7] = (1.0, 0.0, reach), (1.0, 0.0, -reach)
    lines[8], lines[9] = (0.0, 1.0, reach), (0.0, 1.0, -reach)
    for i in range(10):
        for j in range(i):
            det = lines[i, 0] * lines[j, 1] - lines[j, 0] * lines[i, 1]
            if abs(det) < 1e-12:
                continue
            u = (lines[i, 2] * lines[j, 1] - lines[j, 2] * lines[i, 1]) / det
            v = (lines[i, 0] * lines[j, 2] - lines[j, 0] * lines[i, 2]) / det
            if max(abs(u), abs(v)) <= reach * (1.0 + 1e-9):
                value = (level + along * u + across * v).max()
                if value < best:
                    best, x, y = value, u, v
    return x, y


@nb.njit(cache=True)
def _gap(
    heights: FloatArray, grid: FloatArray, pose: FloatArray, hull: FloatArray, roll: float, pitch: float, body_z: float
) -> float:
    least = 1e9
    for m in range(hull.shape[0]):
        x, y = _place(pose, hull[m, 0], hull[m, 1], hull[m, 2], roll, pitch)
        gap = body_z + _above(hull[m, 0], hull[m, 1], hull[m, 2], roll, pitch) - _ground(heights, grid, x, y)
        least = min(least, gap)
    return least


@nb.njit(cache=True)
def _tip_angle(sizes: FloatArray, roll: float, pitch: float) -> float:
    """Least angle until the weight acts over a side of the wheels' lowest points, by the direction of gravity."""
    gx, gy, gz = sin(pitch), -cos(pitch) * sin(roll), cos(pitch) * cos(roll)
    height = sizes[2] + sizes[6]
    least = 1e9
    for arm, push in (
        (sizes[0] - sizes[4], gx),
        (sizes[0] + sizes[4], -gx),
        (sizes[1] - sizes[5], gy),
        (sizes[1] + sizes[5], -gy),
    ):
        least = min(least, atan2(arm, height) - atan2(push, gz))
    return least


def tilt(roll: FloatArray, pitch: FloatArray) -> FloatArray:
    """Angle between the body's up axis and the vertical."""
    return np.asarray(np.arccos(np.cos(roll) * np.cos(pitch)))
