"""Blobs that show several rocks are cut along straight lines, where learned evidence speaks for it.

Each blob is swept by lines in eight directions. What lies on either side of a line, and along it, gives thirteen
measures: do both parts fill an ellipse better than the whole, is the line short, does it run along an edge, a dark
crease or a streak of soil, do the sides differ in hue. The evidence of the measures adds up, in natural logarithms of
odds, as that of rock pixels does (`CueSet`); the line with most wins if it has enough, and both parts are tried again.
Cutting a cluster between its concave places is the classical way (for example Bai, Sun and Zhou, Pattern Recognition
42(11), 2009); here the place of a cut is learned from pictures whose rocks are known, since a small rock in front of
another one rarely leaves two clear concavities.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from perception.blobs import Blobs, measured_blobs
from perception.knowledge_base import PARTING_CUES, Parting
from worlds.types import BoolArray, FloatArray, IntArray

SingleArray = NDArray[np.float32]
Integers = NDArray[np.signedinteger[Any]]
DIRECTIONS = 8
MEASURES = len(PARTING_CUES)
MOST_FILL = 0.92  # what fills its ellipse better is one rock: where every line was tried, none of these had enough
_MOST_PARTS = 8  # of one blob
_PIXEL_VARIANCE = 1.0 / 12.0  # a pixel is a unit square
_NOTHING = np.zeros(6)
_SPREAD_FLOOR = np.array([0.5, 0.2])  # variance of L* and b* that noise alone gives


def part_rocks(blobs: Blobs, lab: SingleArray, score: SingleArray, know: Parting, min_area_px: int) -> Blobs:
    """The blobs, cut where that is likely to part two rocks; parts under ``min_area_px`` are dropped.

    ``lab`` (H, W, 3) is the low-passed picture with even light, ``score`` (H, W) the rock score.
    """
    labels = blobs.labels.copy()
    knots, evidence = _tables(know)
    _part_all(labels, blobs.box_px, lab, score, know.least_px, know.bias - know.threshold, knots, evidence)
    return measured_blobs(labels, min_area_px)


@lru_cache(maxsize=8)
def _tables(know: Parting) -> tuple[FloatArray, FloatArray]:
    """Knots and evidence, each (measures, most knots), short ones continued level; without a cue all zero."""
    most = max((len(cue.value) for _, cue in know.named()), default=2)
    knots = np.tile(np.arange(most, dtype=np.float64), (MEASURES, 1))
    evidence = np.zeros((MEASURES, most))
    for name, cue in know.named():
        row, count = PARTING_CUES.index(name), len(cue.value)
        knots[row] = [*cue.value, *(cue.value[-1] + 1.0 + np.arange(most - count))]
        evidence[row] = [*cue.evidence, *[cue.evidence[-1]] * (most - count)]
    return knots, evidence


@numba.njit(cache=True)
def _part_all(
    labels: IntArray,
    boxes: IntArray,
    lab: SingleArray,
    score: SingleArray,
    least_px: int,
    bias: float,
    knots: FloatArray,
    evidence: FloatArray,
) -> None:
    """Cut the blobs of ``labels`` (H, W) in place; new parts get the next free labels."""
    free = len(boxes) + 1
    for blob in range(len(boxes)):
        box = boxes[blob]
        waiting = [blob + 1]
        parts, first = 1, free
        while len(waiting) > 0 and parts < _MOST_PARTS:
            label = waiting.pop()
            measures, lines = all_cuts(labels, lab, score, label, box, least_px)
            if len(lines) == 0:
                continue
            best, most = _most_likely(measures, knots, evidence)
            if most + bias > 0.0:
                cut(labels, label, box, lines[best], free)
                waiting.append(label)
                waiting.append(free)
                free += 1
                parts += 1
        if parts > 1:
            free = _connected(labels, box, blob + 1, first, free)


def side_of(x: Integers, y: Integers, line: IntArray, box: IntArray) -> BoolArray:
    """Which pixels (N,) of a blob, counted from the corner of its box, lie on the far side of a line."""
    across, down, start = _sweep(line[0], box)
    return np.asarray((x * across + y * down - start).astype(np.int64) >= line[1])


@numba.njit(cache=True)
def _connected(labels: IntArray, box: IntArray, blob: int, first: int, free: int) -> int:
    """Give each 8-connected piece of a blob and of its parts, labelled from ``first`` to ``free``, a label of its own.

    A straight line may cut a crooked blob more than once. The answer is the next free label.
    """
    left, top, right, bottom = box[0], box[1], box[0] + box[2], box[1] + box[3]
    done = free  # labels from here on are of whole pieces
    waiting = np.empty((box[2] * box[3], 2), dtype=np.int32)
    for y in range(top, bottom):
        for x in range(left, right):
            label = labels[y, x]
            if not (label == blob or first <= label < done):
                continue
            waiting[0] = y, x
            labels[y, x] = free
            count = 1
            while count > 0:
                count -= 1
                row, column = waiting[count]
                for near_row in range(max(row - 1, top), min(row + 2, bottom)):
                    for near in range(max(column - 1, left), min(column + 2, right)):
                        if labels[near_row, near] == label:
                            labels[near_row, near] = free
                            waiting[count] = near_row, near
                            count += 1
            free += 1
    return free


@numba.njit(cache=True)
def _most_likely(measures: FloatArray, knots: FloatArray, evidence: FloatArray) -> tuple[int, float]:
    """The line with most evidence of all cues, and how much that is."""
    best, most = 0, -np.inf
    for line in range(len(measures)):
        total = 0.0
        for cue in range(measures.shape[1]):
            value, places, high = measures[line, cue], knots[cue], 1
            while high < len(places) - 1 and value > places[high]:
                high += 1
            share = min(max((value - places[high - 1]) / (places[high] - places[high - 1]), 0.0), 1.0)
            total += evidence[cue, high - 1] + share * (evidence[cue, high] - evidence[cue, high - 1])
        if total > most:
            best, most = line, total
    return best, most


@numba.njit(cache=True)
def cut(labels: IntArray, label: int, box: IntArray, line: IntArray, new: int) -> None:
    """Give the far side of a ``line`` of `all_cuts` the label ``new``."""
    across, down, start = _sweep(line[0], box)
    for y in range(box[3]):
        for x in range(box[2]):
            if labels[box[1] + y, box[0] + x] == label and int(x * across + y * down - start) >= line[1]:
                labels[box[1] + y, box[0] + x] = new


@numba.njit(cache=True)
def all_cuts(
    labels: IntArray, lab: SingleArray, score: SingleArray, label: int, box: IntArray, least_px: int
) -> tuple[FloatArray, IntArray]:
    """Measures (N, 13) of all lines that leave ``least_px`` pixels of a blob on either side; and the lines.

    None for a blob that fills its ellipse by more than `MOST_FILL`. A line (N, 2) is a direction and the number of
    steps of one pixel to it.
    """
    most = DIRECTIONS * (box[2] + box[3] + 3)
    measures, lines = np.empty((most, MEASURES)), np.empty((most, 2), dtype=np.int32)
    count = 0
    pixels = _pixels(labels, lab, score, label, box)
    whole = np.zeros(pixels.shape[1])
    for pixel in range(len(pixels)):
        whole += pixels[pixel]
    whole_fill = _fill(whole, _NOTHING) if len(pixels) >= 2 * least_px else np.inf
    if whole_fill > MOST_FILL:
        return measures[:0], lines[:0]
    for direction in range(DIRECTIONS):
        strips, before = _strips(pixels, direction, box), np.zeros(pixels.shape[1])
        down = np.sin(np.pi * direction / DIRECTIONS)
        for line in range(1, len(strips)):
            before += strips[line - 1]
            there = strips[line, 0] > 0.0 and strips[line - 1, 0] > 0.0
            if there and before[0] >= least_px and len(pixels) - before[0] >= least_px:
                _measure(strips, line, before, whole, whole_fill, down, measures[count])
                lines[count] = direction, line
                count += 1
    return measures[:count], lines[:count]


@numba.njit(cache=True)
def _sweep(direction: int, box: IntArray) -> tuple[float, float, float]:
    """Unit normal (right, down) of the lines of a direction, and where its first strip begins."""
    angle = np.pi * direction / DIRECTIONS
    across, down = np.cos(angle), np.sin(angle)
    return across, down, min(0.0, (box[2] - 1) * across)


@numba.njit(cache=True)
def _pixels(labels: IntArray, lab: SingleArray, score: SingleArray, label: int, box: IntArray) -> FloatArray:
    """Terms of the sums of each pixel of a blob: 1, x, y, x^2, y^2, x y, L*, L*^2, b*, b*^2, score."""
    terms = np.empty((box[2] * box[3], 11))
    count = 0
    for y in range(box[3]):
        for x in range(box[2]):
            if labels[box[1] + y, box[0] + x] == label:
                light, blue = lab[box[1] + y, box[0] + x, 0], lab[box[1] + y, box[0] + x, 2]
                term = terms[count]
                term[0], term[1], term[2], term[3], term[4], term[5] = 1.0, x, y, x * x, y * y, x * y
                term[6], term[7], term[8], term[9] = light, light * light, blue, blue * blue
                term[10] = score[box[1] + y, box[0] + x]
                count += 1
    return terms[:count]


@numba.njit(cache=True)
def _strips(pixels: FloatArray, direction: int, box: IntArray) -> FloatArray:
    """Sums of the terms (N, 11) of the pixels over strips one pixel wide."""
    across, down, start = _sweep(direction, box)
    strips = np.zeros((int((box[2] - 1) * abs(across) + (box[3] - 1) * down) + 2, pixels.shape[1]))
    for i in range(len(pixels)):
        strip = strips[int(pixels[i, 1] * across + pixels[i, 2] * down - start)]
        for column in range(pixels.shape[1]):
            strip[column] += pixels[i, column]
    return strips


@numba.njit(cache=True)
def _fill(sums: FloatArray, less: FloatArray) -> float:
    """Area over that of the ellipse with the same second moments: 1 for ellipses, less for what is not convex.

    Of what ``sums`` hold without ``less``, both as in `_strips`.
    """
    count = sums[0] - less[0]
    x, y = (sums[1] - less[1]) / count, (sums[2] - less[2]) / count
    xx, yy = (
        (sums[3] - less[3]) / count - x * x + _PIXEL_VARIANCE,
        (sums[4] - less[4]) / count - y * y + _PIXEL_VARIANCE,
    )
    xy = (sums[5] - less[5]) / count - x * y
    return float(count / (4.0 * np.pi * np.sqrt(max(xx * yy - xy * xy, 1e-9))))


@numba.njit(cache=True)
def _mean(strips: FloatArray, low: int, high: int, column: int) -> float:
    """Mean of a column over the strips from ``low`` to before ``high``."""
    count, total = 0.0, 0.0
    for strip in range(max(low, 0), min(high, len(strips))):
        count += strips[strip, 0]
        total += strips[strip, column]
    return total / count


@numba.njit(cache=True)
def _measure(
    strips: FloatArray,
    line: int,
    before: FloatArray,
    whole: FloatArray,
    whole_fill: float,
    down: float,
    out: FloatArray,
) -> None:
    """The measures of one line between two strips, in the order of `PARTING_CUES`; ``down`` is that of its normal."""
    count, first, second = whole[0], before[0], whole[0] - before[0]
    smaller, weight = min(first, second), first * second / (count * count)
    first_fill, second_fill = _fill(before, _NOTHING), _fill(whole, before)
    near, far = strips[line - 1], strips[line]
    light, other_light = before[6] / first, (whole[6] - before[6]) / second
    blue, other_blue = before[8] / first, (whole[8] - before[8]) / second
    light_spread = whole[7] / count - (whole[6] / count) ** 2 + _SPREAD_FLOOR[0]
    blue_spread = whole[9] / count - (whole[8] / count) ** 2 + _SPREAD_FLOOR[1]
    out[0] = np.log10(smaller)
    out[1] = whole_fill
    out[2] = (first * first_fill + second * second_fill) / count - whole_fill
    out[3] = min(first_fill, second_fill)
    out[4] = min(near[0], far[0]) / np.sqrt(smaller)
    out[5] = (blue - other_blue) ** 2 * weight / blue_spread
    out[6] = abs(_mean(strips, line - 2, line, 8) - _mean(strips, line, line + 2, 8))
    out[7] = down
    out[8] = min(near[10] / near[0], far[10] / far[0]) - whole[10] / count
    out[9] = (light - other_light) * down
    out[10] = abs(blue / max(light, 0.1) - other_blue / max(other_light, 0.1))
    out[11] = abs(_mean(strips, line - 2, line, 6) - _mean(strips, line, line + 2, 6)) / np.sqrt(light_spread)
    out[12] = min(near[6] / near[0], far[6] / far[0]) - min(light, other_light)
