"""How high the hub of a wheel can be that stands on bounded ground: compiled loops, for `planner.pose_kernels`."""

from __future__ import annotations

from math import cos, floor, hypot, inf, sin, sqrt

import numba as nb

from planner.interval_kernels import Interval, cosine, cut, largest, plus, scaled, sine, times
from worlds.types import FloatArray

Pose = tuple[float, float, float]
# Signs of a wheel's place along and across: left front, left rear, right front, right rear.
ALONG = (1.0, -1.0, 1.0, -1.0)
ACROSS = (1.0, 1.0, -1.0, -1.0)
LOW, HIGH, MIDDLE, APART, AHEAD, LEFT = range(6)  # bounds, middle, distance from the cell's plane, its rise


@nb.njit(cache=True)
def wheel_heights(
    patch: FloatArray, cell: float, pose: Pose, plane: Interval, body: FloatArray, roll: Interval,
    pitch: Interval, heights: FloatArray,
) -> None:  # fmt: skip
    """Bounds (4, 2) of the height over the plane of each hub whose wheel stands on the ground.

    A wheel is a cylinder about an axis ``(yawed, ., rise)``, turned level by ``turn``. Its rim lies ``u`` ahead of,
    p = sqrt(r^2 - u^2) below and ``v`` beside the hub, at (u, v + rise p) of it but for slack. The hub stands over the
    ground at its foot by along u + deep p + across v.
    """
    sin_roll, cos_roll = sine(roll), cosine(roll)
    rise, yawed = times(cosine(pitch), sin_roll), times(sine(pitch), sin_roll)
    top = largest(rise)
    level = sqrt(1.0 - top * top)  # least cosine of the axis
    turn = min(largest(yawed) / level, 1.0)
    short = 1.0 - sqrt(1.0 - turn * turn)
    slip_x = body[3] * largest(yawed) + body[2] * (short + turn * top)
    slip_y = body[3] * (1.0 - level * (1.0 - short)) + body[2] * (turn + short * top)
    turned, straight = (-turn, turn), (1.0 - short, 1.0)
    along = plus(scaled(straight, plane[0]), scaled(turned, plane[1]))
    deep = plus((level, 1.0), times(rise, plus(scaled(turned, plane[0]), scaled(straight, plane[1]))))
    across = plus(plus(scaled(yawed, plane[0]), scaled(cos_roll, plane[1])), (-rise[1], -rise[0]))
    for i in range(4):
        x, y = ALONG[i] * body[0], ACROSS[i] * body[1]
        ahead, left = plus(scaled(cosine(pitch), x), scaled(yawed, y)), scaled(cos_roll, y)
        hub = 0.5 * (ahead[0] + ahead[1]), 0.5 * (left[0] + left[1])
        slack = 0.5 * (ahead[1] - ahead[0]) + slip_x, 0.5 * (left[1] - left[0]) + slip_y
        found = _wheel(patch, cell, pose, hub, slack, (body[2], body[3]), rise, (along, deep, across))
        heights[i, 0], heights[i, 1] = found


@nb.njit(cache=True)
def _wheel(
    patch: FloatArray, cell: float, pose: Pose, hub: Interval, slack: Interval, wheel: Interval, rise: Interval,
    over: tuple[Interval, Interval, Interval],
) -> Interval:  # fmt: skip
    """Bounds of the height of one hub."""
    c, s = cos(pose[2]), sin(pose[2])
    x0, y0 = pose[0] + hub[0] * c - hub[1] * s, pose[1] + hub[0] * s + hub[1] * c
    (radius, half_width), (sx, sy), (along, deep, across) = wheel, slack, over
    reach_x, reach_y = radius + sx, half_width + sy + radius * largest(rise)
    wide, tall = reach_x * abs(c) + reach_y * abs(s), reach_x * abs(s) + reach_y * abs(c)
    half = 0.5 * cell * (abs(c) + abs(s))
    middle, spread = 0.5 * (rise[0] + rise[1]), 0.5 * (rise[1] - rise[0])
    # With much slack a rim point may stand on many cells: then only the lowest ones are looked at.
    tried = radius if max(sx, sy + radius * spread) < cell else cell
    least, most = -inf, -inf
    for iy in range(max(floor((y0 - tall) / cell), 0), min(floor((y0 + tall) / cell), patch.shape[1] - 1) + 1):
        for ix in range(max(floor((x0 - wide) / cell), 0), min(floor((x0 + wide) / cell), patch.shape[2] - 1) + 1):
            px, py = (ix + 0.5) * cell - x0, (iy + 0.5) * cell - y0
            u, v = px * c + py * s, py * c - px * s
            # Upper bound: any rim point that may stand anywhere in this cell.
            us = max(u - half - sx, -radius), min(u + half + sx, radius)
            if us[0] > us[1]:
                continue
            near, far = max(us[0], -us[1], 0.0), max(-us[0], us[1])
            aside = times(rise, (sqrt(max(radius * radius - far * far, 0.0)), sqrt(radius * radius - near * near)))
            vs = max(v - half - sy - aside[1], -half_width), min(v + half + sy - aside[0], half_width)
            if vs[0] <= vs[1]:
                highest = patch[HIGH, iy, ix] + _rim_top(us, along, deep[1], radius) + times(vs, across)[1]
                # The ground's own plane and the rim at one and the same place.
                ahead, left = patch[AHEAD, iy, ix], patch[LEFT, iy, ix]
                planar = _rim_top(us, (along[0] + ahead, along[1] + ahead), deep[1], radius) + abs(ahead) * sx
                planar += times(vs, (across[0] + left, across[1] + left))[1] + scaled(aside, left)[1] + abs(left) * sy
                planar += patch[MIDDLE, iy, ix] + patch[APART, iy, ix] - ahead * u - left * v
                most = max(most, min(highest, planar))
            # Lower bound: the rim point that stands nominally in the middle of this cell.
            if abs(u) < tried:
                p = sqrt(radius * radius - u * u)
                aside_v = v - p * middle
                if abs(aside_v) <= min(half_width, tried):
                    ground = _lowest(patch, cell, (x0 + px, y0 + py), (c, s), (sx, sy + p * spread))
                    least = max(least, ground + scaled(along, u)[0] + deep[0] * p + scaled(across, aside_v)[0])
    return least, most


@nb.njit(cache=True, inline="always")
def _rim_top(us: Interval, slope: Interval, deep: float, radius: float) -> float:
    """Largest ``slope u + deep sqrt(radius^2 - u^2)`` for ``us`` and any of ``slope``."""
    most = -inf
    for rise in slope:
        u = min(max(radius * rise / hypot(rise, deep), us[0]), us[1])
        most = max(most, rise * u + deep * sqrt(radius * radius - u * u))
    return most


@nb.njit(cache=True)
def _lowest(patch: FloatArray, cell: float, place: Interval, heading: Interval, slack: Interval) -> float:
    """Lowest ground within ``slack`` of a place, along and across the heading (its cosine and sine)."""
    (x, y), (c, s) = place, heading
    wide, tall = slack[0] * abs(c) + slack[1] * abs(s), slack[0] * abs(s) + slack[1] * abs(c)
    half = 0.5 * cell * (abs(c) + abs(s))
    least = inf
    for iy in range(max(floor((y - tall) / cell), 0), min(floor((y + tall) / cell), patch.shape[1] - 1) + 1):
        for ix in range(max(floor((x - wide) / cell), 0), min(floor((x + wide) / cell), patch.shape[2] - 1) + 1):
            px, py = (ix + 0.5) * cell - x, (iy + 0.5) * cell - y
            u, v = px * c + py * s, py * c - px * s
            du, dv = (
                cut((-slack[0] - u, slack[0] - u), (-half, half)),
                cut((-slack[1] - v, slack[1] - v), (-half, half)),
            )
            planar = scaled(du, patch[AHEAD, iy, ix])[0] + scaled(dv, patch[LEFT, iy, ix])[0]
            least = min(least, max(patch[LOW, iy, ix], patch[MIDDLE, iy, ix] - patch[APART, iy, ix] + planar))
    return least
