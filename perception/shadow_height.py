"""Heights of rocks from the shadows that they cast on the ground, where the direction of the sun is known.

A shadow is followed from the rock away from the sun along parallel lines on the believed plane, as long as the ground
is dark; the farthest line tells how far the tip of the shadow lies from the middle of the base. With the half depth a
of the base in that direction the half ellipsoid of height b throws its shadow out to T, T^2 = a^2 + (b cot e)^2 at the
sun's elevation e; rocks are more pointed, so a counts with a share. Where the top of a real rock stands over its base
nobody knows, which makes most of the error of T, and low suns tell heights best.
"""

from __future__ import annotations

import numba
import numpy as np
from msgspec import structs

from perception.camera import project
from perception.rock_placement import View
from worlds.types import ByteArray, FloatArray, IntArray, PerceivedRock

_LEAST_PX = 30  # area of a blob whose shadow is looked for
_LOWEST_SUN = np.sin(np.deg2rad(4.0))  # sine over the plane: shadows of a lower one end nowhere
_ACROSS = np.linspace(-0.9, 0.9, 11)  # places of the lines over half the breadth that the sun sees
_STEPS = 32  # of a line
_HIGHEST, _BEYOND = 0.7, 1.1  # a line reaches beyond the shadow of a rock as high as that share of its size
_BASE_SHARE = 0.7  # of a that counts
_APEX_SD, _EDGE_SD_PX = 0.4, 1.5  # error of T: share of a, and pixels
_LEAST_LINES = 3  # that show a shadow
_LEAST_SUN = 0.7  # on a face towards it, over the light of the sky: what a shadow lacks
_LEAST_PARTED = 0.7  # of the variance of grey levels that two classes must explain
_BINS = 32  # of grey levels
_GAP = 2  # lit samples, on pebbles or noise, that do not end a shadow


def with_shadows(
    placed: list[PerceivedRock | None],
    area_px: IntArray,
    labels: IntArray,
    grey: ByteArray,
    view: View,
    scale: tuple[float, float],
) -> list[PerceivedRock | None]:
    """The placed rocks, one a blob, with heights averaged by variance with those that their shadows tell.

    ``labels`` and ``grey`` (H, W) are of the working picture, of which ``scale`` makes the camera's pixels. A rock
    without a clear shadow in sight, or cut by the border, keeps its height; all do where the sun stands too low.
    """
    which = [i for i, rock in enumerate(placed) if rock is not None and not rock.cut and area_px[i] >= _LEAST_PX]
    rocks = [rock for i in which if (rock := placed[i]) is not None]
    if view.to_sun_w is None or not rocks:
        return placed
    height, sd = shadow_heights(rocks, np.array(which) + 1, labels, grey, view, scale)
    answer = list(placed)
    for i, rock, measured, off in zip(which, rocks, height.tolist(), sd.tolist(), strict=True):
        if np.isfinite(off):
            trust = rock.height_sd_m**2 / (rock.height_sd_m**2 + off**2)
            height = rock.height_m + trust * (measured - rock.height_m)
            answer[i] = structs.replace(rock, height_m=height, height_sd_m=float(np.sqrt(trust)) * off)
    return answer


def shadow_heights(
    rocks: list[PerceivedRock],
    ids: IntArray,
    labels: IntArray,
    grey: ByteArray,
    view: View,
    scale: tuple[float, float],
) -> tuple[FloatArray, FloatArray]:
    """Height (R,) of ``rocks`` in metres by their shadows and one sigma of each, inf where none is seen."""
    normal, to_sun = view.plane.normal_w, np.asarray(view.to_sun_w)
    sine = float(to_sun @ normal)
    nothing = np.zeros(len(rocks)), np.full(len(rocks), np.inf)
    if sine < _LOWEST_SUN:
        return nothing
    level = to_sun - sine * normal
    cot = float(np.linalg.norm(level)) / sine
    if cot < 1e-6:
        return nothing
    away = -level / np.linalg.norm(level)
    base = np.array([(rock.length_m, rock.width_m, rock.yaw_rad) for rock in rocks])
    across_w = np.cross(normal, away)
    deep, broad = _half_extent(base, away), _half_extent(base, across_w)
    reach = _BEYOND * np.hypot(deep, _HIGHEST * np.sqrt(base[:, 0] * base[:, 1]) * cot)
    start = np.array([rock.position_w for rock in rocks])[:, None] + (_ACROSS * broad[:, None])[..., None] * across_w
    ends = np.stack([start, start + reach[:, None, None] * away], axis=2)
    pixels, depth = project(view.camera, view.pose, ends)
    share, lines, contrast = _tips(labels, grey, ids, pixels / np.array(scale), depth, deep / reach)
    seen = (lines >= _LEAST_LINES) & (contrast >= _LEAST_SUN * sine / (1.0 + _LEAST_SUN * sine))
    middle = len(_ACROSS) // 2
    pixel_m = reach / np.linalg.norm((pixels[:, middle, 1] - pixels[:, middle, 0]) / np.array(scale), axis=-1)
    tip = np.maximum(share * reach, 1e-6)
    lift = np.sqrt(np.maximum(tip**2 - (_BASE_SHARE * deep) ** 2, (0.1 * tip) ** 2))
    sd = np.hypot(_APEX_SD * deep, _EDGE_SD_PX * pixel_m) * tip / lift / cot
    return lift / cot, np.where(seen, sd, np.inf)


def _half_extent(base: FloatArray, direction_w: FloatArray) -> FloatArray:
    """Half extent (R,) in a direction of ellipses given by length, width and yaw (R, 3)."""
    along = np.cos(base[:, 2]) * direction_w[0] + np.sin(base[:, 2]) * direction_w[1]
    return np.asarray(np.sqrt((base[:, 0] * along) ** 2 + base[:, 1] ** 2 * np.maximum(1.0 - along**2, 0.0)) / 2.0)


@numba.njit(cache=True)
def _tips(
    labels: IntArray, grey: ByteArray, ids: IntArray, ends_px: FloatArray, depth_m: FloatArray, deep: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Where the shadow of each rock ends (R,), as a share of its lines; lines (R,) that show it; its contrast (R,).

    ``ends_px`` (R, L, 2, 2) are the ends of the lines, ``depth_m`` (R, L, 2) their depths.
    """
    count, across = ends_px.shape[:2]
    tip, lines, contrast = np.zeros(count), np.zeros(count, dtype=np.int32), np.zeros(count)
    level = np.zeros((across, _STEPS), dtype=np.int32)
    owner = np.zeros((across, _STEPS), dtype=np.int32)
    for rock in range(count):
        _sample(labels, grey, ends_px[rock], depth_m[rock], level, owner)
        border, contrast[rock] = _border_level(level, owner)
        if border <= 0.0:
            continue
        for line in range(across):
            end = _dark_end(level[line], owner[line], ids[rock], border, int(deep[rock] * (_STEPS - 1)))
            if end > 0:
                lines[rock] += 1
                tip[rock] = max(tip[rock], (end + 0.5) / (_STEPS - 1.0))
    return tip, lines, contrast


@numba.njit(cache=True)
def _sample(
    labels: IntArray, grey: ByteArray, ends_px: FloatArray, depth_m: FloatArray, level: IntArray, owner: IntArray
) -> None:
    """Grey level and label (L, S) at equal steps on the ground; label -1 outside of the picture."""
    for line in range(level.shape[0]):
        for step in range(_STEPS):
            share = step / (_STEPS - 1.0)
            near, far = (1.0 - share) * depth_m[line, 0], share * depth_m[line, 1]
            x = (near * ends_px[line, 0, 0] + far * ends_px[line, 1, 0]) / (near + far)
            y = (near * ends_px[line, 0, 1] + far * ends_px[line, 1, 1]) / (near + far)
            owner[line, step] = -1
            if depth_m[line, 1] > 0.0 and 0.0 <= x < labels.shape[1] and 0.0 <= y < labels.shape[0]:
                owner[line, step] = labels[int(y), int(x)]
                level[line, step] = grey[int(y), int(x)]


@numba.njit(cache=True)
def _border_level(level: IntArray, owner: IntArray) -> tuple[float, float]:
    """Grey level half-way between dark and lit ground (Otsu's two classes) and their contrast; 0 without both."""
    histogram = np.zeros(_BINS)
    width = 256 // _BINS
    for line in range(level.shape[0]):
        for step in range(_STEPS):
            if owner[line, step] == 0:
                histogram[level[line, step] // width] += 1.0
    total, moment, square = 0.0, 0.0, 0.0
    for i in range(_BINS):
        total += histogram[i]
        moment += histogram[i] * (i + 0.5) * width
        square += histogram[i] * ((i + 0.5) * width) ** 2
    best, dark, lit, below, below_moment = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(_BINS - 1):
        below += histogram[i]
        below_moment += histogram[i] * (i + 0.5) * width
        if below > 0.0 and total > below:
            low, high = below_moment / below, (moment - below_moment) / (total - below)
            if below * (total - below) * (high - low) ** 2 > best:
                best, dark, lit = below * (total - below) * (high - low) ** 2, low, high
    if best <= _LEAST_PARTED * (total * square - moment * moment):
        return 0.0, 0.0
    return (dark + lit) / 2.0, 1.0 - dark / lit


@numba.njit(cache=True)
def _dark_end(level: IntArray, owner: IntArray, label: int, border: float, edge: int) -> int:
    """Last dark step of a line after it leaves its rock, at least two of them; 0 for none, or with no end in sight."""
    first = edge
    for step in range(_STEPS):
        if owner[step] == label:
            first = step + 1
    last, gap = -1, 0
    for step in range(first, _STEPS):
        if owner[step] != 0:
            return 0
        if level[step] <= border:
            last, gap = step, 0
        else:
            gap += 1
            if gap > _GAP:
                return last if last > first else 0
    return 0
