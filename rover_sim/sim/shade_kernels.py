"""Compiled lighting of what the raster kernels left: textures, bumps, sun, shadow, sky light and haze."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from rover_sim.sim import ground_shading as ground
from rover_sim.sim.ground_shading import (
    LOOK,
    LOOKS,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    PLANES,
    WIDEST,
    Planes,
    Three,
)
from rover_sim.sim.raster_kernels import EMPTY_TAG, GROUND_TAG, KeyArray
from rover_sim.sim.rut_shading import Marks, find_ruts, pressed_blocks
from rover_sim.sim.shade_types import Lens, Light, ShadowMap, Stones, Surface
from rover_sim.sim.texture_kernels import HALF, ONE, ZERO, Single, Texels, sample_solid
from rover_sim.sim.textures import Pyramid
from worlds.types import ByteArray, IntArray

BROAD_SCALE, BROAD_SHARE = 0.23, np.float32(0.6)  # of the broad texture of rocks
ONE_ON, TWO_ON, THREE_ON = np.uintp(1), np.uintp(2), np.uintp(3)
LOOK_GREEN, LOOK_BLUE, DUST, LOOK_X, LOOK_Y, LOOK_Z, ROUGH, WIDTH = (LOOK + np.uintp(WIDEST * n) for n in range(1, 9))


@njit(cache=True, nogil=True, fastmath=True)
def shade(
    keys: KeyArray,
    tags: IntArray,
    lens: Lens,
    surface: Surface,
    fine: Pyramid,
    drift: Pyramid,
    stones: Stones,
    solid: Pyramid,
    shadow: ShadowMap,
    bias_m: float,
    light: Light,
    marks: Marks,
    image: ByteArray,
) -> None:
    """Fill ``image`` (H, W, 3) from the keys (1 / depth) and tags (H, W) of the raster kernels.

    Keys of pixels that look into a rut are set to its depth.
    """
    rows, columns = keys.shape
    r, f = lens.rotation, lens.focal_px
    ex, ey, ez = lens.eye_w[0], lens.eye_w[1], lens.eye_w[2]
    focal, haze, bias = np.float32(f), np.float32(light.haze_per_m), np.float32(bias_m)
    to_sun, sun, ambient = _single(light.to_sun_w), _single(light.sun), _single(light.ambient)
    sand, pebble = _single(light.sand), _single(light.pebble)
    horizon, zenith = _single(light.horizon), _single(light.zenith)
    # Where the camera is in each texture and map; they are asked for places relative to it.
    x0, y0 = np.float32(surface.x0_m - ex), np.float32(surface.y0_m - ey)
    per_m, beyond = (
        np.float32(1.0 / surface.resolution_m),
        _single((surface.slope_beyond_x, surface.slope_beyond_y, 0.0)),
    )
    fine_at = _within(ex, ey, 0.0, fine.per_m)
    drift_at = _within(0.8 * ex - 0.6 * ey, 0.6 * ex + 0.8 * ey, 0.0, drift.per_m)
    solid_at, broad_at = _within(ex, ey, ez, solid.per_m), _within(ex, ey, ez, BROAD_SCALE * solid.per_m)
    m = shadow.matrix
    shear = (
        np.float32(m[0, 0]),
        np.float32(m[0, 2]),
        np.float32(m[0, 0] * ex + m[0, 2] * ez + m[0, 3] - 0.5),
        np.float32(m[1, 2]),
        np.float32(m[1, 1] * ey + m[1, 2] * ez + m[1, 3] - 0.5),
        np.float32(ez + m[3, 3]),
    )
    rut_grid = (marks.x0_m, marks.y0_m, marks.per_m)
    pressed, corner = pressed_blocks(marks.directory, marks.depth_m, rut_grid, ex, ey)
    across = _single((r[0, 0] / f, r[1, 0] / f, r[2, 0] / f))
    b, where, at = np.empty(PLANES * WIDEST, np.float32), np.empty(3 * WIDEST, np.int32), np.empty(WIDEST, np.int32)
    room = 2 * ground.MOST_TAPS * WIDEST
    jobs, which = np.empty(4 * room, np.float32), np.empty(6 * room, np.int32)
    near, wide = np.empty(8 * WIDEST, np.float32), np.empty(4 * WIDEST, np.float32)
    soil, rock, void = where[:WIDEST], where[WIDEST : 2 * WIDEST], where[2 * WIDEST :]
    for row in range(rows):
        u, v = (0.5 - columns / 2) / f, (row + 0.5 - rows / 2) / f
        first = _single(
            (
                r[0, 0] * u + r[0, 1] * v + r[0, 2],
                r[1, 0] * u + r[1, 1] * v + r[1, 2],
                r[2, 0] * u + r[2, 1] * v + r[2, 2],
            )
        )
        soils, rocks, voids = _sort(tags, row, soil, rock, void)
        if soils:
            _fetch(soil, soils, keys, row, b)
            ground.see(soil, soils, across, first, focal, haze, b)
            ground.find_slopes(soils, surface.slopes, x0, y0, per_m, beyond, bias, b, at)
            if marks.directory.size:
                eye = (ex, ey, ez)
                find_ruts(
                    soil,
                    soils,
                    keys,
                    row,
                    marks.directory,
                    marks.depth_m,
                    rut_grid,
                    pressed,
                    corner,
                    eye,
                    light.to_sun_w,
                    b,
                    at,
                )
            near[: 4 * soils], wide[: 4 * soils] = ZERO, ZERO
            ground.add_fine(soils, fine.data, fine.starts, np.float32(fine.per_m), fine_at, b, at, jobs, which, near)
            ground.add_broad(
                soils, drift.data, drift.starts, np.float32(drift.per_m), drift_at, b, at, jobs, which, wide
            )
            ground.cast(soils, shadow.key, shear, b, at)
            ground.light_ground(soils, near, wide, to_sun, sun, ambient, sand, pebble, b)
            ground.put(soil, soils, row, horizon, zenith, b, image)
        if rocks:
            _fetch(rock, rocks, keys, row, b)
            ground.see(rock, rocks, across, first, focal, haze, b)
            _fetch_stones(rock, rocks, tags, row, stones, to_sun, bias, b)
            ground.cast(rocks, shadow.key, shear, b, at)
            _dent(rocks, solid.data, solid.starts, np.float32(solid.per_m), solid_at, broad_at, b, near)
            _light_stones(rocks, near, to_sun, sun, ambient, sand, b)
            ground.put(rock, rocks, row, horizon, zenith, b, image)
        if voids:
            _put_sky(void, voids, row, across, first, horizon, zenith, image)


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _single(v: Any) -> Three:
    """Three numbers in single precision."""
    return np.float32(v[0]), np.float32(v[1]), np.float32(v[2])


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _within(x: float, y: float, z: float, per_m: float) -> Three:
    """The same place in the first period of a texture (m): small numbers keep single precision fine."""
    tile = 1.0 / per_m
    return _single((x - np.floor(x / tile) * tile, y - np.floor(y / tile) * tile, z - np.floor(z / tile) * tile))


@njit(cache=True, nogil=True)
def _sort(tags: IntArray, row: int, soil: IntArray, rock: IntArray, void: IntArray) -> tuple[int, int, int]:
    """Columns of a row where there is ground, rock and sky, and how many."""
    soils = rocks = voids = 0
    for column in range(tags.shape[1]):
        tag = tags[row, column]
        # Written to all three and counted in one: no branch to be guessed.
        soil[soils], rock[rocks], void[voids] = column, column, column
        soils += tag == GROUND_TAG
        rocks += tag > GROUND_TAG
        voids += tag == EMPTY_TAG
    return soils, rocks, voids


@njit(cache=True, nogil=True)
def _fetch(where: IntArray, count: int, keys: KeyArray, row: int, b: Planes) -> None:
    """Pack the keys of a row's pixels."""
    for k in range(count):
        b[ground.KEY + np.uintp(k)] = keys[np.uintp(row), np.uintp(where[np.uintp(k)])]


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _fetch_stones(
    where: IntArray, count: int, tags: IntArray, row: int, stones: Stones, s: Three, bias_m: Single, b: Planes
) -> None:
    """Pack normals and looks of the pixels of rocks, how they lie to the sun, and their lift off the face."""
    normals, blocks, looks = stones.normal, stones.block, stones.look
    for k in range(count):
        i = np.uintp(k)
        face = np.uintp(tags[row, where[i]] - 1)
        rock = np.uintp(blocks[face])
        for look in range(LOOKS):
            b[LOOK + np.uintp(look * WIDEST) + i] = looks[rock, look]
        b[NORMAL_X + i], b[NORMAL_Y + i], b[NORMAL_Z + i] = normals[face, 0], normals[face, 1], normals[face, 2]
    for k in range(count):
        i = np.uintp(k)
        n0, n1, n2 = b[NORMAL_X + i], b[NORMAL_Y + i], b[NORMAL_Z + i]
        lift = bias_m + ground.FOOTPRINT_LIFT * b[ground.MINOR + i]
        b[ground.LIFT_X + i], b[ground.LIFT_Y + i], b[ground.LIFT_Z + i] = lift * n0, lift * n1, lift * n2
        b[ground.LIT + i] = ONE if n0 * s[0] + n1 * s[1] + n2 * s[2] > ZERO else ZERO


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _dent(
    count: int, solid: Texels, starts: IntArray, per_m: Single, at: Three, broad_at: Three, b: Planes, out: Planes
) -> None:
    """Fine and broad sample (pixels, 8) of the rocks' texture; ``at``, ``broad_at``: the camera in their periods."""
    texels, top = solid.ctypes.data, np.float32(1 << (starts.size - 3)) * per_m
    p, q, less = per_m, np.float32(BROAD_SCALE) * per_m, np.float32(BROAD_SCALE)
    for k in range(count):
        i, o = np.uintp(k), np.uintp(8 * k)
        x, y, z = b[ground.X + i] + b[LOOK_X + i], b[ground.Y + i] + b[LOOK_Y + i], b[ground.Z + i] + b[LOOK_Z + i]
        covered = top * b[ground.MINOR + i]
        t = sample_solid(texels, starts, (x + at[0]) * p, (y + at[1]) * p, (z + at[2]) * p, covered)
        out[o], out[o + ONE_ON], out[o + TWO_ON], out[o + THREE_ON] = t
        x, y, z = (x + broad_at[0]) * q, (y + broad_at[1]) * q, (z + broad_at[2]) * q
        t = sample_solid(texels, starts, x, y, z, less * covered)
        o += np.uintp(4)
        out[o], out[o + ONE_ON], out[o + TWO_ON], out[o + THREE_ON] = t


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _light_stones(count: int, t: Planes, s: Three, sun: Three, ambient: Three, sand: Three, b: Planes) -> None:
    """Colours of rocks without the air before them, from the samples of `_dent`."""
    for k in range(count):
        i, o = np.uintp(k), np.uintp(8 * k)
        n0, n1, n2 = b[NORMAL_X + i], b[NORMAL_Y + i], b[NORMAL_Z + i]
        rough = b[ROUGH + i]
        g0 = rough * (t[o + np.uintp(1)] + BROAD_SHARE * t[o + np.uintp(5)])
        g1 = rough * (t[o + np.uintp(2)] + BROAD_SHARE * t[o + np.uintp(6)])
        g2 = rough * (t[o + np.uintp(3)] + BROAD_SHARE * t[o + np.uintp(7)])
        # Only the part of the gradient in the surface bends the normal (Perlin, "An image synthesizer", 1985).
        along = ONE + g0 * n0 + g1 * n1 + g2 * n2
        m0, m1, m2 = along * n0 - g0, along * n1 - g1, along * n2 - g2
        short = ONE / np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
        direct = max((m0 * s[0] + m1 * s[1] + m2 * s[2]) * short, ZERO) * b[ground.LIT + i]
        m2 *= short
        brightness = ONE + rough * (t[o] + t[o + np.uintp(4)] - np.float32(2.0))
        # A rock of two pixels or less would glitter as the camera moves: it takes on the colour of the sand around it.
        dust = max(b[DUST + i] * max(m2, ZERO) * max(m2, ZERO), ONE - HALF * b[WIDTH + i] / b[ground.MINOR + i])
        sky = ground.SKY_LEAST + ground.SKY_MORE * m2
        red, green, blue = b[LOOK + i], b[LOOK_GREEN + i], b[LOOK_BLUE + i]
        b[ground.RED + i] = brightness * (red + dust * (sand[0] - red)) * (direct * sun[0] + sky * ambient[0])
        b[ground.GREEN + i] = brightness * (green + dust * (sand[1] - green)) * (direct * sun[1] + sky * ambient[1])
        b[ground.BLUE + i] = brightness * (blue + dust * (sand[2] - blue)) * (direct * sun[2] + sky * ambient[2])


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _put_sky(
    where: IntArray, count: int, row: int, across: Three, first: Three, horizon: Three, zenith: Three, image: ByteArray
) -> None:
    """Write the pixels of the sky."""
    for k in range(count):
        c = np.uintp(where[np.uintp(k)])
        column = np.float32(where[np.uintp(k)])
        dx, dy = first[0] + column * across[0], first[1] + column * across[1]
        dz = first[2] + column * across[2]
        up = min(max(np.float32(1.6) * dz / np.sqrt(dx * dx + dy * dy + dz * dz), ZERO), ONE)
        image[row, c, 0] = np.uint8(horizon[0] + up * (zenith[0] - horizon[0]) + HALF)
        image[row, c, 1] = np.uint8(horizon[1] + up * (zenith[1] - horizon[1]) + HALF)
        image[row, c, 2] = np.uint8(horizon[2] + up * (zenith[2] - horizon[2]) + HALF)


@njit(cache=True, nogil=True)
def soften_outlines(image: ByteArray, tags: IntArray, out: ByteArray) -> None:
    """Copy ``image`` (H, W, 3) to ``out``, with the outlines of rocks and of the sky averaged over their neighbours.

    A pixel is lit at its centre alone, so that outlines would be stairs and far rocks would glitter; a lens and a
    pixel of some width average them.
    """
    rows, columns = tags.shape
    for row in range(rows):
        above, below = max(row - 1, 0), min(row + 1, rows - 1)
        for column in range(columns):
            left, right = max(column - 1, 0), min(column + 1, columns - 1)
            here = min(tags[row, column], 1)
            edge = (
                min(tags[above, column], 1) != here
                or min(tags[below, column], 1) != here
                or min(tags[row, left], 1) != here
                or min(tags[row, right], 1) != here
            )
            for channel in range(3):
                value = int(image[row, column, channel])
                if edge:
                    around = int(image[above, column, channel]) + int(image[below, column, channel])
                    around += int(image[row, left, channel]) + int(image[row, right, channel])
                    value = (4 * value + around + 4) // 8
                out[row, column, channel] = value
