"""Compiled ray casting of a laser scanner: triangles of obstacles, and the ground.

Heights come from a kernel of the wheels; numba does not watch that file, so save this one too after a change there.
"""

from __future__ import annotations

from math import asin, atan2, hypot

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.soil_kernels import ground_height
from worlds.types import FloatArray, IntArray

Places = NDArray[np.int64]
_MARCH_M = 0.25  # between two looks at the ground


@njit(cache=True)
def meet_obstacles(
    ranges: FloatArray,
    directions: FloatArray,
    origin: FloatArray,
    rotation: FloatArray,
    mesh: tuple[FloatArray, IntArray, Places, FloatArray, FloatArray],
    first_rad: float,
    step_rad: float,
) -> None:
    """Shorten ``ranges`` (N,) to where the beams meet obstacles.

    ``directions`` (N, 3) are unit vectors in the world, ``rotation`` (3, 3) turns scanner into world. ``mesh`` holds
    vertices, faces, the first face of each obstacle, and the boxes around the obstacles.
    """
    vertices, faces, face_starts, low, high = mesh
    beams = ranges.shape[0]
    nx, ny, nz = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    slope = hypot(nx, ny) / nz
    reach = ranges.max()
    for i in range(low.shape[0]):
        dx, dy = (low[i, 0] + high[i, 0]) / 2 - origin[0], (low[i, 1] + high[i, 1]) / 2 - origin[1]
        radius = hypot(high[i, 0] - low[i, 0], high[i, 1] - low[i, 1]) / 2
        distance = hypot(dx, dy)
        if distance - radius > reach:
            continue
        plane = origin[2] - (nx * dx + ny * dy) / nz
        if plane + slope * radius < low[i, 2] or plane - slope * radius > high[i, 2]:
            continue
        first, last = 0, beams - 1
        if distance > 1.05 * radius:
            dz = plane - origin[2]
            ahead = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
            left = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
            half = asin(min(1.05 * radius / distance, 1.0)) + step_rad
            middle = (atan2(left, ahead) - first_rad) / step_rad
            first, last = max(int(middle - half / step_rad), 0), min(int(middle + half / step_rad) + 1, beams - 1)
        for b in range(first, last + 1):
            if ranges[b] < distance - radius:
                continue
            for f in range(face_starts[i], face_starts[i + 1]):
                met = _triangle(vertices, faces, f, origin, directions, b)
                ranges[b] = min(ranges[b], met)


@njit(cache=True)
def _triangle(
    vertices: FloatArray, faces: IntArray, f: int, origin: FloatArray, directions: FloatArray, b: int
) -> float:
    """Distance along beam ``b`` to a face; 1e300 where it misses.

    After Moeller and Trumbore, J. Graphics Tools 2(1), 1997.
    """
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    ax, ay, az = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    ux, uy, uz = vertices[j, 0] - ax, vertices[j, 1] - ay, vertices[j, 2] - az
    vx, vy, vz = vertices[k, 0] - ax, vertices[k, 1] - ay, vertices[k, 2] - az
    dx, dy, dz = directions[b, 0], directions[b, 1], directions[b, 2]
    px, py, pz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
    det = ux * px + uy * py + uz * pz
    if abs(det) < 1e-14:
        return 1e300
    sx, sy, sz = origin[0] - ax, origin[1] - ay, origin[2] - az
    u = (sx * px + sy * py + sz * pz) / det
    if u < 0.0 or u > 1.0:
        return 1e300
    qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    v = (dx * qx + dy * qy + dz * qz) / det
    if v < 0.0 or u + v > 1.0:
        return 1e300
    t = (vx * qx + vy * qy + vz * qz) / det
    return t if t > 0.0 else 1e300


@njit(cache=True)
def meet_ground(
    ranges: FloatArray,
    directions: FloatArray,
    origin: FloatArray,
    heights: FloatArray,
    grid: tuple[float, float, float],
) -> None:
    """Shorten ``ranges`` (N,) to where the beams go into the ground: a height grid, its corner and cells a metre."""
    x0, y0, inverse = grid
    for b in range(ranges.shape[0]):
        dx, dy, dz = directions[b, 0], directions[b, 1], directions[b, 2]
        before, gap = 0.0, origin[2] - ground_height(heights, x0, y0, inverse, origin[0], origin[1])
        while before < ranges[b]:
            after = min(before + _MARCH_M, ranges[b])
            x, y = origin[0] + after * dx, origin[1] + after * dy
            below = origin[2] + after * dz - ground_height(heights, x0, y0, inverse, x, y)
            if below <= 0.0:
                ranges[b] = before + (after - before) * gap / max(gap - below, 1e-12)
                break
            before, gap = after, below
