"""Compiled samplers of the textures: bilinear or trilinear within a level, blended between two.

Levels follow Williams, "Pyramidal parametrics", SIGGRAPH 1983. Single precision throughout. Textures come as their
address: Numba counts references to an array at each call that takes one, which cost more than the sample.

Numba watches a compiled function's own file only: after a change here save `shade_kernels` anew, or its stored machine
code still holds the old samplers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.texel_sums import add_weighed, ahead, weighed
from rover_sim.sim.textures import PADDING
from worlds.types import IntArray

Texels = NDArray[np.float32]  # (texels of all levels, 4)
Single = Any  # of type float32
Texel = tuple[Single, Single, Single, Single]
# Levels are blended over the middle of the way from one to the next, from here on, this many times as fast.
BLEND_FROM, BLEND_RATE = np.float32(0.3), np.float32(2.5)
PER_OCTAVE, OCTAVES = np.float32(2.0**-23), np.float32(127.0)  # of the bits of a number of single precision
AHEAD = 24  # samples on, whose texels are asked for while one is taken
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def level_of(texels: Single, last: Single) -> tuple[Single, Single]:
    """Level for a pixel that covers so many texels of the first, and the share of the next one.

    ``last`` is the number of the last level, one texel.

    Most pixels need one level only, and no seam is left between.
    """
    # The logarithm, straight between powers of two: exponent and fraction as they stand in the number.
    covered = np.float32(max(texels, ONE))
    exact = np.float32(covered.view(np.int32)) * PER_OCTAVE - OCTAVES
    level = min(np.floor(exact), last)
    share = (exact - level - BLEND_FROM) * BLEND_RATE
    beyond = share >= ONE
    return (level + ONE if beyond else level), (ZERO if beyond else max(share, ZERO))


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def add_samples(count: int, jobs: Any, which: IntArray, room: int, t: Texels, starts: IntArray, out: Any) -> None:
    """Add bilinear samples of a square texture to ``out`` (pixels, 4).

    ``jobs`` (4 room,): u and v of each sample in periods, weight, and scratch; ``which`` (6 room,): level, pixel, and
    scratch.
    """
    u, v, weight, fourth = jobs[:room], jobs[room : 2 * room], jobs[2 * room : 3 * room], jobs[3 * room :]
    level, pixel, first = which[:room], which[room : 2 * room], which[2 * room : 3 * room]
    second, third, last = which[3 * room : 4 * room], which[4 * room : 5 * room], which[5 * room :]
    for k in range(count):
        at = np.uintp(k)
        first[at] = starts[np.uintp(level[at])]
    top = np.int32(1 << (starts.size - 3))
    for k in range(count):
        at = np.uintp(k)
        size = max(top >> level[at], np.int32(1))
        scale, mask = np.float32(size), size - np.int32(1)
        p, q = u[at] * scale - HALF, v[at] * scale - HALF
        fp, fq = np.floor(p), np.floor(q)
        j0, i0 = np.int32(fp) & mask, np.int32(fq) & mask
        j1, i1 = (j0 + np.int32(1)) & mask, (i0 + np.int32(1)) & mask
        row0 = first[at] + i0 * (size + np.int32(PADDING))
        row1 = first[at] + i1 * (size + np.int32(PADDING))
        first[at], second[at], third[at], last[at] = row0 + j0, row0 + j1, row1 + j0, row1 + j1
        right = (p - fp) * weight[at]
        left, down = weight[at] - right, q - fq
        up = ONE - down
        u[at], v[at], weight[at], fourth[at] = left * up, right * up, left * down, right * down
    texels, total = t.ctypes.data, out.ctypes.data
    for k in range(count):
        at, later = np.uintp(k), np.uintp(min(k + AHEAD, count - 1))
        ahead(texels, np.intp(first[later]))
        ahead(texels, np.intp(third[later]))
        add_weighed(
            texels,
            np.intp(first[at]),
            np.intp(second[at]),
            np.intp(third[at]),
            np.intp(last[at]),
            u[at],
            v[at],
            weight[at],
            fourth[at],
            total + 16 * np.uintp(pixel[at]),
        )


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _solid_texel(t: int, top: int, first: int, level: int, u: Single, v: Single, w: Single) -> Texel:
    """Trilinear sample of one level of a cubic texture."""
    size = max(top >> level, 1)
    mask, scale = size - 1, np.float32(size)
    u, v, w = u * scale - HALF, v * scale - HALF, w * scale - HALF
    fu, fv, fw = np.floor(u), np.floor(v), np.floor(w)
    wu, wv, ww = u - fu, v - fv, w - fw
    j0, i0, k0 = int(fu) & mask, int(fv) & mask, int(fw) & mask
    j1, i1, k1 = (j0 + 1) & mask, (i0 + 1) & mask, (k0 + 1) & mask
    a, b = first + (k0 * size + i0) * size, first + (k0 * size + i1) * size
    c, d = first + (k1 * size + i0) * size, first + (k1 * size + i1) * size
    ou, ov, ow = ONE - wu, ONE - wv, ONE - ww
    wa, wb, wc, wd = ov * ow, wv * ow, ov * ww, wv * ww
    left = weighed(t, a + j0, b + j0, c + j0, d + j0, ou * wa, ou * wb, ou * wc, ou * wd)
    right = weighed(t, a + j1, b + j1, c + j1, d + j1, wu * wa, wu * wb, wu * wc, wu * wd)
    return left[0] + right[0], left[1] + right[1], left[2] + right[2], left[3] + right[3]


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def sample_solid(t: int, starts: IntArray, u: Single, v: Single, w: Single, texels: Single) -> Texel:
    """Cubic texture at the address ``t``, at a place in periods, blended between the two nearest levels."""
    exact, share = level_of(texels, np.float32(starts.size - 3))
    level, keep = int(exact), ONE - share
    top = 1 << (starts.size - 3)
    a = _solid_texel(t, top, starts[np.uintp(level)], level, u, v, w)
    # Also where nothing of it is wanted: guessing wrong whether it is costs the processor more.
    b = _solid_texel(t, top, starts[np.uintp(level + 1)], level + 1, u, v, w)
    return (
        a[0] * keep + b[0] * share,
        a[1] * keep + b[1] * share,
        a[2] * keep + b[2] * share,
        a[3] * keep + b[3] * share,
    )
