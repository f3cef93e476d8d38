"""What stands around the rover: the room under its belly and the pits that its wheels are in, rocks included.

Heights and ruts come from the kernels of the wheels; numba does not watch those files, so save this one too after a
change there.
"""

from __future__ import annotations

from math import hypot

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.borrowed import borrowed
from rover_sim.sim.obstacle_index import ObstacleIndex
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.rover_ground import belly_points
from rover_sim.sim.rut_kernels import Ruts, lent, rut_depth
from rover_sim.sim.soil_kernels import ground_height
from worlds.types import FloatArray, IntArray

Places = NDArray[np.int64]
# Heights (ny, nx) of the natural ground; x and y of the first, cells a metre; the ruts in it.
Surface = tuple[FloatArray, tuple[float, float, float], Ruts]

_PIT_SAMPLES = 8  # a wheel diameter; 4 cm for a wheel of 0.33 m, half a cell of the usual grid
_WIDEST_PIT = 2.0  # wheel diameters, after the definition of a wheel trap


class Surroundings:
    """Asks the ground and the obstacles of one world for one rover."""

    def __init__(self, obstacles: ObstacleIndex, rover: RoverModel) -> None:
        self._obstacles = obstacles
        self._points = belly_points(rover)
        boxes = [(*box.centre_m, *box.size_m) for box in rover.chassis.box]
        self._boxes = np.array([(x - a / 2, x + a / 2, y - b / 2, y + b / 2, z - c / 2) for x, y, z, a, b, c in boxes])
        self._reach = max(hypot(max(-x0, x1), max(-y0, y1)) for x0, x1, y0, y1, _ in self._boxes)
        self._wheel_radius = rover.wheel.radius_m

    def belly_clearance(self, surface: Surface, position_w: FloatArray, rotation: FloatArray) -> float:
        """Smallest gap (m) between hull and ground or obstacles beneath it; negative where they press into it.

        ``position_w`` (3,) and ``rotation`` (3, 3), body to world, of the body origin.
        """
        near = self._obstacles
        return _clearance(
            surface,
            self._points,
            self._boxes,
            (near.vertices, near.starts, near.low, near.high),
            position_w,
            rotation,
            self._reach,
        )

    def pit_depths(self, surface: Surface, hubs_w: FloatArray, ahead_w: FloatArray) -> FloatArray:
        """Height (n,) that each wheel must climb to get out, whichever way it rolls; below zero where it need not.

        The lower of the highest ground or rock ahead and behind, above the lowest point of the wheel, the two at most
        two wheel diameters apart. ``hubs_w`` (n, 3); ``ahead_w`` (n, 2) unit directions in which the wheels roll.
        """
        near = self._obstacles
        depths = np.zeros(len(hubs_w))
        mesh = (near.mesh_vertices, near.faces, near.face_starts, near.low, near.high)
        _pits(surface, mesh, hubs_w, ahead_w, self._wheel_radius, depths)
        return depths


@njit(cache=True)
def _height(surface: Surface, x: float, y: float) -> float:
    """Height (m) of the ground as it lies now, ruts and berms included."""
    ground, (x0, y0, inverse), ruts = surface
    height: float = ground_height(ground, x0, y0, inverse, x, y) - rut_depth(ruts, x, y)
    return height


@njit(cache=True)
def _clearance(
    surface: Surface,
    points: FloatArray,
    boxes: FloatArray,
    obstacles: tuple[FloatArray, Places, FloatArray, FloatArray],
    position: FloatArray,
    rotation: FloatArray,
    reach: float,
) -> float:
    ground, grid, ruts = surface
    surface = (borrowed(ground), grid, lent(ruts))
    vertices, starts, low, high = obstacles
    px, py, pz = position[0], position[1], position[2]
    r = rotation
    least = 1e300
    for i in range(points.shape[0]):
        a, b, c = points[i, 0], points[i, 1], points[i, 2]
        x, y = px + r[0, 0] * a + r[0, 1] * b + r[0, 2] * c, py + r[1, 0] * a + r[1, 1] * b + r[1, 2] * c
        z = pz + r[2, 0] * a + r[2, 1] * b + r[2, 2] * c
        least = min(least, z - _height(surface, x, y))
    for i in range(low.shape[0]):
        if px + reach < low[i, 0] or px - reach > high[i, 0] or py + reach < low[i, 1] or py - reach > high[i, 1]:
            continue
        for k in range(starts[i], starts[i + 1]):
            dx, dy, dz = vertices[k, 0] - px, vertices[k, 1] - py, vertices[k, 2] - pz
            # In body axes: what lies under a box of the hull.
            x = r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz
            y = r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz
            z = r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz
            for j in range(boxes.shape[0]):
                if boxes[j, 0] <= x <= boxes[j, 1] and boxes[j, 2] <= y <= boxes[j, 3]:
                    least = min(least, boxes[j, 4] - z)
    return least


@njit(cache=True)
def _pits(
    surface: Surface,
    mesh: tuple[FloatArray, IntArray, Places, FloatArray, FloatArray],
    hubs: FloatArray,
    ahead: FloatArray,
    radius: float,
    depths: FloatArray,
) -> None:
    ground, grid, ruts = surface
    surface = (borrowed(ground), grid, lent(ruts))
    low, high = mesh[3], mesh[4]
    spacing = 2.0 * radius / _PIT_SAMPLES
    side = int(_WIDEST_PIT * _PIT_SAMPLES)
    reach = side * spacing
    profile = np.empty(2 * side + 1)
    for w in range(hubs.shape[0]):
        hx, hy = hubs[w, 0], hubs[w, 1]
        fx, fy = ahead[w, 0], ahead[w, 1]
        for k in range(2 * side + 1):
            s = (k - side) * spacing
            profile[k] = _height(surface, hx + s * fx, hy + s * fy)
        for i in range(low.shape[0]):
            if hx + reach < low[i, 0] or hx - reach > high[i, 0] or hy + reach < low[i, 1] or hy - reach > high[i, 1]:
                continue
            _raise_profile(profile, mesh[0], mesh[1], mesh[2][i], mesh[2][i + 1], (hx, hy, fx, fy), spacing)
        depths[w] = _way_out(profile, side) - (hubs[w, 2] - radius)


@njit(cache=True)
def _raise_profile(
    profile: FloatArray,
    vertices: FloatArray,
    faces: IntArray,
    first: int,
    last: int,
    line: tuple[float, float, float, float],
    spacing: float,
) -> None:
    """Lift the heights (2 m + 1,) along a line (a point and a unit direction) to those of the faces over it."""
    hx, hy, fx, fy = line
    side = profile.shape[0] // 2
    for f in range(first, last):
        nearest, farthest = 1e300, -1e300
        height_near, height_far = 0.0, 0.0
        for e in range(3):  # where the edges of the face cross the line
            a, b = faces[f, e], faces[f, (e + 1) % 3]
            ax, ay = vertices[a, 0] - hx, vertices[a, 1] - hy
            bx, by = vertices[b, 0] - hx, vertices[b, 1] - hy
            ta, tb = ay * fx - ax * fy, by * fx - bx * fy
            if (ta > 0.0) == (tb > 0.0):
                continue
            share = ta / (ta - tb)
            s = (ax + share * (bx - ax)) * fx + (ay + share * (by - ay)) * fy
            z = vertices[a, 2] + share * (vertices[b, 2] - vertices[a, 2])
            if s < nearest:
                nearest, height_near = s, z
            if s > farthest:
                farthest, height_far = s, z
        if nearest > farthest:
            continue
        start = max(int(np.ceil(nearest / spacing)), -side)
        stop = min(int(np.floor(farthest / spacing)), side)
        length = max(farthest - nearest, 1e-12)
        for k in range(start, stop + 1):
            z = height_near + (k * spacing - nearest) / length * (height_far - height_near)
            profile[k + side] = max(profile[k + side], z)


@njit(cache=True)
def _way_out(profile: FloatArray, side: int) -> float:
    """Height of the lower rim of the pit in the middle of ``profile`` (2 side + 1,), its rims ``side`` cells apart."""
    behind = -1e300
    best = -1e300
    ahead = np.empty(side)  # highest within k + 1 cells ahead
    top = -1e300
    for k in range(side):
        top = max(top, profile[side + 1 + k])
        ahead[k] = top
    for k in range(side - 1):
        behind = max(behind, profile[side - 1 - k])
        best = max(best, min(behind, ahead[side - 2 - k]))
    return best
