"""Sky and far ridges of a picture of unknown attitude: everything over the foot of the farthest ground.

Each cell of a coarse picture gets additive evidence for sky or ridge: lightness and colour against the lower half of
the picture, texture, the strongest texture over it in its column, and its row. One line from the left edge to the
right then parts what is over it from the ground, found by dynamic programming: it maximises the summed evidence over
it, and pays for each row that it climbs or falls from column to column (Viterbi, IEEE Trans. Information Theory 13(2),
1967; for skylines Lie, Lin, Lin and Hung, Pattern Recognition Letters 26(2), 2005).
"""

from __future__ import annotations

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from perception.knowledge_base import SKY_CUES, Sky, SkyEvidence
from perception.soil_reference import is_coloured
from worlds.types import BoolArray, FloatArray, IntArray

SingleArray = NDArray[np.float32]
CELL_PX = 4
_LEAST_TEXTURE = 0.02  # in lightness per pixel: noise of 8 bits
_MISSING_GROWN_PX = 7  # the blurred rim of missing data is no picture either
_MISSING_SHARE = 0.7  # a cell with more missing pixels is taken from the one under it
_MOST_EVIDENCE = 8.0  # of one cell, so that none outvotes a whole column


def sky_mask(lab: SingleArray, hidden: BoolArray, know: Sky) -> BoolArray:
    """Sky and ridge (H, W) of a smoothed picture ``lab`` (H, W, 3); ``hidden`` (H, W) marks missing data."""
    evidence_of = know.colour if is_coloured(lab) else know.grey
    cues, missing = sky_cues(lab, hidden)
    evidence = cell_evidence(cues, missing, evidence_of)
    return over_line(wide_skyline(evidence, evidence_of), (lab.shape[0], lab.shape[1]))


def sky_cues(lab: SingleArray, hidden: BoolArray) -> tuple[dict[str, SingleArray], BoolArray]:
    """Measures (rows, columns) of cells of `CELL_PX` by their names in `SkyEvidence`, and which cells are missing."""
    lightness = np.ascontiguousarray(lab[..., 0])
    across = cv2.Sobel(lightness, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(lightness, cv2.CV_32F, 0, 1, scale=0.125)
    seen, share = _seen_share(hidden)
    missing = np.asarray(share < 1.0 - _MISSING_SHARE)
    means = _cells(lab, seen, share, missing)
    gradient = _cells(np.asarray(cv2.magnitude(across, down), dtype=np.float32), seen, share, missing)
    colours = (means[..., 0], means[..., 1], means[..., 2])
    low = slice(gradient.shape[0] // 2, None)
    usual = float(np.median(gradient[low])) + 0.1
    fine, broad = _log_blur(gradient, (5, 3)), _log_blur(gradient, (15, 3))
    ground = np.float32(np.log(usual))
    rows = np.linspace(0.0, 1.0, len(gradient), dtype=np.float32)
    cues = [c - np.float32(np.median(c[low])) for c in colours]
    cues += [fine - ground, np.maximum.accumulate(broad, axis=0) - ground, broad]
    cues.append(np.repeat(rows[:, None], gradient.shape[1], axis=1))
    return dict(zip(SKY_CUES, cues, strict=True)), missing


def cell_evidence(cues: dict[str, SingleArray], missing: BoolArray, know: SkyEvidence) -> FloatArray:
    """Log odds (rows, columns) of sky against ground; 0 where nothing is known."""
    total = np.full(missing.shape, know.bias)
    for name, cue in know.named():
        total += np.interp(cues[name], cue.value, cue.evidence)
    return np.where(missing, 0.0, np.clip(total, -_MOST_EVIDENCE, _MOST_EVIDENCE))


def wide_skyline(evidence: FloatArray, know: SkyEvidence) -> IntArray:
    """The best skyline, or none: what spans but a part of the picture's top is a smooth rock, not the sky."""
    line = skyline(evidence, know.step_cost, know.least)
    return line if (line > 0).mean() >= know.least_width else np.zeros_like(line)


@numba.njit(cache=True)
def skyline(evidence: FloatArray, step_cost: float, least: float) -> IntArray:
    """Cells of sky (columns,) at the top of each column of ``evidence`` (rows, columns).

    A step of one row between neighbouring columns costs ``step_cost``, a column with any sky ``least``.
    """
    rows, columns = evidence.shape
    best = np.zeros(rows + 1)
    back = np.zeros((columns, rows + 1), dtype=np.int32)
    for x in range(columns):
        # The best way in from the left: over one row a time, down and then up.
        came = np.arange(rows + 1)
        for y in range(1, rows + 1):
            if best[y - 1] - step_cost > best[y]:
                best[y], came[y] = best[y - 1] - step_cost, came[y - 1]
        for y in range(rows - 1, -1, -1):
            if best[y + 1] - step_cost > best[y]:
                best[y], came[y] = best[y + 1] - step_cost, came[y + 1]
        total = -least
        for y in range(rows + 1):
            back[x, y] = came[y]
            if y > 0:
                total += evidence[y - 1, x]
                best[y] += total
    line = np.zeros(columns, dtype=np.int32)
    y = int(np.argmax(best))
    for x in range(columns - 1, -1, -1):
        line[x] = y
        y = back[x, y]
    return line


def over_line(line: IntArray, shape: tuple[int, int]) -> BoolArray:
    """Pixels (H, W) over the line of cells, drawn straight between the middles of the cells."""
    middles = (np.arange(len(line)) + 0.5) * shape[1] / len(line)
    rows = np.interp(np.arange(shape[1]) + 0.5, middles, line * float(CELL_PX))
    return np.asarray(np.arange(shape[0])[:, None] + 0.5 < rows)


def _seen_share(hidden: BoolArray) -> tuple[SingleArray | None, SingleArray]:
    """Pixels (H, W) that count, 0 or 1, None where all do, and their share (rows, columns) in each cell."""
    size = (hidden.shape[1] // CELL_PX, hidden.shape[0] // CELL_PX)
    if not hidden.any():
        return None, np.ones(size[::-1], dtype=np.float32)
    grown = cv2.dilate(hidden.view(np.uint8), np.ones((_MISSING_GROWN_PX, _MISSING_GROWN_PX), np.uint8))
    seen = (grown == 0).astype(np.float32)
    return seen, _mean(seen, size)


def _cells(planes: SingleArray, seen: SingleArray | None, share: SingleArray, missing: BoolArray) -> SingleArray:
    """Means of ``planes`` (H, W, ...) over cells by what is seen; missing cells take those of the cell under them."""
    size = (share.shape[1], share.shape[0])
    if seen is None:
        return _mean(planes, size)
    weight, whole = (seen, share) if planes.ndim == 2 else (seen[..., None], share[..., None])
    means = np.divide(_mean(planes * weight, size), np.maximum(whole, 1e-3), dtype=np.float32)
    for row in range(size[1] - 2, -1, -1):
        means[row][missing[row]] = means[row + 1][missing[row]]
    return means


def _mean(values: SingleArray, size: tuple[int, int]) -> SingleArray:
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _log_blur(gradient: SingleArray, size: tuple[int, int]) -> SingleArray:
    blurred = cv2.blur(gradient, size, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(np.log(np.maximum(blurred, np.float32(_LEAST_TEXTURE))), dtype=np.float32)
