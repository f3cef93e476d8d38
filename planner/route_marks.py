"""A route cut into legs: where each ends, and which distinct place of the map can be seen from there.

After the 2004 paper, section 2: intermediate landmarks are waypoints that the rover can easily identify along its path
and localise itself by. Here a leg ends near a landmark, and can be driven straight at little more than its cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import ndimage

from planner import route_kernels as kernels
from planner.route import CostMap, Place, Route, way_cost
from planner.route_ground import ElevationMap
from worlds.types import FloatArray, Vector3

AROUND_M = 4.0  # a distinct place stands out from the mean of the ground so far about
LEAST_SIGMA = 3.0  # by so many errors of a height ...
LEAST_M = 0.15  # ... and so much
FAR_SHARE = 0.3  # of a landmark's worth, that it has at the farthest range


@dataclass(frozen=True)
class LegModel:
    """How legs are cut."""

    length_m: tuple[float, float] = (10.0, 25.0)
    straight: float = 1.1  # a leg's straight line may cost so much more than the way
    range_m: tuple[float, float] = (3.0, 25.0)  # of a landmark from the leg's end
    eye_m: float = 1.0  # of the camera, above the ground
    pass_m: float = 2.5  # from a leg's end, at which the next leg is begun


@dataclass(frozen=True)
class Landmark:
    """A place that stands out of its surroundings."""

    position_w: Vector3  # its top
    height_m: float  # above the surroundings


@dataclass(frozen=True)
class Leg:
    """A piece of a route."""

    end_w: Place
    length_m: float  # along the way
    cost: float
    landmark: Landmark | None  # seen from its end and from half way; None where nothing stands out


def landmarks(ground: ElevationMap) -> tuple[Landmark, ...]:
    """Distinct places of a map, the highest above their surroundings first."""
    cell = ground.field.resolution_m
    known = np.isfinite(ground.field.heights_m)
    heights = np.where(known, ground.field.heights_m, 0.0)
    sigma = AROUND_M / cell
    weight = np.maximum(ndimage.gaussian_filter(known.astype(np.float64), sigma), 1e-9)
    above = np.where(known, heights - ndimage.gaussian_filter(heights, sigma) / weight, -np.inf)
    enough = np.maximum(LEAST_SIGMA * np.sqrt(ground.variance_m2), LEAST_M)
    peaks = (above == ndimage.maximum_filter(above, 2 * round(0.5 * sigma) + 1)) & (above > enough)
    rows, columns = np.nonzero(peaks)
    order = np.argsort(-above[rows, columns], kind="stable")
    (west, south), found = ground.field.origin_m, []
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        place = west + cell * column, south + cell * row, float(heights[row, column])
        found.append(Landmark(place, float(above[row, column])))
    return tuple(found)


def legs(map_: CostMap, route: Route, marks: tuple[Landmark, ...], model: LegModel | None = None) -> tuple[Leg, ...]:
    """The legs of a route; none for a refusal."""
    model = model or LegModel()
    if len(route.way_w) < 2:
        return ()
    way, arcs = _even(route.way_w, map_.grid.resolution_m)
    tops = np.array([mark.position_w for mark in marks]).reshape(-1, 3)
    found, at = [], 0
    while at < len(way) - 1:
        to, mark = _leg_end(map_, way, arcs, at, marks, tops, model)
        end, cost = way[to], way_cost(map_, way[at : to + 1])
        found.append(Leg((float(end[0]), float(end[1])), float(arcs[to] - arcs[at]), cost, mark))
        at = to
    return tuple(found)


def _even(way_w: FloatArray, step_m: float) -> tuple[FloatArray, FloatArray]:
    """Points of a polyline about a step apart, and how far along it each is; corners are kept."""
    pieces = [way_w[:1]]
    for start, end in pairwise(way_w):
        count = max(1, round(float(np.linalg.norm(end - start)) / step_m))
        pieces.append(start + (end - start) * (np.arange(1, count + 1) / count)[:, None])
    points = np.concatenate(pieces)
    return points, np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _leg_end(
    map_: CostMap,
    way: FloatArray,
    arcs: FloatArray,
    at: int,
    marks: tuple[Landmark, ...],
    tops: FloatArray,
    model: LegModel,
) -> tuple[int, Landmark | None]:
    """Index of the point of the way at which the leg from ``at`` ends, and the landmark there."""
    least, most = (int(np.searchsorted(arcs, arcs[at] + length)) for length in model.length_m)
    last = len(way) - 1
    reachable = [to for to in range(at + 1, min(most, last) + 1) if _as_good(map_, way, at, to, model)]
    if not reachable or reachable[-1] == last:
        to = last if reachable else at + 1
        return to, _best(map_, way, at, to, marks, tops, model)[1]
    choices = [to for to in reachable if to >= least] or reachable[-1:]
    scored = [(*_best(map_, way, at, to, marks, tops, model), to) for to in choices]
    _, mark, to = max(scored, key=lambda item: (item[0], item[2]))
    return to, mark


def _as_good(map_: CostMap, way: FloatArray, at: int, to: int, model: LegModel) -> bool:
    """Whether the straight line costs about what the way does."""
    if to == at + 1:
        return True
    straight, bound = way_cost(map_, way[[at, to]]), way_cost(map_, way[at : to + 1])
    return straight <= model.straight * bound


def _best(
    map_: CostMap,
    way: FloatArray,
    at: int,
    to: int,
    marks: tuple[Landmark, ...],
    tops: FloatArray,
    model: LegModel,
) -> tuple[float, Landmark | None]:
    """The landmark that is worth most at the end of a leg, and its worth: height, less the farther away it is."""
    near, far = model.range_m
    apart = np.linalg.norm(tops[:, :2] - way[to], axis=1)
    worth = np.array([mark.height_m for mark in marks]) * (1.0 - (1.0 - FAR_SHARE) * apart / far)
    worth = np.where((apart >= near) & (apart <= far), worth, 0.0)
    for number in np.argsort(-worth, kind="stable").tolist():
        if worth[number] <= 0.0:
            break
        if all(_seen(map_, way[place], tops[number], model.eye_m) for place in (to, (at + to) // 2)):
            return float(worth[number]), marks[number]
    return 0.0, None


def _seen(map_: CostMap, place: FloatArray, top: FloatArray, eye_m: float) -> bool:
    """Whether a landmark's top is in sight of a camera over a place, as the map has it."""
    (ax, ay), (bx, by) = map_.cells(np.array([place, top[:2]]))
    heights = map_.ground.field.heights_m
    row, column = (int(np.clip(round(value), 0, size - 1)) for value, size in zip((ay, ax), heights.shape, strict=True))
    return bool(kernels.sees(heights, ax, ay, heights[row, column] + eye_m, bx, by, top[2]))
