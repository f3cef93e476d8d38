"""Remembered rocks as obstacles: which are hard, how wide a berth they get, and the hilly field of the 2004 paper.

The paper (section 3) gives each obstacle centre a weight and convolves the map, which makes a hilly field. Here the
convolution is carried out sparsely: each obstacle adds its weight times the kernel around itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import ndtr

from planner.map_kernels import Layer, bring_in, least_clearance, narrowed, rasterise, within
from planner.memory_kernels import touching
from planner.terrain_map import RockMemory
from worlds.types import BoolArray, FloatArray, Footprint

MAX_CLEARANCE_M = 1.2  # farther rocks do not matter to a cell
NO_OBSTACLES = np.zeros((0, 7))
FENCE_PIECE_M = 1.0
HEIGHT_OVER_WIDTH = 0.4  # of a rock whose height nobody saw
Area = tuple[tuple[float, float], tuple[float, float]]  # limits of x and of y in the world, metres


@dataclass(frozen=True)
class DriveModel:
    """What counts as an obstacle and what berth it gets."""

    margin_m: float = 0.11  # beyond half the width; covers path following and the corners in a curve
    squeeze_margin_m: float = 0.05  # when nothing else leads on
    comfort_m: float = 0.35  # beyond the margin, nearness still costs
    belly_share: float = 1.15  # of the climb height: the belly meets higher rocks
    flank_share: float = 1.25  # and wheels may pass over the flank of lower ones
    hangs_m: float = 0.0  # one sigma of how low it hangs: wheels sink in and climb, and its end behind them sags
    lifted_m: float = 0.0  # by which uneven ground under the belly rises, in the mean and in one sigma
    misplaced: float = 5.0  # times that, rocks on uneven ground are farther from their place than told
    height_error: float = 1.5  # over the stated one: rocks that are steeper than most fool every view alike
    most_doubt: float = 0.135  # a rock that the belly would meet with a higher probability is hard ...
    squeeze_doubt: float = 0.0  # up to this a narrow way may lead over it where it is near
    undecided: float = 1.35  # ... times or over which a rock stays what it was judged: each change makes a new way
    far_doubt: float = 0.5  # the same of a rock farther off than far_m: a nearer look will tell
    low_weight: float = 0.4  # in the hilly field of a rock as high as wheels climb; of lower ones by the square
    doubt_weight: float = 30.0  # in the hilly field, times the odds that the belly meets a low rock ...
    far_weight: float = 30.0  # ... and times the probability of a far one: a nearer look will tell
    sure_certainty: float = 0.35  # rocks less likely than this only cost
    touching: float = 1.1  # two rocks nearer than the sum of their radii times this are pieces of one; 0: none are
    sd_share: float = 0.5  # of a rock's position error added to its berth
    most_sd_m: float = 0.10  # at most: a gap that looks closed from afar may open near by
    sure_sd_m: float = 0.30  # a rock whose place is less certain only costs: a nearer look will place it
    sure_far_sd_m: float = 0.15  # the same farther off than ...
    far_m: float = 1.5  # ... this, as the camera will see it again before it is reached
    doubt_gap_m: float = 0.12  # by which a far gap may seem too narrow and still be worth a look ...
    doubt_range_m: tuple[float, float] = (1.5, 3.5)  # ... none of it nearer than the first, all beyond the second
    unsure_weight: float = 4.0  # times the weight of a hard rock, for a high one that only costs

    def doubt_m(self, away_m: FloatArray) -> FloatArray:
        """By how much gaps that are so far away may seem too narrow, metres."""
        near, far = self.doubt_range_m
        doubt: FloatArray = self.doubt_gap_m * np.clip((away_m - near) / (far - near), 0.0, 1.0)
        return doubt

    def doubt_price(self, doubt: FloatArray) -> FloatArray:
        """Weight in the hilly field of rocks that the belly meets with probabilities ``doubt``: by their odds."""
        price: FloatArray = self.doubt_weight * doubt / np.maximum(1.0 - doubt, 0.1)
        return price

    def need_m(self, footprint: Footprint, *, squeeze: bool = False) -> float:
        """Distance that the rover's centre line keeps from the edge of a hard rock."""
        return footprint.width_m / 2.0 + (self.squeeze_margin_m if squeeze else self.margin_m)


# Two eyes measure how high a piece is; one takes the height from the breadth, and a piece for a low rock. What is
# believed better needs less of a margin elsewhere: more rocks are hard, and low ones, which hold wheels, cost more.
# Heights by two eyes hardly have a bias and err less than stated; those, and how low the belly hangs, are from
# `benchmarks/belly_clearance.py`. Far rocks, as they err most, stay open longer.
STEREO_DRIVE = DriveModel(
    touching=0.0,
    low_weight=1.2,
    belly_share=1.19,
    hangs_m=0.0085,
    height_error=0.8,
    most_doubt=0.015,
    squeeze_doubt=0.05,
    undecided=1.75,
    far_doubt=0.45,
    doubt_weight=1300.0,
)


@dataclass(frozen=True)
class Frame2:
    """A plane frame in the world: x along ``heading_rad``."""

    origin_w: tuple[float, float]
    heading_rad: float

    def to_local(self, points_w: FloatArray) -> FloatArray:
        """Local coordinates of world points (..., 2)."""
        sin, cos = np.sin(self.heading_rad), np.cos(self.heading_rad)
        x, y = points_w[..., 0] - self.origin_w[0], points_w[..., 1] - self.origin_w[1]
        turned: FloatArray = np.empty(np.shape(points_w))
        turned[..., 0], turned[..., 1] = x * cos + y * sin, y * cos - x * sin
        return turned

    def to_world(self, points: FloatArray) -> FloatArray:
        """World coordinates of local points (..., 2)."""
        sin, cos = np.sin(self.heading_rad), np.cos(self.heading_rad)
        x, y = points[..., 0], points[..., 1]
        turned: FloatArray = np.empty(np.shape(points))
        turned[..., 0], turned[..., 1] = x * cos - y * sin + self.origin_w[0], x * sin + y * cos + self.origin_w[1]
        return turned


@dataclass(frozen=True, eq=False)
class ObstacleGrid:
    """Cells ``[ix, iy]`` at ``(x0 + ix * step_x, y0 + iy * step_y)`` of a local frame."""

    x0_m: float
    y0_m: float
    step_x_m: float
    step_y_m: float
    clearance_m: Layer  # (nx, ny) to the edge of the nearest hard rock, at most MAX_CLEARANCE_M
    hill: Layer  # (nx, ny) convolved weights


def obstacles(
    rocks: RockMemory,
    model: DriveModel,
    climb_height_m: float,
    *,
    wheel_width_m: float = 0.0,
    place_w: FloatArray | None = None,
) -> FloatArray:
    """Obstacles (N, 7) in the world: ax, ay, bx, by of the axis segment, its berth radius, weight, 1 if hard.

    A hard rock that a narrow way may lead over has, instead of 1, one less the probability that the belly meets it.

    Rocks that the belly would hardly meet may be driven over and cost by the odds of it. ``place_w`` (2,) is where
    the rover stands: rocks that are far from it, and were never seen from near, must be placed better and be high more
    surely to be hard; None: none counts as far.
    """
    if len(rocks) == 0:
        return NO_OBSTACLES
    half = 0.5 * np.maximum(rocks.length_m - rocks.width_m, 0.0)
    axis = half[:, None] * np.stack([np.cos(rocks.yaw_rad), np.sin(rocks.yaw_rad)], axis=1)
    doubt = belly_meets(rocks, model, climb_height_m)
    far = np.zeros(len(rocks), dtype=bool)
    if place_w is not None:
        # What proved too high from near by stays so for who backs out, or it would be looked at again and again.
        far = (np.hypot(*(rocks.centre_w - place_w).T) > model.far_m) & (rocks.weight < model.far_m**-4)
    high = np.where(far, doubt > model.far_doubt, too_high(rocks, doubt, model))
    sure = _sure(rocks, model, far)
    hard = high & sure
    price = np.where(far, model.far_weight * doubt, model.doubt_price(doubt))
    low = model.low_weight * np.minimum(rocks.height_m / climb_height_m, 1.0) ** 2 + price
    tall = np.clip(rocks.height_m / 0.25, 0.4, 1.0)
    weight = rocks.certainty * np.where(hard, tall, np.where(high, model.unsure_weight * tall, low))
    radius = 0.5 * rocks.width_m + np.where(hard, _berth(rocks, model, climb_height_m, wheel_width_m), 0.0)
    shut = np.where(hard & ~far & (doubt < model.squeeze_doubt), 1.0 - doubt, hard)
    table = np.column_stack([rocks.centre_w - axis, rocks.centre_w + axis, radius, weight, shut])
    return np.vstack([table, _joined(rocks.select(sure & ~hard), model, climb_height_m)])


def passed_by(table: FloatArray, model: DriveModel, *, squeeze: bool) -> FloatArray:
    """Obstacles (N, 7) as a way takes them: a narrow one may lead over what is hardly too high, at its price."""
    if not squeeze:
        return table
    doubtful = (table[:, 6] > 0.5) & (table[:, 6] < 1.0)
    passed = table.copy()
    passed[doubtful, 5] = model.doubt_price(1.0 - table[doubtful, 6])
    passed[doubtful, 6] = 0.0
    return passed


def judged(rocks: RockMemory, model: DriveModel, climb_height_m: float) -> RockMemory:
    """The same rocks, with what they are now: too high for the belly, or low enough."""
    high = too_high(rocks, belly_meets(rocks, model, climb_height_m), model)
    return replace(rocks, judged=np.where(high, 1.0, -1.0))


def too_high(rocks: RockMemory, doubt: FloatArray, model: DriveModel) -> BoolArray:
    """Which rocks (N,) the belly meets too probably; ``doubt`` (N,) as of `belly_meets`."""
    high: BoolArray = doubt > model.most_doubt * model.undecided**-rocks.judged
    return high


def belly_meets(rocks: RockMemory, model: DriveModel, climb_height_m: float) -> FloatArray:
    """Probability (N,) that each rock is so high that the belly meets it."""
    above = model.belly_share * climb_height_m - model.lifted_m - rocks.height_m
    sd = np.sqrt((model.height_error * rocks.height_sd_m) ** 2 + model.hangs_m**2 + model.lifted_m**2)
    return np.asarray(ndtr(-above / np.maximum(sd, 1e-3)))


def _sure(rocks: RockMemory, model: DriveModel, far: BoolArray) -> BoolArray:
    """Which rocks (N,) are certain, and placed well enough for how far they are from the rover."""
    most_sd = np.where(far, model.sure_far_sd_m, model.sure_sd_m)
    sure: BoolArray = (rocks.certainty > model.sure_certainty) & (rocks.worst_sd_m < most_sd)
    return sure


def _berth(rocks: RockMemory, model: DriveModel, climb_height_m: float, wheel_width_m: float) -> FloatArray:
    """What is added to the radius (N,) of hard rocks: some of the error of their place, less a wheel for low ones.

    Low ones must stay outside of the belly, but a wheel can take their flank.
    """
    flat = rocks.height_m + 0.5 * rocks.height_sd_m < model.flank_share * climb_height_m
    error_m = np.minimum(model.sd_share * rocks.sd_m, model.most_sd_m) + model.misplaced * model.lifted_m
    return np.asarray(error_m - np.where(flat, wheel_width_m, 0.0))


def _joined(low: RockMemory, model: DriveModel, climb_height_m: float) -> FloatArray:
    """Hard obstacles (N, 7) of pairs of touching low rocks, where one rock of their joint width would be too high.

    Rocks lie apart; what touches in the belief may be one rock that was seen in pieces.
    """
    radius = 0.25 * (low.length_m + low.width_m)
    first, second = touching(low.centre_w, radius, model.touching, climb_height_m / HEIGHT_OVER_WIDTH).T
    one = np.ones(len(first))
    wide = np.maximum(radius[first], radius[second])
    pairs: FloatArray = np.column_stack([low.centre_w[first], low.centre_w[second], wide, one, one])
    return pairs


def fence(area: Area) -> FloatArray:
    """The limits of an area as hard obstacles (N, 7) without width, in short pieces."""
    (west, east), (south, north) = area
    corners = np.array([[west, south], [east, south], [east, north], [west, north], [west, south]])
    sides = []
    for start, end in pairwise(corners):
        pieces = max(1, round(float(np.abs(end - start).sum()) / FENCE_PIECE_M))
        posts = start + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (end - start)
        sides.append(np.hstack([posts[:-1], posts[1:], np.tile([0.0, 1.0, 1.0], (pieces, 1))]))
    return np.vstack(sides)


def in_frame(table: FloatArray, frame: Frame2) -> FloatArray:
    """The same obstacles in a local frame."""
    moved = table.copy()
    moved[:, 0:2] = frame.to_local(table[:, 0:2])
    moved[:, 2:4] = frame.to_local(table[:, 2:4])
    return moved


def around(table: FloatArray, frame: Frame2, reach_m: float, need_m: float) -> FloatArray:
    """The obstacles within ``reach_m`` of a frame's origin, in that frame, as by `let_leave`."""
    x, y = frame.origin_w
    local: FloatArray = bring_in(np.ascontiguousarray(table), x, y, frame.heading_rad, reach_m, need_m)
    return local


def near(table: FloatArray, place_w: FloatArray, radius_m: float) -> FloatArray:
    """The obstacles whose middle lies within ``radius_m``."""
    x, y = place_w
    close: FloatArray = within(np.ascontiguousarray(table), float(x), float(y), radius_m)
    return close


def let_leave(table: FloatArray, place: FloatArray, need_m: float) -> FloatArray:
    """Obstacles whose berth holds the rover already, narrowed until it stands just outside: it may leave them.

    ``place`` (2,) is in the frame of ``table``. The rover still may not come nearer to them than it is.
    """
    x, y = place
    # A radius below zero is a berth narrower than the rover.
    freed: FloatArray = narrowed(np.ascontiguousarray(table), float(x), float(y), need_m + 0.03)
    return freed


def distance_to(table: FloatArray, place: FloatArray) -> FloatArray:
    """Distance (N,) from a place to the edge of each obstacle's berth radius; negative inside."""
    start, along = table[:, 0:2], table[:, 2:4] - table[:, 0:2]
    squared = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((place - start) * along).sum(axis=1) / squared, 0.0, 1.0)
    reach: FloatArray = np.linalg.norm(start + share[:, None] * along - place, axis=1) - table[:, 4]
    return reach


def segment_clearance(table: FloatArray, path: FloatArray) -> FloatArray:
    """Smallest distance (N - 1,) of each segment of a polyline (N, 2) to the berth radius of a hard obstacle."""
    hard = np.ascontiguousarray(table[table[:, 6] > 0.5])
    clear: FloatArray = least_clearance(hard, np.ascontiguousarray(path, dtype=np.float64), MAX_CLEARANCE_M)
    return clear


def obstacle_grid(
    table: FloatArray, x_limits: tuple[float, float], y_limits: tuple[float, float], shape: tuple[int, int]
) -> ObstacleGrid:
    """Clearance and hilly field of local obstacles on ``shape`` cells between the limits, both included."""
    step_x = (x_limits[1] - x_limits[0]) / max(shape[0] - 1, 1)
    step_y = (y_limits[1] - y_limits[0]) / max(shape[1] - 1, 1)
    clearance = np.full(shape, MAX_CLEARANCE_M, dtype=np.float32)
    hill = np.zeros(shape, dtype=np.float32)
    x0, y0 = float(x_limits[0]), float(y_limits[0])
    rasterise(np.ascontiguousarray(table), x0, y0, step_x, step_y, MAX_CLEARANCE_M, clearance, hill)
    return ObstacleGrid(x0, y0, step_x, step_y, clearance, hill)
