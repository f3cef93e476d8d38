"""Blobs that show several rocks are cut along straight lines, where learned evidence speaks for it.

Each blob is swept by lines in eight directions. What lies on either side of a line, and along it, gives sixteen
measures: do both parts fill an ellipse better than the whole, is the line short, does the outline bend in at its ends,
does it run along an edge or a streak of soil, do the sides differ in hue or light. The evidence of the measures adds
up, in natural logarithms of the odds of this line against no cut at all; the line with most wins if all lines together
speak well enough for a cut, and both parts are tried again.
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
from perception.evidence import evidence_table
from perception.knowledge_base import PARTING_CUES, Parting
from worlds.types import BoolArray, FloatArray, IntArray

SingleArray = NDArray[np.float32]
Integers = NDArray[np.signedinteger[Any]]
DIRECTIONS = 8
MEASURES = len(PARTING_CUES)
MOST_FILL = 0.97  # what fills its ellipse better is one rock: of a hundred cuts that gain one, one is lost by this
BEND_REACH_PX = (1, 2, 3, 5)  # on either side of the cut, where the outline is looked at
_MOST_PARTS = 16  # of one blob
_PIXEL_VARIANCE = 1.0 / 12.0  # a pixel is a unit square
_LIGHT_FLOOR = 0.5  # variance of L* that noise alone gives
_BESIDE_PX = 3
_TERMS = 9  # of a pixel: 1, x, y, x^2, y^2, x y, L*, b*, score
_EMPTY = 1e6  # pixels; how far a strip without pixels reaches inwards


def part_rocks(blobs: Blobs, lab: SingleArray, score: SingleArray, know: Parting, min_area_px: int) -> Blobs:
    """The blobs, cut where that is likely to part two rocks; parts under ``min_area_px`` are dropped.

    ``lab`` (H, W, 3) is the low-passed picture with even light, ``score`` (H, W) the rock score.
    """
    labels = blobs.labels.copy()
    _part_all(labels, blobs.box_px, lab, score, know.least_px, know.bias - know.threshold, _tables(know))
    return measured_blobs(labels, min_area_px)


@lru_cache(maxsize=8)
def _tables(know: Parting) -> SingleArray:
    """Sampled evidence of all cues (measures, 2 + samples); of a cue that is not there all zero."""
    named = {name: evidence_table(cue.value, cue.evidence) for name, cue in know.named()}
    nothing = np.zeros_like(evidence_table((0.0, 1.0), (0.0, 0.0)))
    return np.stack([named.get(name, nothing) for name in PARTING_CUES])


@numba.njit(cache=True)
def _part_all(
    labels: IntArray,
    boxes: IntArray,
    lab: SingleArray,
    score: SingleArray,
    least_px: int,
    bias: float,
    tables: SingleArray,
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
            best, odds = _most_likely(measures, tables)
            if odds + bias > 0.0:
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
def _most_likely(measures: FloatArray, tables: SingleArray) -> tuple[int, float]:
    """The line with most evidence of all cues; and the logarithm of the odds of all lines together."""
    best, most, odds, last = 0, -np.inf, 0.0, tables.shape[1] - 3
    for line in range(len(measures)):
        total = 0.0
        for cue in range(MEASURES):
            place = min(max((measures[line, cue] - tables[cue, 0]) * tables[cue, 1], 0.0), last)
            total += tables[cue, 2 + int(place + 0.5)]
        odds += np.exp(total)
        if total > most:
            best, most = line, total
    return best, np.log(odds)


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
    """Measures (N, 16) of all lines that leave ``least_px`` pixels of a blob on either side; and the lines.

    None for a blob that fills its ellipse by more than `MOST_FILL`. A line (N, 2) is a direction and the number of
    steps of one pixel to it.
    """
    most = DIRECTIONS * (box[2] + box[3] + 3)
    measures, lines = np.empty((most, MEASURES)), np.empty((most, 2), dtype=np.int32)
    count = 0
    pixels = _pixels(labels, lab, score, label, box)
    fill, spread = _whole(pixels) if len(pixels) >= 2 * least_px else (np.inf, 0.0)
    if fill > MOST_FILL:
        return measures[:0], lines[:0]
    for direction in range(DIRECTIONS):
        sums, reach = _strips(pixels, direction, box)
        down = np.sin(np.pi * direction / DIRECTIONS)
        for line in range(1, len(reach)):
            first = sums[line, 0]
            there = sums[line - 1, 0] < first < sums[line + 1, 0]
            if there and first >= least_px and len(pixels) - first >= least_px:
                _measure(sums, reach, line, fill, spread, down, measures[count])
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
    """Terms (N, 9) of the sums of each pixel of a blob."""
    terms = np.empty((box[2] * box[3], _TERMS))
    count = 0
    for y in range(box[3]):
        for x in range(box[2]):
            if labels[box[1] + y, box[0] + x] == label:
                term = terms[count]
                term[0], term[1], term[2], term[3], term[4], term[5] = 1.0, x, y, x * x, y * y, x * y
                term[6], term[7] = lab[box[1] + y, box[0] + x, 0], lab[box[1] + y, box[0] + x, 2]
                term[8] = score[box[1] + y, box[0] + x]
                count += 1
    return terms[:count]


@numba.njit(cache=True)
def _whole(pixels: FloatArray) -> tuple[float, float]:
    """Fill of a blob, and the standard deviation of its L*."""
    sums = np.zeros((2, _TERMS))
    for i in range(len(pixels)):
        for term in range(_TERMS):
            sums[1, term] += pixels[i, term]
    squares = np.sum((pixels[:, 6] - sums[1, 6] / len(pixels)) ** 2)
    return _fill(sums, 0, 1), np.sqrt(squares / len(pixels) + _LIGHT_FLOOR)


@numba.njit(cache=True)
def _strips(pixels: FloatArray, direction: int, box: IntArray) -> tuple[FloatArray, FloatArray]:
    """Sums of the terms over all strips, one pixel wide, before each line (N + 1, 9); and where each begins and ends.

    The latter (N, 2) is measured along the lines; a strip without pixels ends before it begins.
    """
    across, down, start = _sweep(direction, box)
    count = int((box[2] - 1) * abs(across) + (box[3] - 1) * down) + 2
    sums, reach = np.zeros((count + 1, _TERMS)), np.empty((count, 2))
    reach[:, 0], reach[:, 1] = _EMPTY, -_EMPTY
    for i in range(len(pixels)):
        x, y = pixels[i, 1], pixels[i, 2]
        strip, along = int(x * across + y * down - start), y * across - x * down
        reach[strip, 0], reach[strip, 1] = min(reach[strip, 0], along), max(reach[strip, 1], along)
        for term in range(_TERMS):
            sums[strip + 1, term] += pixels[i, term]
    for strip in range(count):
        for term in range(_TERMS):
            sums[strip + 1, term] += sums[strip, term]
    return sums, reach


@numba.njit(cache=True)
def _fill(sums: FloatArray, low: int, high: int) -> float:
    """Area over that of the ellipse with the same second moments: 1 for ellipses, less for what is not convex.

    Of the pixels that the ``sums`` (N, 9) hold before ``high`` and not before ``low``.
    """
    count = sums[high, 0] - sums[low, 0]
    x, y = (sums[high, 1] - sums[low, 1]) / count, (sums[high, 2] - sums[low, 2]) / count
    xx = (sums[high, 3] - sums[low, 3]) / count - x * x + _PIXEL_VARIANCE
    yy = (sums[high, 4] - sums[low, 4]) / count - y * y + _PIXEL_VARIANCE
    xy = (sums[high, 5] - sums[low, 5]) / count - x * y
    return float(count / (4.0 * np.pi * np.sqrt(max(xx * yy - xy * xy, 1e-9))))


@numba.njit(cache=True)
def _mean(sums: FloatArray, low: int, high: int, term: int) -> float:
    """Mean of a term over the strips from ``low`` to before ``high``."""
    low, high = max(low, 0), min(high, len(sums) - 1)
    return float((sums[high, term] - sums[low, term]) / (sums[high, 0] - sums[low, 0]))


@numba.njit(cache=True)
def _bends(reach: FloatArray, line: int) -> tuple[float, float]:
    """How far the ends of a cut lie inside the straight lines between the outline on either side of it, pixels."""
    low, high = max(reach[line - 1, 0], reach[line, 0]), min(reach[line - 1, 1], reach[line, 1])
    one, other = -3.0, -3.0
    for away in BEND_REACH_PX:
        i, j = line - 1 - away, line + away
        if i >= 0 and j < len(reach) and reach[i, 1] >= reach[i, 0] and reach[j, 1] >= reach[j, 0]:
            one = max(one, low - (reach[i, 0] + reach[j, 0]) / 2)
            other = max(other, (reach[i, 1] + reach[j, 1]) / 2 - high)
    return max(one, other), min(one, other)


@numba.njit(cache=True)
def _measure(
    sums: FloatArray, reach: FloatArray, line: int, whole_fill: float, spread: float, down: float, out: FloatArray
) -> None:
    """The measures of one line between two strips, in the order of `PARTING_CUES`; ``down`` is that of its normal."""
    end = len(reach)
    count, first = sums[end, 0], sums[line, 0]
    smaller, near, far = min(first, count - first), first - sums[line - 1, 0], sums[line + 1, 0] - first
    first_fill, second_fill = _fill(sums, 0, line), _fill(sums, line, end)
    if 2 * first <= count:
        low, high, beside, beyond, above = 0, line, line, line + _BESIDE_PX, down
    else:
        low, high, beside, beyond, above = line, end, line - _BESIDE_PX, line, -down
    light, other_light = _mean(sums, low, high, 6), _mean(sums, beside, beyond, 6)
    blue, other_blue = _mean(sums, low, high, 7), _mean(sums, beside, beyond, 7)
    score = min(_mean(sums, line - 1, line, 8), _mean(sums, line, line + 1, 8))
    out[0], out[1] = np.log10(count), np.log10(smaller)
    out[2], out[3] = whole_fill, min(first_fill, second_fill)
    out[4] = (first * first_fill + (count - first) * second_fill - count * whole_fill) / smaller
    out[5] = count * (1.0 - whole_fill) / smaller
    out[6] = min(near, far) / np.sqrt(smaller)
    out[7], out[8] = _bends(reach, line)
    out[9], out[10] = down, above
    out[11] = abs(_mean(sums, line - 2, line, 6) - _mean(sums, line, line + 2, 6)) / spread
    out[12] = above * (light - other_light)
    out[13] = abs(blue / max(light, 0.1) - other_blue / max(other_light, 0.1))
    out[14], out[15] = score - sums[end, 8] / count, score - _mean(sums, low, high, 8)
