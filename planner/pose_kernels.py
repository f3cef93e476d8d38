"""Compiled inner loops of the pose check: arrays only, no decisions.

Axes of the heading frame: x ahead, y left, z up, origin over the body's. Roll and pitch turn about x and y (pitch
nose down positive), so a body point ``(x, y, z)`` lies over the body's origin at

    X = cos(pitch) x + sin(pitch) (sin(roll) y + cos(roll) z)
    Y = cos(roll) y - sin(roll) z
    Z = -sin(pitch) x + cos(pitch) (sin(roll) y + cos(roll) z)

All heights are taken over a plane ``A X + B Y`` close to the ground, so that what moves all wheels alike drops out of
the bounds. Hubs lie at z = 0: their heights over the plane are a linear function of their place on the body, exactly.
"""

from __future__ import annotations

from math import acos, atan, atan2, ceil, cos, floor, hypot, inf, sin, sqrt, tan

import numba as nb
import numpy as np
from numpy.typing import NDArray

from planner.interval_kernels import Interval, arcsine, cosine, cut, largest, plus, scaled, sine, times
from planner.wheel_kernels import ACROSS, AHEAD, ALONG, APART, HIGH, LEFT, LOW, MIDDLE, Pose, wheel_heights
from worlds.types import FloatArray

Layer = NDArray[np.float32]
Limits = tuple[float, float, float]  # largest tilt, least clearance, least margin
LEAST_PART = 0.02  # rad, of a range of leans that is still halved
WIDEST = 0.8  # rad, of the leans that are searched: farther ones would need a step of half a metre
COARSE_PARTS = (0.35, 0.9)  # rad: wider ones are looked at on cells of two and four times the size
MOST_LOOKS = 1000  # at ranges of leans for one pose


@nb.njit(cache=True)
def bound_poses(
    layers: Layer, grid: FloatArray, poses: FloatArray, body: FloatArray, boxes: FloatArray, limits: Limits,
    out: FloatArray,
) -> None:  # fmt: skip
    """Write for each of ``poses`` (N, 3) roll and pitch from and to, largest tilt, least clearance and least margin.

    ``layers`` (4, ny, nx): height in the middle of each cell, its rise along x and y, and how far the ground may lie
    from that plane. ``grid``: x and y of the corner and the cell size; ``body``: half wheelbase, half track, wheel
    radius, half its width, centre of mass (3); ``boxes`` (B, 5): ends of each hull box along and across, and its
    underside. ``out`` is (N, 8), looks at ranges of leans last; a row without bounds has clearance and margin -inf.
    """
    reach = hypot(body[0] + body[2], body[1] + body[3])  # no point of the body gets farther from its origin
    for box in range(boxes.shape[0]):
        ahead, aside = max(-boxes[box, 0], boxes[box, 1]), max(-boxes[box, 2], boxes[box, 3])
        reach = max(reach, sqrt(ahead * ahead + aside * aside + boxes[box, 4] * boxes[box, 4]))
    around = ceil(reach / grid[2])
    side = 2 * around + 1
    patch, middling, coarse = (
        np.empty((6, side, side)), np.empty((6, (side + 1) // 2, (side + 1) // 2)),
        np.empty((6, (side + 3) // 4, (side + 3) // 4)),
    )  # fmt: skip
    for n in range(poses.shape[0]):
        out[n, :] = -WIDEST, WIDEST, -WIDEST, WIDEST, inf, -inf, -inf, 0.0
        ix, iy = floor((poses[n, 0] - grid[0]) / grid[2]), floor((poses[n, 1] - grid[1]) / grid[2])
        if not (around <= ix < layers.shape[2] - around and around <= iy < layers.shape[1] - around):
            continue
        # From here on in coordinates of the heading's own patch: its corner is (0, 0).
        place = poses[n, 0] - grid[0] - (ix - around) * grid[2], poses[n, 1] - grid[1] - (iy - around) * grid[2]
        pose = place[0], place[1], poses[n, 2]
        part = layers[:, iy - around : iy + around + 1, ix - around : ix + around + 1]
        plane = _plane(part[0], grid[2], pose, body)
        _over_plane(part, grid[2], pose, plane, patch)
        _coarser(patch, middling)
        _coarser(middling, coarse)
        _bound((patch, middling, coarse), grid[2], pose, plane, body, boxes, limits, out[n])


@nb.njit(cache=True)
def _bound(
    patches: tuple[FloatArray, FloatArray, FloatArray], cell: float, pose: Pose, plane: Interval, body: FloatArray,
    boxes: FloatArray, limits: Limits, out: FloatArray,
) -> None:  # fmt: skip
    """Bounds of one pose over all its rests.

    Leans are searched by halves, well beyond what is safe: a part is done when no rest can be in it or when all that
    can be are safe; one that is too small to be halved makes the pose unsafe.
    """
    most, gap, least_margin = limits
    heights, hubs, possible = np.empty((4, 2)), np.empty((4, 4, 2)), np.empty(4, dtype=np.bool_)
    stack = np.empty((64, 4))
    stack[0] = -WIDEST, WIDEST, -WIDEST, WIDEST
    count, looks = 1, 0
    bounds = np.array([inf, -inf, inf, -inf, -inf, inf, inf])
    while count > 0 and looks < MOST_LOOKS:
        count -= 1
        looks += 1
        roll, pitch = (stack[count, 0], stack[count, 1]), (stack[count, 2], stack[count, 3])
        widest = max(roll[1] - roll[0], pitch[1] - pitch[0])
        if widest > COARSE_PARTS[1]:
            wheel_heights(patches[2], 4.0 * cell, pose, plane, body, roll, pitch, heights)
        elif widest > COARSE_PARTS[0]:
            wheel_heights(patches[1], 2.0 * cell, pose, plane, body, roll, pitch, heights)
        else:
            wheel_heights(patches[0], cell, pose, plane, body, roll, pitch, heights)
        _triples(heights, hubs, possible)
        found = _lean(hubs, possible, body, plane, pitch)
        roll, pitch = cut(found[0], roll), cut(found[1], pitch)
        if roll[0] > roll[1] or pitch[0] > pitch[1]:
            continue
        steep = _steepness(roll, pitch, plane)
        if not _can_rest(heights, steep, body):
            continue
        tilt, margin = acos(cos(largest(roll)) * cos(largest(pitch))), _margin(body, roll, pitch)
        clear = -inf
        safe = tilt < most and margin >= least_margin
        if safe:
            clear = _clearance(patches[0], cell, pose, plane, body, boxes, roll, pitch, steep, heights, hubs, possible)
            safe = clear >= gap
        if not safe and max(roll[1] - roll[0], pitch[1] - pitch[0]) > LEAST_PART:
            stack[count], stack[count + 1] = (*roll, *pitch), (*roll, *pitch)
            first = 0 if roll[1] - roll[0] > pitch[1] - pitch[0] else 2
            middle = 0.5 * (stack[count, first] + stack[count, first + 1])
            stack[count, first], stack[count + 1, first + 1] = middle, middle
            count += 2
            continue
        bounds[0], bounds[1] = min(bounds[0], roll[0]), max(bounds[1], roll[1])
        bounds[2], bounds[3] = min(bounds[2], pitch[0]), max(bounds[3], pitch[1])
        bounds[4], bounds[5], bounds[6] = max(bounds[4], tilt), min(bounds[5], clear), min(bounds[6], margin)
        if not safe:
            break
    if count == 0 and bounds[5] < inf:
        out[:7] = bounds
    out[7] = looks


@nb.njit(cache=True)
def _plane(middle: Layer, cell: float, pose: Pose, body: FloatArray) -> Interval:
    """Rise ahead and to the left of the ground under the wheelbase and track, by least squares over its cells."""
    c, s = cos(pose[2]), sin(pose[2])
    rise_x, rise_y, width_x, width_y = 0.0, 0.0, 0.0, 0.0
    level = middle[floor(pose[1] / cell), floor(pose[0] / cell)]
    reach = hypot(body[0] + body[2], body[1])
    for iy in range(floor((pose[1] - reach) / cell), floor((pose[1] + reach) / cell) + 1):
        for ix in range(floor((pose[0] - reach) / cell), floor((pose[0] + reach) / cell) + 1):
            px, py = (ix + 0.5) * cell - pose[0], (iy + 0.5) * cell - pose[1]
            u, v = px * c + py * s, py * c - px * s
            if abs(u) <= body[0] + body[2] and abs(v) <= body[1]:
                rise_x, rise_y = rise_x + u * (middle[iy, ix] - level), rise_y + v * (middle[iy, ix] - level)
                width_x, width_y = width_x + u * u, width_y + v * v
    return rise_x / width_x, rise_y / width_y


@nb.njit(cache=True)
def _over_plane(part: Layer, cell: float, pose: Pose, plane: Interval, patch: FloatArray) -> None:
    """Fill the layers of a patch, all over the plane and in axes of the heading; see the rows' names."""
    c, s = cos(pose[2]), sin(pose[2])
    rise_x, rise_y = plane[0] * c - plane[1] * s, plane[0] * s + plane[1] * c
    for iy in range(patch.shape[1]):
        for ix in range(patch.shape[2]):
            middle = part[0, iy, ix] - rise_x * ((ix + 0.5) * cell - pose[0]) - rise_y * ((iy + 0.5) * cell - pose[1])
            along_x, along_y = part[1, iy, ix] - rise_x, part[2, iy, ix] - rise_y
            spread = part[3, iy, ix] + 0.5 * cell * (abs(along_x) + abs(along_y))
            patch[LOW, iy, ix], patch[HIGH, iy, ix] = middle - spread, middle + spread
            patch[MIDDLE, iy, ix], patch[APART, iy, ix] = middle, part[3, iy, ix]
            patch[AHEAD, iy, ix], patch[LEFT, iy, ix] = along_x * c + along_y * s, along_y * c - along_x * s


@nb.njit(cache=True)
def _coarser(fine: FloatArray, coarse: FloatArray) -> None:
    """Fill the layers of a patch with cells of twice the size, level but for their bounds."""
    coarse[LOW], coarse[HIGH], coarse[AHEAD], coarse[LEFT] = inf, -inf, 0.0, 0.0
    for iy in range(fine.shape[1]):
        for ix in range(fine.shape[2]):
            jy, jx = iy // 2, ix // 2
            coarse[LOW, jy, jx] = min(coarse[LOW, jy, jx], fine[LOW, iy, ix])
            coarse[HIGH, jy, jx] = max(coarse[HIGH, jy, jx], fine[HIGH, iy, ix])
    coarse[MIDDLE] = 0.5 * (coarse[LOW] + coarse[HIGH])
    coarse[APART] = 0.5 * (coarse[HIGH] - coarse[LOW])


@nb.njit(cache=True, inline="always")
def _inside(a: Interval, b: Interval) -> bool:
    return b[0] < a[0] and a[0] <= a[1] and a[1] < b[1]


@nb.njit(cache=True)
def _triples(heights: FloatArray, limits: FloatArray, possible: NDArray[np.bool_]) -> None:
    """For each wheel k that may hang while the others stand: whether it can, and bounds (4, 2) of all four hubs then.

    Four hubs lie in a plane: Z_k = Z_a + Z_b - Z_c, with c across the diagonal from k.
    """
    for k in range(4):
        c = 3 - k
        a, b = (1, 2) if k in (0, 3) else (0, 3)
        limits[k] = heights
        limits[k, k, 0] = max(heights[k, 0], heights[a, 0] + heights[b, 0] - heights[c, 1])
        limits[k, k, 1] = heights[a, 1] + heights[b, 1] - heights[c, 0]
        possible[k] = limits[k, k, 1] >= heights[k, 0]


@nb.njit(cache=True)
def _lean(
    limits: FloatArray, possible: NDArray[np.bool_], body: FloatArray, plane: Interval, pitch: Interval
) -> tuple[Interval, Interval]:
    """Roll and pitch that the wheels' heights allow, if the pitch is within ``pitch``.

    Along a side -sin(pitch) - A cos(pitch) is the rise of the hubs over the plane, across an axle
    sin(roll) (cos(pitch) - A sin(pitch)) - B cos(roll).
    """
    down, up = (inf, -inf), (inf, -inf)  # of the hubs over the plane, per metre: to the front, to the left
    for k in range(4):
        if possible[k]:
            c = 3 - k
            side = (0, 1) if c < 2 else (2, 3)  # wheel c's: both of them stand
            axle = (0, 2) if c in (0, 2) else (1, 3)
            front, rear, left, right = limits[k, side[0]], limits[k, side[1]], limits[k, axle[0]], limits[k, axle[1]]
            length, width = 2.0 * body[0], 2.0 * body[1]
            down = min(down[0], (rear[0] - front[1]) / length), max(down[1], (rear[1] - front[0]) / length)
            up = min(up[0], (left[0] - right[1]) / width), max(up[1], (left[1] - right[0]) / width)
    size, turn = hypot(1.0, plane[0]), -atan(plane[0])
    nose = turn + arcsine(down[0] / size), turn + arcsine(down[1] / size)
    upright = plus(cosine(pitch), scaled(sine(pitch), -plane[0]))
    low, high = inf, -inf
    for share in upright:
        turn, size = atan2(plane[1], share), hypot(plane[1], share)
        low, high = min(low, turn + arcsine(up[0] / size)), max(high, turn + arcsine(up[1] / size))
    return (low, high), nose


@nb.njit(cache=True)
def _clearance(
    patch: FloatArray, cell: float, pose: Pose, plane: Interval, body: FloatArray, boxes: FloatArray, roll: Interval,
    pitch: Interval, steep: tuple[Interval, Interval], heights: FloatArray, hubs: FloatArray,
    possible: NDArray[np.bool_],
) -> float:  # fmt: skip
    """Least gap between the hull's undersides and the ground."""
    c, s = cos(pose[2]), sin(pose[2])
    half = 0.5 * cell * (abs(c) + abs(s))
    sin_roll, sin_pitch, cos_roll, cos_pitch = sine(roll), sine(pitch), cosine(roll), cosine(pitch)
    over_roll, over_pitch = (1.0, 1.0 / cos_roll[0]), (1.0, 1.0 / cos_pitch[0])
    yawed, ahead = times(sin_pitch, sin_roll), times(sin_pitch, cos_roll)
    upright = plus(cos_pitch, scaled(sin_pitch, -plane[0]))
    deep = plus(times(upright, cos_roll), scaled(sin_roll, plane[1]))
    steep_x, steep_y = largest(steep[0]), largest(steep[1])
    clear = inf
    for box in range(boxes.shape[0]):
        rear, front, right, left, under = boxes[box]
        below = scaled(deep, under)[0]
        shift_x, shift_y = scaled(ahead, under), scaled(sin_roll, -under)
        widest = largest(yawed) * max(abs(left), abs(right))
        x = rear - widest + shift_x[0], front + widest + shift_x[1]
        y = right + shift_y[0], left + shift_y[1]
        centre = 0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])
        reach_x, reach_y = 0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0])
        mx, my = pose[0] + centre[0] * c - centre[1] * s, pose[1] + centre[0] * s + centre[1] * c
        wide, tall = reach_x * abs(c) + reach_y * abs(s), reach_x * abs(s) + reach_y * abs(c)
        bottom = inf  # of the whole underside
        for bx_end in (rear, front):
            for by_end in (right, left):
                bottom = min(bottom, _level(heights, hubs, possible, steep, body, bx_end, by_end) + below)
        for iy in range(max(floor((my - tall) / cell), 0), min(floor((my + tall) / cell), patch.shape[1] - 1) + 1):
            for ix in range(max(floor((mx - wide) / cell), 0), min(floor((mx + wide) / cell), patch.shape[2] - 1) + 1):
                if bottom - patch[HIGH, iy, ix] >= clear:
                    continue
                px, py = (ix + 0.5) * cell - pose[0], (iy + 0.5) * cell - pose[1]
                u, v = px * c + py * s, py * c - px * s
                # The part of the underside that may be over this cell.
                by = cut(times((v - half - shift_y[1], v + half - shift_y[0]), over_roll), (right, left))
                if by[0] > by[1]:
                    continue
                aside = times(yawed, by)
                bx = times((u - half - shift_x[1] - aside[1], u + half - shift_x[0] - aside[0]), over_pitch)
                bx = cut(bx, (rear, front))
                if bx[0] > bx[1]:
                    continue
                level = _level(heights, hubs, possible, steep, body, 0.5 * (bx[0] + bx[1]), 0.5 * (by[0] + by[1]))
                level -= 0.5 * (steep_x * (bx[1] - bx[0]) + steep_y * (by[1] - by[0]))
                clear = min(clear, level + below - patch[HIGH, iy, ix])
    return clear


@nb.njit(cache=True)
def _level(
    heights: FloatArray, hubs: FloatArray, possible: NDArray[np.bool_], steep: tuple[Interval, Interval],
    body: FloatArray, x: float, y: float,
) -> float:  # fmt: skip
    """Least height of the hubs' plane at a place on the body: from the hubs together, and from each and the lean."""
    best = _plane_low(hubs, possible, x / body[0], y / body[1])
    for i in range(4):
        rise = scaled(steep[0], x - ALONG[i] * body[0])[0] + scaled(steep[1], y - ACROSS[i] * body[1])[0]
        best = max(best, heights[i, 0] + rise)
    return best


@nb.njit(cache=True)
def _steepness(roll: Interval, pitch: Interval, plane: Interval) -> tuple[Interval, Interval]:
    """Rise of the hubs' plane over the ground's, per metre ahead and to the left on the body."""
    sin_roll, sin_pitch, cos_pitch = sine(roll), sine(pitch), cosine(pitch)
    ahead = plus(sin_pitch, scaled(cos_pitch, plane[0]))
    upright = plus(cos_pitch, scaled(sin_pitch, -plane[0]))
    return (-ahead[1], -ahead[0]), plus(times(upright, sin_roll), scaled(cosine(roll), -plane[1]))


@nb.njit(cache=True)
def _can_rest(heights: FloatArray, steep: tuple[Interval, Interval], body: FloatArray) -> bool:
    """Whether two wheels across a diagonal can stand and the others stand or hang, with the hubs' plane so steep.

    The centre of mass lies over both diagonals, so no rest does with less; with two only, on the breadth of the wheels.
    """
    least = -inf  # height of the body's origin at which every wheel is out of the ground
    most = np.empty(4)  # at which each still stands
    for i in range(4):
        rise = plus(scaled(steep[0], ALONG[i] * body[0]), scaled(steep[1], ACROSS[i] * body[1]))
        least, most[i] = max(least, heights[i, 0] - rise[1]), heights[i, 1] - rise[0]
    return bool(least <= max(min(most[0], most[3]), min(most[1], most[2])))


@nb.njit(cache=True)
def _plane_low(limits: FloatArray, possible: NDArray[np.bool_], s: float, t: float) -> float:
    """Least height of the plane of the hubs at ``(s, t)``, in which the wheels stand at +-1.

    For each set of standing wheels the height follows from any three hubs; all four ways hold, so the highest counts.
    """
    least = inf
    for k in range(4):
        if not possible[k]:
            continue
        best = -inf
        for m in range(4):
            a, b, c = (1, 2, 3 - m) if m in (0, 3) else (0, 3, 3 - m)  # a on m's axle
            if ALONG[a] != ALONG[m]:
                a, b = b, a
            share_a, share_b = 0.5 * (1.0 + s * ALONG[m]), 0.5 * (1.0 + t * ACROSS[m])
            share_c = 1.0 - share_a - share_b
            value = share_a * limits[k, a, 0 if share_a > 0.0 else 1]
            value += share_b * limits[k, b, 0 if share_b > 0.0 else 1]
            value += share_c * limits[k, c, 0 if share_c > 0.0 else 1]
            best = max(best, value)
        least = min(least, best)
    return least


@nb.njit(cache=True)
def _margin(body: FloatArray, roll: Interval, pitch: Interval) -> float:
    """Least angle until the weight acts over a side of the wheels' lowest points."""
    a, b, height = body[0], body[1], body[2] + body[6]
    sides = min(atan2(b + body[5], height) - roll[1], atan2(b - body[5], height) + roll[0])
    flat = cos(largest(roll))
    nose = atan(tan(pitch[1]) / (flat if pitch[1] > 0.0 else 1.0))
    tail = atan(tan(pitch[0]) / (flat if pitch[0] < 0.0 else 1.0))
    ends = min(atan2(a - body[4], height) - nose, atan2(a + body[4], height) + tail)
    return min(sides, ends)
