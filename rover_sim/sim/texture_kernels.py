"""Compiled samplers of the textures: bilinear or trilinear within a level, blended between two.

Levels follow Williams, "Pyramidal parametrics", SIGGRAPH 1983. Single precision throughout.

Numba watches a compiled function's own file only: after a change here save `shade_kernels` anew, or its stored machine
code still holds the old samplers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Texels = NDArray[np.float32]  # (texels of all levels, 4)
Texel = tuple[Any, Any, Any, Any]  # four of type float32
Vector = tuple[float, float, float]
SHARPNESS = 0.8  # a level as large as the pixel itself blurs more than the pixel's own average would
BLEND_FROM = 0.3  # levels are blended over the middle of the way from one to the next
ZERO, ONE = np.float32(0.0), np.float32(1.0)


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _plane_texel(t: Texels, top: int, per_m: float, level: int, x_m: float, y_m: float) -> Texel:
    """Bilinear sample of one level of a square texture."""
    size = max(top >> level, 1)
    u, v = x_m * per_m * size - 0.5, y_m * per_m * size - 0.5
    fu, fv = np.floor(u), np.floor(v)
    wu, wv = np.float32(u - fu), np.float32(v - fv)
    ou, ov = ONE - wu, ONE - wv
    j0, i0 = int(fu) & (size - 1), int(fv) & (size - 1)
    j1, i1 = (j0 + 1) & (size - 1), (i0 + 1) & (size - 1)
    first = (top * top - size * size) // 3 * 4  # the sum of all larger levels
    row0, row1 = first + i0 * size, first + i1 * size
    # Unsigned: the compiler then leaves out the test for negative indices.
    a, b, c, d = np.uintp(row0 + j0), np.uintp(row0 + j1), np.uintp(row1 + j0), np.uintp(row1 + j1)
    wa, wb, wc, wd = ou * ov, wu * ov, ou * wv, wu * wv
    return (
        wa * t[a, 0] + wb * t[b, 0] + wc * t[c, 0] + wd * t[d, 0],
        wa * t[a, 1] + wb * t[b, 1] + wc * t[c, 1] + wd * t[d, 1],
        wa * t[a, 2] + wb * t[b, 2] + wc * t[c, 2] + wd * t[d, 2],
        wa * t[a, 3] + wb * t[b, 3] + wc * t[c, 3] + wd * t[d, 3],
    )


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _mix(a: Texel, b: Texel, share: Any) -> Texel:
    """``a`` at share 0, ``b`` at share 1."""
    keep = ONE - share
    return (
        a[0] * keep + b[0] * share,
        a[1] * keep + b[1] * share,
        a[2] * keep + b[2] * share,
        a[3] * keep + b[3] * share,
    )


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _level(top: int, per_m: float, footprint_m: float) -> float:
    """Fractional level whose texel is as large as a pixel's footprint."""
    mantissa, exponent = math.frexp(max(footprint_m * top * per_m, 1.0))
    # The logarithm, straight between powers of two: right at both ends and five times faster.
    return exponent + 2.0 * mantissa - 2.0


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _split(lod: float) -> tuple[int, Any]:
    """A level, and the share of the next one; most pixels need one level only, and no seam is left between."""
    level = int(lod)
    share = (lod - level - BLEND_FROM) / (1.0 - 2.0 * BLEND_FROM)
    if share >= 1.0:
        return level + 1, ZERO
    return level, np.float32(max(share, 0.0))


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def sample_plane(t: Texels, top: int, per_m: float, x_m: float, y_m: float, footprint_m: float) -> Texel:
    """Square texture, blended between the two nearest levels."""
    level, share = _split(_level(top, per_m, footprint_m))
    if share == ZERO:
        return _plane_texel(t, top, per_m, level, x_m, y_m)
    return _mix(
        _plane_texel(t, top, per_m, level, x_m, y_m),
        _plane_texel(t, top, per_m, level + 1, x_m, y_m),
        share,
    )


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def sample_strip(
    t: Texels, top: int, per_m: float, point: Vector, ray: Vector, minor_m: float, major_m: float
) -> Texel:
    """Mean of a square texture over the strip of ground that a pixel covers.

    Far away that strip is many times longer than wide: a few samples along it neither glitter nor blur.
    """
    taps = min(max(int(0.4 * major_m / minor_m), 1), 4)
    level = np.sqrt(ray[0] * ray[0] + ray[1] * ray[1]) + 1e-9
    step_x, step_y = ray[0] / level * major_m / taps, ray[1] / level * major_m / taps
    footprint = SHARPNESS * max(minor_m, major_m / taps * 0.7)
    t0, t1, t2, t3 = ZERO, ZERO, ZERO, ZERO
    for tap in range(taps):
        at = tap - 0.5 * (taps - 1)
        texel = sample_plane(t, top, per_m, point[0] + at * step_x, point[1] + at * step_y, footprint)
        t0, t1, t2, t3 = t0 + texel[0], t1 + texel[1], t2 + texel[2], t3 + texel[3]
    share = ONE / np.float32(taps)
    return t0 * share, t1 * share, t2 * share, t3 * share


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _solid_texel(t: Texels, top: int, per_m: float, level: int, x_m: float, y_m: float, z_m: float) -> Texel:
    """Trilinear sample of one level of a cubic texture."""
    size = max(top >> level, 1)
    first = (top**3 - size**3) // 7 * 8
    scale = size * per_m
    u, v, w = x_m * scale - 0.5, y_m * scale - 0.5, z_m * scale - 0.5
    fu, fv, fw = np.floor(u), np.floor(v), np.floor(w)
    wu, wv, ww = np.float32(u - fu), np.float32(v - fv), np.float32(w - fw)
    j, i, k = int(fu), int(fv), int(fw)
    r0, r1, r2, r3 = ZERO, ZERO, ZERO, ZERO
    for corner in range(8):
        dj, di, dk = corner & 1, (corner >> 1) & 1, corner >> 2
        weight = (wu if dj else ONE - wu) * (wv if di else ONE - wv) * (ww if dk else ONE - ww)
        at = ((((k + dk) & (size - 1)) * size) + ((i + di) & (size - 1))) * size + ((j + dj) & (size - 1))
        texel = np.uintp(first + at)
        r0 += weight * t[texel, 0]
        r1 += weight * t[texel, 1]
        r2 += weight * t[texel, 2]
        r3 += weight * t[texel, 3]
    return r0, r1, r2, r3


@njit(cache=True, nogil=True, fastmath=True)
def sample_solid(t: Texels, top: int, per_m: float, x_m: float, y_m: float, z_m: float, footprint_m: float) -> Texel:
    """Cubic texture, blended between the two nearest levels."""
    level, share = _split(_level(top, per_m, footprint_m))
    if share == ZERO:
        return _solid_texel(t, top, per_m, level, x_m, y_m, z_m)
    return _mix(
        _solid_texel(t, top, per_m, level, x_m, y_m, z_m),
        _solid_texel(t, top, per_m, level + 1, x_m, y_m, z_m),
        share,
    )
