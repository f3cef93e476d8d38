"""Compiled lighting of the ground, a row of pixels at a time and in stages, in single precision.

Each stage is a short loop over the row, from planes of numbers to planes. Stages that only reckon are kept apart from
those that look something up, as the compiler does sixteen pixels at once in the former; nothing branches on a pixel.
Places are relative to the camera, so that single precision is fine enough anywhere in the world.

Numba watches a compiled function's own file only: after a change here save `shade_kernels` anew.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.raster_kernels import KeyArray
from rover_sim.sim.texture_kernels import HALF, ONE, ZERO, Single, add_samples, level_of
from worlds.types import ByteArray, IntArray

Planes = NDArray[np.float32]  # runs of `WIDEST` numbers, one for each quantity of the pixels in work
Three = tuple[Single, Single, Single]
WIDEST = 2096  # pixels of a row at most; no power of two, so that planes do not share the lines of a cache
KEY, DEPTH, CLEAR, MINOR, MAJOR, X, Y, Z, RAY_X, RAY_Y, RAY_Z = (np.uintp(WIDEST * n) for n in range(11))
SLOPE_X, SLOPE_Y, RUT_X, RUT_Y, CHURNED, LIT = (np.uintp(WIDEST * n) for n in range(11, 17))
LIFT_X, LIFT_Y, LIFT_Z, U, V, INSIDE, TOP = (np.uintp(WIDEST * n) for n in range(17, 24))
TAPS, SHARE, MIX, STEP_U, STEP_V, RED, GREEN, BLUE = (np.uintp(WIDEST * n) for n in range(24, 32))
NORMAL_X, NORMAL_Y, NORMAL_Z, LOOK = (np.uintp(WIDEST * n) for n in range(32, 36))  # of rocks; nine planes of looks
LOOKS, PLANES = 9, 44
MOST_TAPS = 4
SHARPNESS = np.float32(0.8)  # a level as large as the pixel itself blurs more than the pixel's own average would
TAPS_OF, LONG_OF = np.float32(0.4), np.float32(0.7)
FLATTEST = np.float32(0.04)  # least cosine between ray and ground
CHURNED_DARKER = np.float32(0.08)  # share of its brightness that soil loses where a wheel was
CHURNED_BUMPS = np.float32(0.3)  # how much rougher it is
CHURNED_BURIES = np.float32(0.8)  # share of the pebbles that are pressed in
LEVEL_LIFT, STEEP_LIFT = np.float32(0.1), np.float32(4.0)  # share of the lift over level ground, and more by its slope
FOOTPRINT_LIFT = np.float32(0.7)
TURN_COS, TURN_SIN = np.float32(0.8), np.float32(0.6)  # of the broad texture, so that the two periods do not line up
SKY_LEAST, SKY_MORE = np.float32(0.6), np.float32(0.4)  # a face that looks down sees little of the sky


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def see(where: IntArray, count: int, across: Three, first: Three, focal: Single, haze: Single, b: Planes) -> None:
    """Depths, places, rays and clearness of the air of the pixels in columns ``where`` (count,) of a row.

    ``first`` is the line of sight of the first column, ``across`` how much it changes by a column.
    """
    thin = haze / np.float32(16.0)
    for k in range(count):
        i = np.uintp(k)
        c = np.float32(where[i])
        dx, dy, dz = first[0] + c * across[0], first[1] + c * across[1], first[2] + c * across[2]
        depth = ONE / b[KEY + i]
        short = ONE / np.sqrt(dx * dx + dy * dy + dz * dz)
        b[DEPTH + i], b[MINOR + i] = depth, depth / focal
        b[X + i], b[Y + i], b[Z + i] = depth * dx, depth * dy, depth * dz
        b[RAY_X + i], b[RAY_Y + i], b[RAY_Z + i] = dx * short, dy * short, dz * short
        # exp(-haze depth), as the sixteenth power of its series.
        h = min(depth * thin, ONE)
        e = ONE - h * (ONE - h * (HALF - h * (np.float32(1 / 6) - h * np.float32(1 / 24))))
        e *= e
        e *= e
        e *= e
        b[CLEAR + i] = e * e


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def find_slopes(
    count: int, s: Planes, x0: Single, y0: Single, per_m: Single, beyond: Any, bias_m: Single, b: Planes, at: IntArray
) -> None:
    """Bilinear slopes of the ground, those of the plane beyond its edge, and what follows from them.

    ``s`` (ny, nx, 2); ``x0``, ``y0`` its first sample; ``at`` (`WIDEST`,) is scratch, here and below.
    """
    line = np.int32(2 * s.shape[1])
    last_u, last_v = np.float32(s.shape[1] - 1), np.float32(s.shape[0] - 1)
    for k in range(count):
        i = np.uintp(k)
        u, v = (b[X + i] - x0) * per_m, (b[Y + i] - y0) * per_m
        b[INSIDE + i] = ONE if (u >= ZERO) & (v >= ZERO) & (u <= last_u) & (v <= last_v) else ZERO
        u, v = min(max(u, ZERO), last_u), min(max(v, ZERO), last_v)
        p, q = min(np.floor(u), last_u - ONE), min(np.floor(v), last_v - ONE)
        b[U + i], b[V + i] = u - p, v - q
        at[i] = np.int32(q) * line + np.int32(2) * np.int32(p)
    flat = s.reshape(s.size)
    for k in range(count):
        i = np.uintp(k)
        u, v = b[U + i], b[V + i]
        top = np.uintp(at[i])
        low = top + np.uintp(line)
        x, y = flat[top] + u * (flat[top + np.uintp(2)] - flat[top]), flat[top + np.uintp(1)]
        y += u * (flat[top + np.uintp(3)] - y)
        x_, y_ = flat[low] + u * (flat[low + np.uintp(2)] - flat[low]), flat[low + np.uintp(1)]
        y_ += u * (flat[low + np.uintp(3)] - y_)
        b[SLOPE_X + i], b[SLOPE_Y + i] = x + v * (x_ - x), y + v * (y_ - y)
    for k in range(count):
        i = np.uintp(k)
        gx = beyond[0] + b[INSIDE + i] * (b[SLOPE_X + i] - beyond[0])
        gy = beyond[1] + b[INSIDE + i] * (b[SLOPE_Y + i] - beyond[1])
        b[SLOPE_X + i], b[SLOPE_Y + i], b[RUT_X + i], b[RUT_Y + i] = gx, gy, gx, gy
        b[CHURNED + i], b[LIT + i] = ZERO, ONE
        steep = gx * gx + gy * gy
        short = ONE / np.sqrt(steep + ONE)
        facing = abs(gx * b[RAY_X + i] + gy * b[RAY_Y + i] - b[RAY_Z + i]) * short
        b[MAJOR + i] = b[MINOR + i] / max(facing, FLATTEST)
        # Far tiles are drawn coarse and may lie as much below what casts the shadow as a pixel is wide. Level ground
        # throws no shadow on itself: lifted less, it keeps the shadows of low rocks at their length.
        lift = (bias_m + FOOTPRINT_LIFT * b[MINOR + i]) * min(ONE, LEVEL_LIFT + STEEP_LIFT * np.sqrt(steep)) * short
        b[LIFT_X + i], b[LIFT_Y + i], b[LIFT_Z + i] = -lift * gx, -lift * gy, lift


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def add_fine(
    count: int,
    texels: Planes,
    starts: IntArray,
    per_m: Single,
    eye: Any,
    b: Planes,
    at: IntArray,
    jobs: Planes,
    which: IntArray,
    out: Planes,
) -> None:
    """Mean of the fine texture over the strip of ground that each pixel covers, added to ``out`` (pixels, 4).

    Far away that strip is many times longer than wide: a few samples along it neither glitter nor blur. ``eye`` (2,)
    is where the camera is in the texture's first period; ``jobs`` and ``which`` have room for the samples of a row.
    """
    last, top = np.float32(starts.size - 3), np.float32(1 << (starts.size - 3)) * per_m
    for k in range(count):
        i = np.uintp(k)
        minor, major = b[MINOR + i], b[MAJOR + i]
        taps = min(max(np.floor(TAPS_OF * major / minor), ONE), np.float32(MOST_TAPS))
        share = ONE / taps
        long_m = major * share
        level, mix = level_of(SHARPNESS * top * max(minor, long_m * LONG_OF), last)
        rx, ry = b[RAY_X + i], b[RAY_Y + i]
        step = long_m * per_m / np.sqrt(rx * rx + ry * ry + np.float32(1e-12))
        back = HALF * (taps - ONE)
        b[TAPS + i], b[SHARE + i], b[MIX + i] = taps, share, mix
        b[STEP_U + i], b[STEP_V + i] = rx * step, ry * step
        b[U + i] = (b[X + i] + eye[0]) * per_m - back * rx * step
        b[V + i] = (b[Y + i] + eye[1]) * per_m - back * ry * step
        at[i] = np.int32(level)
    _run(count, texels, starts, b, at, jobs, which, out)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def add_broad(
    count: int,
    texels: Planes,
    starts: IntArray,
    per_m: Single,
    eye: Any,
    b: Planes,
    at: IntArray,
    jobs: Planes,
    which: IntArray,
    out: Planes,
) -> None:
    """The broad texture at each pixel, added to ``out`` (pixels, 4); arguments as for `add_fine`."""
    last, top = np.float32(starts.size - 3), np.float32(1 << (starts.size - 3)) * per_m
    for k in range(count):
        i = np.uintp(k)
        x, y = b[X + i], b[Y + i]
        level, mix = level_of(top * np.sqrt(b[MINOR + i] * b[MAJOR + i]), last)
        b[TAPS + i], b[SHARE + i], b[MIX + i] = ONE, ONE, mix
        b[STEP_U + i], b[STEP_V + i] = ZERO, ZERO
        b[U + i] = (TURN_COS * x - TURN_SIN * y + eye[0]) * per_m
        b[V + i] = (TURN_SIN * x + TURN_COS * y + eye[1]) * per_m
        at[i] = np.int32(level)
    _run(count, texels, starts, b, at, jobs, which, out)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _run(
    count: int,
    texels: Planes,
    starts: IntArray,
    b: Planes,
    at: IntArray,
    jobs: Planes,
    which: IntArray,
    out: Planes,
) -> None:
    """Write down all samples of the row, and take them."""
    room = jobs.size // 4
    u, v, weight = jobs[:room], jobs[room : 2 * room], jobs[2 * room : 3 * room]
    level, pixel = which[:room], which[room : 2 * room]
    n = np.uintp(0)
    for k in range(count):
        i = np.uintp(k)
        x, y, mix, share = b[U + i], b[V + i], b[MIX + i], b[SHARE + i]
        # Taps and levels change little along a row: these branches are guessed well.
        for _ in range(int(b[TAPS + i])):
            u[n], v[n], level[n], weight[n], pixel[n] = x, y, at[i], share * (ONE - mix), k
            n += np.uintp(1)
            if mix > ZERO:
                u[n], v[n], level[n], weight[n], pixel[n] = x, y, at[i] + 1, share * mix, k
                n += np.uintp(1)
            x, y = x + b[STEP_U + i], y + b[STEP_V + i]
    add_samples(int(n), jobs, which, room, texels, starts, out)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def cast(count: int, top_key: KeyArray, shear: Any, b: Planes, at: IntArray) -> None:
    """Take from the sun on each pixel what the things in the shadow map keep from it: four comparisons, blended.

    Outside the map all of it comes through. ``shear``: column 0 x + 1 z + 2, row 0 y + 3 z + 4, key z + 5.
    """
    line = np.int32(top_key.shape[1])
    last_u, last_v = np.float32(top_key.shape[1] - 1), np.float32(top_key.shape[0] - 1)
    for k in range(count):
        i = np.uintp(k)
        z = b[Z + i] + b[LIFT_Z + i]
        u = shear[0] * (b[X + i] + b[LIFT_X + i]) + shear[1] * z + shear[2]
        v = shear[0] * (b[Y + i] + b[LIFT_Y + i]) + shear[3] * z + shear[4]
        inside = (u >= ZERO) & (v >= ZERO) & (u < last_u) & (v < last_v)
        b[INSIDE + i] = ONE if inside else ZERO
        u, v = (u if inside else ZERO), (v if inside else ZERO)
        fu, fv = np.floor(u), np.floor(v)
        b[U + i], b[V + i], b[TOP + i] = u - fu, v - fv, z + shear[5]
        at[i] = np.int32(fv) * line + np.int32(fu)
    flat = top_key.reshape(top_key.size)
    for k in range(count):
        i = np.uintp(k)
        first, key, u = np.uintp(at[i]), b[TOP + i], b[U + i]
        below = first + np.uintp(line)
        a, c = (ONE if key >= flat[first] else ZERO), (ONE if key >= flat[below] else ZERO)
        top = a + u * ((ONE if key >= flat[first + np.uintp(1)] else ZERO) - a)
        low = c + u * ((ONE if key >= flat[below + np.uintp(1)] else ZERO) - c)
        b[LIT + i] *= ONE + b[INSIDE + i] * (top + b[V + i] * (low - top) - ONE)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def light_ground(
    count: int,
    fine: Planes,
    broad: Planes,
    s: Three,
    sun: Three,
    ambient: Three,
    sand: Three,
    pebble: Three,
    b: Planes,
) -> None:
    """Colours of the ground's pixels, without the air before them; ``s`` is the way to the sun."""
    p0, p1, p2 = pebble[0] - sand[0], pebble[1] - sand[1], pebble[2] - sand[2]
    for k in range(count):
        i = np.uintp(k)
        f = np.uintp(4) * i
        churned, gx, gy = b[CHURNED + i], b[RUT_X + i], b[RUT_Y + i]
        broad_x, broad_y = broad[f + np.uintp(1)], broad[f + np.uintp(2)]
        strength = broad[f + np.uintp(3)] * (ONE + CHURNED_BUMPS * churned)
        brightness = broad[f] * (ONE + strength * (fine[f] - ONE)) * (ONE - CHURNED_DARKER * churned)
        share = min(strength * fine[f + np.uintp(3)], ONE) * (ONE - CHURNED_BURIES * churned)
        # The normal is bent by the slopes of both textures, as far as it points up.
        up = ONE / np.sqrt(gx * gx + gy * gy + ONE)
        nx = up * (-gx - strength * fine[f + np.uintp(1)] - (TURN_COS * broad_x + TURN_SIN * broad_y))
        ny = up * (-gy - strength * fine[f + np.uintp(2)] - (TURN_COS * broad_y - TURN_SIN * broad_x))
        short = ONE / np.sqrt(nx * nx + ny * ny + up * up)
        direct = max((nx * s[0] + ny * s[1] + up * s[2]) * short, ZERO) * b[LIT + i]
        direct = direct if s[2] - b[SLOPE_X + i] * s[0] - b[SLOPE_Y + i] * s[1] > ZERO else ZERO
        sky = SKY_LEAST + SKY_MORE * up * short
        b[RED + i] = brightness * (sand[0] + share * p0) * (direct * sun[0] + sky * ambient[0])
        b[GREEN + i] = brightness * (sand[1] + share * p1) * (direct * sun[1] + sky * ambient[1])
        b[BLUE + i] = brightness * (sand[2] + share * p2) * (direct * sun[2] + sky * ambient[2])


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def put(where: IntArray, count: int, row: int, horizon: Three, zenith: Three, b: Planes, image: ByteArray) -> None:
    """Write pixels to a row of the picture, with the sky's light in the air before them."""
    h0, h1, h2 = zenith[0] - horizon[0], zenith[1] - horizon[1], zenith[2] - horizon[2]
    for k in range(count):
        i = np.uintp(k)
        up = min(max(np.float32(1.6) * b[RAY_Z + i], ZERO), ONE)
        clear = b[CLEAR + i]
        b[RED + i] = _level(clear, b[RED + i], horizon[0] + up * h0)
        b[GREEN + i] = _level(clear, b[GREEN + i], horizon[1] + up * h1)
        b[BLUE + i] = _level(clear, b[BLUE + i], horizon[2] + up * h2)
    r = np.uintp(row)
    for k in range(count):
        i, c = np.uintp(k), np.uintp(where[np.uintp(k)])
        image[r, c, 0] = np.uint8(b[RED + i])
        image[r, c, 1] = np.uint8(b[GREEN + i])
        image[r, c, 2] = np.uint8(b[BLUE + i])


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _level(clear: Single, colour: Single, sky: Single) -> Single:
    """Grey level of a colour seen through the air, to be cut to a whole number."""
    return min(max(sky + clear * (colour - sky) + HALF, ZERO), np.float32(255.0))
