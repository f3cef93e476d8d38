"""Compiled look of ruts: where a line of sight meets the pressed ground, how that lies to the sun, what was churned.

The ground itself is drawn without ruts; here a line of sight is followed on from where it met the natural surface,
taken as a plane, to the depths of the fine map (relief mapping: Policarpo, Oliveira and Comba, SIGGRAPH 2005). So ruts
are seen as finely as they are held, and a new rut costs the picture nothing but its own pixels.

Numba watches a compiled function's own file only: after a change here save `shade_kernels` anew.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim import ground_shading as ground
from rover_sim.sim.raster_kernels import KeyArray
from rover_sim.sim.rut_kernels import TILE_TEXELS
from rover_sim.sim.texture_kernels import ONE, ZERO
from worlds.types import ByteArray, IntArray

HIGHEST_M = 0.04  # of a pile that a line of sight may meet before the natural ground
STEPS = 24
CHURNED_M = 0.003  # depth from which soil looks wholly disturbed
SUN_STEPS = 5
NEAR_TEXELS = 2.0  # pixels that cover more see the mean of a rut, not its shape
# Around the camera it is known of each block of texels whether anything is pressed in it or in three blocks on.
BLOCK_TEXELS, BLOCKS_ON, TILES_ON = 8, 3, 4
BLOCKS = TILE_TEXELS // BLOCK_TEXELS  # a tile's side
WAY_TEXELS = 16.0  # that a line of sight may run level above a rut; with the way to the sun less than three blocks

Depths = NDArray[np.float32]
Vector = tuple[float, float, float]
Pair = tuple[float, float]
Place = tuple[int, int]  # row and column of a tile in the directory
Grid = tuple[float, float, float]  # x and y of the first texel's corner, texels a metre
Look = tuple[float, float, float, float, float]  # way along the sight, slopes of the depth, share churned, share of sun
NO_LOOK: Look = (0.0, 0.0, 0.0, 0.0, 1.0)


class Marks(NamedTuple):
    """The ruts as the shading takes them; no tile anywhere where the directory is empty."""

    directory: IntArray  # (rows, columns) number of the tile at each place, -1 for none
    depth_m: Depths  # (T, 64, 64) below the natural ground
    x0_m: float
    y0_m: float
    per_m: float


@njit(cache=True, nogil=True, fastmath=True)
def _texel(directory: IntArray, depth: Depths, j: int, i: int) -> float:
    """Depth of one texel; 0 where no wheel was."""
    if i < 0 or j < 0:
        return 0.0
    row, column = j // TILE_TEXELS, i // TILE_TEXELS
    if row >= directory.shape[0] or column >= directory.shape[1]:
        return 0.0
    tile = directory[row, column]
    if tile < 0:
        return 0.0
    return float(depth[tile, j % TILE_TEXELS, i % TILE_TEXELS])


@njit(cache=True, nogil=True, fastmath=True)
def _depth(directory: IntArray, depth: Depths, grid: Grid, x: float, y: float) -> Vector:
    """Depth and its slopes along x and y at a point, by quadratic B-splines, which show no stairs along a rut."""
    u, v = (x - grid[0]) * grid[2], (y - grid[1]) * grid[2]
    i, j = int(np.floor(u)), int(np.floor(v))
    u, v = u - i - 0.5, v - j - 0.5
    value = along_x = along_y = 0.0
    for row in range(-1, 2):
        # Weights of the texels before, at and after the point, and how they grow.
        wv = 0.75 - v * v if row == 0 else 0.5 * (0.5 + row * v) ** 2
        gv = -2.0 * v if row == 0 else row * (0.5 + row * v)
        a = _texel(directory, depth, j + row, i - 1)
        b = _texel(directory, depth, j + row, i)
        c = _texel(directory, depth, j + row, i + 1)
        across = 0.5 * (0.5 - u) ** 2 * a + (0.75 - u * u) * b + 0.5 * (0.5 + u) ** 2 * c
        value += wv * across
        along_x += wv * ((u - 0.5) * a - 2.0 * u * b + (0.5 + u) * c)
        along_y += gv * across
    return value, grid[2] * along_x, grid[2] * along_y


@njit(cache=True, nogil=True, fastmath=True)
def _quick_depth(directory: IntArray, depth: Depths, grid: Grid, x: float, y: float) -> float:
    """Depth at a point, bilinear: what is wanted many times a pixel."""
    u, v = (x - grid[0]) * grid[2] - 0.5, (y - grid[1]) * grid[2] - 0.5
    i, j = int(np.floor(u)), int(np.floor(v))
    u, v = u - i, v - j
    near = (1 - u) * _texel(directory, depth, j, i) + u * _texel(directory, depth, j, i + 1)
    far = (1 - u) * _texel(directory, depth, j + 1, i) + u * _texel(directory, depth, j + 1, i + 1)
    value: float = (1 - v) * near + v * far
    return value


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def marked(directory: IntArray, grid: Grid, x: float, y: float) -> bool:
    """Whether a wheel was in the tile of a point."""
    row, column = int((y - grid[1]) * grid[2]) // TILE_TEXELS, int((x - grid[0]) * grid[2]) // TILE_TEXELS
    if row < 0 or column < 0 or row >= directory.shape[0] or column >= directory.shape[1]:
        return False
    return bool(directory[row, column] >= 0)


@njit(cache=True, nogil=True)
def pressed_blocks(directory: IntArray, depth: Depths, grid: Grid, x: float, y: float) -> tuple[ByteArray, Place]:
    """Blocks (N, N) around a point: 1 where a texel near is not natural ground; and the tile where they begin."""
    per_m = grid[2] / TILE_TEXELS
    row0, column0 = int((y - grid[1]) * per_m) - TILES_ON, int((x - grid[0]) * per_m) - TILES_ON
    side = (2 * TILES_ON + 1) * BLOCKS
    own, along, found = (
        np.zeros((side, side), np.uint8),
        np.zeros((side, side), np.uint8),
        np.zeros((side, side), np.uint8),
    )
    for row in range(max(row0, 0), min(row0 + 2 * TILES_ON + 1, directory.shape[0])):
        for column in range(max(column0, 0), min(column0 + 2 * TILES_ON + 1, directory.shape[1])):
            tile = directory[row, column]
            if tile >= 0:
                _mark_blocks(depth[tile], own, BLOCKS * (row - row0), BLOCKS * (column - column0))
    for row in range(side):
        for column in range(side):
            for n in range(max(column - BLOCKS_ON, 0), min(column + BLOCKS_ON + 1, side)):
                along[row, column] |= own[row, n]
    for row in range(side):
        for n in range(max(row - BLOCKS_ON, 0), min(row + BLOCKS_ON + 1, side)):
            for column in range(side):
                found[row, column] |= along[n, column]
    return found, (row0, column0)


@njit(cache=True, nogil=True)
def _mark_blocks(tile: Depths, own: ByteArray, row0: int, column0: int) -> None:
    for j in range(TILE_TEXELS):
        for block in range(BLOCKS):
            any_pressed = False
            for i in range(block * BLOCK_TEXELS, (block + 1) * BLOCK_TEXELS):
                any_pressed |= tile[j, i] != 0.0
            own[row0 + j // BLOCK_TEXELS, column0 + block] |= any_pressed


@njit(cache=True, nogil=True, fastmath=True)
def _meet(directory: IntArray, depth: Depths, grid: Grid, point: Vector, ray: Vector, sinking: float) -> float:
    """Way (m) along the ray from the natural surface to the true one; ``sinking``: below it per metre of the ray."""
    step = 0.7 / grid[2] / max(np.sqrt(ray[0] * ray[0] + ray[1] * ray[1]), 0.1)
    s = -HIGHEST_M / sinking
    before = 1.0
    for _ in range(STEPS):
        above = _quick_depth(directory, depth, grid, point[0] + s * ray[0], point[1] + s * ray[1]) - sinking * s
        if above <= 0.0:
            return float(s - step * above / min(above - before, -1e-9))
        before = above
        s += step
    return s


@njit(cache=True, nogil=True, fastmath=True)
def _sunlit(
    directory: IntArray, depth: Depths, grid: Grid, x: float, y: float, own: float, sun: Vector, slopes: Pair
) -> float:
    """Share of the sun that the walls of a rut let through to a point ``own`` below the natural ground."""
    level = max(np.sqrt(sun[0] * sun[0] + sun[1] * sun[1]), 1e-6)
    dx, dy = sun[0] / level, sun[1] / level
    rise = sun[2] / level - slopes[0] * dx - slopes[1] * dy
    share = 1.0
    for step in range(1, SUN_STEPS + 1):
        way = 0.8 * step / grid[2]
        wall = own - _quick_depth(directory, depth, grid, x + way * dx, y + way * dy) - way * rise
        share = min(share, 1.0 - wall / 0.006)  # blurred over some millimetres
    return max(share, 0.0)


@njit(cache=True, nogil=True, fastmath=True)
def look(
    directory: IntArray,
    depth: Depths,
    grid: Grid,
    point: Vector,
    ray: Vector,
    slopes: Pair,
    sun: Vector,
    minor_m: float,
    major_m: float,
) -> Look:
    """How the ground is disturbed where a pixel of ``minor_m`` by ``major_m`` sees it."""
    sinking = slopes[0] * ray[0] + slopes[1] * ray[1] - ray[2]
    if sinking <= 0.02 or major_m * grid[2] > NEAR_TEXELS:
        return _mean(directory, depth, grid, point, ray, minor_m, major_m)
    s = _meet(directory, depth, grid, point, ray, sinking)
    x, y = point[0] + s * ray[0], point[1] + s * ray[1]
    own, dx, dy = _depth(directory, depth, grid, x, y)
    lit = _sunlit(directory, depth, grid, x, y, own, sun, slopes)
    return s, dx, dy, min(abs(own) / CHURNED_M, 1.0), lit


@njit(cache=True, nogil=True, fastmath=True)
def _mean(
    directory: IntArray, depth: Depths, grid: Grid, point: Vector, ray: Vector, minor_m: float, major_m: float
) -> Look:
    """The same for a pixel that covers several texels: their mean, and no shape."""
    level = np.sqrt(ray[0] * ray[0] + ray[1] * ray[1]) + 1e-9
    ux, uy = ray[0] / level, ray[1] / level
    taps = min(max(int(major_m * grid[2] / 2.0), 2), 8)
    churned = dx = dy = 0.0
    for tap in range(taps):
        a = ((tap + 0.5) / taps - 0.5) * major_m
        for side in range(2):
            c = (side - 0.5) * 0.5 * minor_m
            own, gx, gy = _depth(directory, depth, grid, point[0] + a * ux - c * uy, point[1] + a * uy + c * ux)
            churned += min(abs(own) / CHURNED_M, 1.0)
            dx += gx
            dy += gy
    share = 0.5 / taps
    return 0.0, share * dx, share * dy, share * churned, 1.0


@njit(cache=True, nogil=True, fastmath=True)
def find_ruts(
    where: IntArray,
    count: int,
    keys: KeyArray,
    row: int,
    directory: IntArray,
    depth_m: Depths,
    grid: Grid,
    pressed: ByteArray,
    corner: Place,
    eye: Vector,
    to_sun: Vector,
    b: ground.Planes,
    at: IntArray,
) -> None:
    """Follow the lines of sight into ruts: their walls, shade and churned soil; keys are set to the depth there.

    ``pressed`` (N, N): `pressed_blocks` from the tile ``corner`` of the directory on.
    """
    x0, y0 = np.float32(grid[0] - eye[0]), np.float32(grid[1] - eye[1])
    per_m, lines, line = np.float32(grid[2] / TILE_TEXELS), directory.shape[0], directory.shape[1]
    side, blocks = np.float32(pressed.shape[0]), np.float32(BLOCKS)
    u_from, v_from = np.float32(BLOCKS * corner[1]), np.float32(BLOCKS * corner[0])
    near, steepest = np.float32(NEAR_TEXELS / grid[2]), np.float32(HIGHEST_M * grid[2] / WAY_TEXELS)
    for k in range(count):
        i = np.uintp(k)
        u, v = (b[ground.X + i] - x0) * per_m, (b[ground.Y + i] - y0) * per_m
        inside = (u >= ZERO) & (v >= ZERO) & (u < np.float32(line)) & (v < np.float32(lines))
        at[i] = np.int32(v) * np.int32(line) + np.int32(u) if inside else -1
        u, v, rx, ry = blocks * u - u_from, blocks * v - v_from, b[ground.RAY_X + i], b[ground.RAY_Y + i]
        sinking = b[ground.SLOPE_X + i] * rx + b[ground.SLOPE_Y + i] * ry - b[ground.RAY_Z + i]
        # So near and so steep that nothing counts but what `pressed` tells.
        told = (
            (sinking > ground.FLATTEST)
            & (sinking > steepest * np.sqrt(rx * rx + ry * ry))
            & (b[ground.MAJOR + i] <= near)
        )
        told = told & (u >= ZERO) & (v >= ZERO) & (u < side) & (v < side)
        b[ground.TOP + i] = np.floor(v) * side + np.floor(u) if told else -ONE
    tiles, flags = directory.reshape(directory.size), pressed.reshape(pressed.size)
    marked = 0
    for k in range(count):
        tile, block = at[np.uintp(k)], int(b[ground.TOP + np.uintp(k)])
        at[marked] = k
        wanted: bool = (block < 0) or (flags[np.uintp(max(block, 0))] > 0)
        marked += wanted and (tile >= 0) and (tiles[np.uintp(max(tile, 0))] >= 0)
    for m in range(marked):
        i = np.uintp(at[m])
        gx, gy = float(b[ground.SLOPE_X + i]), float(b[ground.SLOPE_Y + i])
        x, y, z = b[ground.X + i], b[ground.Y + i], b[ground.Z + i]
        point = (eye[0] + x, eye[1] + y, eye[2] + z)
        ray = (float(b[ground.RAY_X + i]), float(b[ground.RAY_Y + i]), float(b[ground.RAY_Z + i]))
        covers = (float(b[ground.MINOR + i]), float(b[ground.MAJOR + i]))
        seen = look(directory, depth_m, grid, point, ray, (gx, gy), to_sun, *covers)
        way = seen[0]
        if way != 0.0:
            keys[row, where[i]] = 1.0 / (b[ground.DEPTH + i] * (1.0 + way / np.sqrt(x * x + y * y + z * z)))
        # Above the rut on the natural ground: what casts shadows there does so in the rut.
        b[ground.X + i] += np.float32(way * ray[0])
        b[ground.Y + i] += np.float32(way * ray[1])
        b[ground.Z + i] += np.float32(way * (gx * ray[0] + gy * ray[1]))
        b[ground.RUT_X + i], b[ground.RUT_Y + i] = np.float32(gx - seen[1]), np.float32(gy - seen[2])
        b[ground.CHURNED + i], b[ground.LIT + i] = np.float32(seen[3]), np.float32(seen[4])
