"""What the rover remembers of the ground: rocks fused over many frames, and which cells it has seen.

A rock is an upright capsule on the ground: a segment along its principal axis, widened by its half width. Its place has
a 2 x 2 covariance, long along the line of sight of a distant view, so that a nearer view moves it; its existence is
a log-odds that grows when it is seen again and falls when it should have been seen and was not.
Association: nearest neighbour inside a chi-square gate (Bar-Shalom and Fortmann, "Tracking and Data Association",
1988); existence: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), chapter 9, per rock instead of per cell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planner import memory_kernels as kernels
from planner.ground_cells import GroundCells, Index, View, camera_view, empty_cells, inside_polygon, recentre, take_in
from planner.laser_map import LaserMap, empty_laser_map, mark_free, note_scan
from worlds.types import BoolArray, FloatArray, Observation, PerceivedRock, PoseEstimate, RangeScan, Vector3

SIZE_SLACK = 0.15  # of a rock's size, that two outlines of it may lie apart
MOST_SHIFT_M = 1.5


@dataclass(frozen=True, eq=False)
class RockMemory:
    """N remembered rocks, one array an attribute."""

    centre_w: FloatArray  # (N, 2)
    covariance: FloatArray  # (N, 2, 2) of the centre, m^2
    length_m: FloatArray  # (N,)
    width_m: FloatArray  # (N,)
    height_m: FloatArray  # (N,)
    height_sd_m: FloatArray  # (N,) one sigma of the height
    yaw_rad: FloatArray  # (N,) of the principal axis
    weight: FloatArray  # (N,) of the sizes so far: sum of 1 / range^4, 1/m^4
    log_odds: FloatArray  # (N,) of being there
    seen_s: FloatArray  # (N,) time of the last view
    judged: FloatArray  # (N,) when last judged: 1 too high for the belly, -1 low enough; 0 not judged yet

    def __len__(self) -> int:
        return len(self.log_odds)

    @property
    def certainty(self) -> FloatArray:
        """Probability (N,) that the rock is there."""
        return 1.0 / (1.0 + np.exp(-self.log_odds))

    @property
    def sd_m(self) -> FloatArray:
        """Mean one-sigma position error (N,)."""
        return np.sqrt(0.5 * (self.covariance[:, 0, 0] + self.covariance[:, 1, 1]))

    @property
    def worst_sd_m(self) -> FloatArray:
        """One-sigma position error (N,) along the worst direction."""
        half = 0.5 * (self.covariance[:, 0, 0] + self.covariance[:, 1, 1])
        apart = 0.5 * (self.covariance[:, 0, 0] - self.covariance[:, 1, 1])
        return np.asarray(np.sqrt(half + np.hypot(apart, self.covariance[:, 0, 1])))

    def select(self, index: Index | BoolArray | slice) -> RockMemory:
        """The rocks of a mask, of indices or of a slice."""
        if isinstance(index, np.ndarray) and index.dtype == bool:
            index = np.flatnonzero(index)  # once instead of for each column
        return RockMemory(*(column[index] for column in self.columns))

    @property
    def columns(self) -> tuple[FloatArray, ...]:
        """The arrays, in order."""
        return tuple(vars(self).values())


@dataclass(frozen=True)
class MemoryModel:
    """How evidence is weighed."""

    gate: float = 9.2  # chi-square of two degrees of freedom, 99 %
    lateral_sd_ratio: float = 0.02  # of the range: across the line of sight the error is small
    least_sd_m: float = 0.04
    seen_gain: float = 1.0  # log-odds of a view with certainty 1
    cut_weight: float = 0.0005  # of a view that runs out of the picture ...
    cut_sds: float = 5.0  # ... whose height is so many times less sure
    most_weight: float = 4.0
    full_m: float = 1.0  # nearer views weigh no more
    piece_share: float = 0.7  # a view so much shorter than what was seen whole from near by shows a piece of it ...
    whole_m: float = 3.0
    piece_weight: float = 1.0  # ... and tells so much less of its size
    missed_loss: float = 0.8  # log-odds of a rock that should have been seen
    drop_below: float = -1.4
    most_log_odds: float = 4.0
    sure_range_m: tuple[float, float] = (1.3, 5.5)  # inside it a missing rock is news
    sure_angle_rad: float = 0.035  # as is one of this apparent size
    height_sd_share: float = 0.10  # of the height, and an angle: one sigma of a height that comes without
    height_sd_rad: float = 0.005
    least_height_m: float = 0.03  # lower ones are no rocks to the wheels
    capacity: int = 800


# At the foot of the picture rocks fall into pieces; what two eyes saw whole before holds.
STEREO_MEMORY = MemoryModel(full_m=1.3, piece_weight=0.1)


@dataclass(frozen=True, eq=False)
class TerrainMemory:
    """Rocks and seen cells, and what the laser scanner told if there is one."""

    rocks: RockMemory
    cells: GroundCells
    laser: LaserMap | None = None


def empty_memory(centre_w: FloatArray) -> TerrainMemory:
    """A memory of nothing, its cells around ``centre_w`` (2,)."""
    none = np.zeros(0)
    rocks = RockMemory(np.zeros((0, 2)), np.zeros((0, 2, 2)), *(none,) * 9)
    return TerrainMemory(rocks, empty_cells(centre_w))


def remember(
    memory: TerrainMemory,
    observation: Observation | None,
    viewpoint_w: FloatArray,
    model: MemoryModel | None = None,
    *,
    standing: View | None = None,
) -> TerrainMemory:
    """The memory after one observation made from ``viewpoint_w`` (2,), the place of the rover, if there was one.

    ``standing`` tells of the ground under the rover.
    """
    told = [] if standing is None else [standing]
    if observation is None:
        return replace(memory, cells=take_in(memory.cells, *told))
    rocks = remember_rocks(memory.rocks, observation, viewpoint_w, model)
    return replace(memory, rocks=rocks, cells=take_in(memory.cells, camera_view(observation, viewpoint_w), *told))


def remember_rocks(
    known: RockMemory, observation: Observation, viewpoint_w: FloatArray, model: MemoryModel | None = None
) -> RockMemory:
    """The rocks after one observation made from ``viewpoint_w`` (2,)."""
    model = model or MemoryModel()
    views = _views(observation, viewpoint_w, model)
    apart = np.linalg.norm(known.centre_w - viewpoint_w, axis=1)
    reach = 2.0 + max((rock.range_m for rock in observation.rocks), default=model.sure_range_m[1])
    rocks, beyond = known.select(apart <= reach), known.select(apart > reach)
    match, fresh = _associate(rocks, views, model)
    updated = _doubt(_fuse(rocks, views, match, model), match, observation, viewpoint_w, model)
    joined = _join(updated, views.select(fresh))
    kept = _unite(joined.select(joined.log_odds > model.drop_below))
    return _cap(_join(kept, beyond), viewpoint_w, model)


def remember_scan(memory: TerrainMemory, scan: RangeScan, estimate: PoseEstimate) -> TerrainMemory:
    """The memory after one turn of the scanner."""
    place = scan.pose.position_w[:2]
    laser = note_scan(memory.laser or empty_laser_map(place), scan, estimate)
    return replace(memory, laser=laser, cells=mark_free(recentre(memory.cells, place), laser, scan.time_s))


def _views(observation: Observation, viewpoint_w: FloatArray, model: MemoryModel) -> RockMemory:
    """The observation's rocks as if each were remembered from this view alone."""
    seen = [rock for rock in observation.rocks if rock.height_m >= model.least_height_m]
    count = len(seen)
    centre = np.array([rock.position_w[:2] for rock in seen]).reshape(count, 2)
    distance = np.array([rock.range_m for rock in seen])
    along = np.maximum([rock.position_sd_m for rock in seen], model.least_sd_m)
    across = np.maximum(model.lateral_sd_ratio * distance, model.least_sd_m)
    sight = centre - viewpoint_w
    sight = sight / np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-6)
    normal = np.stack([-sight[:, 1], sight[:, 0]], axis=1)
    covariance = along[:, None, None] ** 2 * (sight[:, :, None] * sight[:, None, :])
    covariance = covariance + across[:, None, None] ** 2 * (normal[:, :, None] * normal[:, None, :])
    certainty = np.clip(np.array([rock.certainty for rock in seen]), 0.3, 0.9)
    height, cut = np.array([rock.height_m for rock in seen]), np.array([rock.cut for rock in seen], dtype=bool)
    told = np.array([rock.height_sd_m for rock in seen])
    height_sd = np.where(told > 0.0, told, np.hypot(model.height_sd_share * height, model.height_sd_rad * distance))
    height_sd = np.where(cut, model.cut_sds, 1.0) * height_sd
    return RockMemory(
        centre,
        covariance.reshape(count, 2, 2),
        np.array([max(rock.length_m, rock.width_m) for rock in seen]),
        np.array([min(rock.length_m, rock.width_m) for rock in seen]),
        height,
        height_sd,
        np.array([rock.yaw_rad + (0.0 if rock.length_m >= rock.width_m else np.pi / 2) for rock in seen]),
        np.where(cut, model.cut_weight, 1.0) / np.maximum(distance, model.full_m) ** 4,
        np.log(certainty / (1.0 - certainty)),
        np.full(count, observation.time_s),
        np.zeros(count),
    )


def _associate(rocks: RockMemory, views: RockMemory, model: MemoryModel) -> tuple[Index, BoolArray]:
    """For each remembered rock the view that is it, or -1; and a mask of the views that are new."""
    fresh = np.ones(len(views), dtype=bool)
    if len(rocks) == 0 or len(views) == 0:
        return np.full(len(rocks), -1), fresh
    old, new = (rocks.centre_w, rocks.covariance, rocks.length_m), (views.centre_w, views.covariance, views.length_m)
    match = kernels.associate(*old, *new, model.gate, SIZE_SLACK, MOST_SHIFT_M).astype(np.intp)
    fresh[match[match >= 0]] = False
    return match, fresh


def _fuse(rocks: RockMemory, views: RockMemory, match: Index, model: MemoryModel) -> RockMemory:
    """Matched rocks moved by covariance intersection, resized by the inverse fourth power of range.

    All views of a rock share the error of the ground plane, so they must not average out: covariance intersection
    (Julier and Uhlmann, 1997) holds for any correlation; its weight is that of Niehsen (2002), by the traces.
    """
    index = np.flatnonzero(match >= 0)
    if len(index) == 0:
        return rocks
    old, new = rocks.select(index), views.select(match[index])
    # What shows less of a rock than is known of it, cut off or hidden, may be any part of it.
    lacking = 0.5 * np.maximum(old.length_m - new.length_m, 0.0)
    new = replace(new, covariance=new.covariance + lacking[:, None, None] ** 2 * np.eye(2))
    old_trace, new_trace = (np.trace(part.covariance, axis1=1, axis2=2) for part in (old, new))
    old_share = (new_trace / (old_trace + new_trace))[:, None, None]
    old_information = old_share * np.linalg.inv(old.covariance)
    new_information = (1.0 - old_share) * np.linalg.inv(new.covariance)
    covariance = np.linalg.inv(old_information + new_information)
    gain = covariance @ new_information
    # A farther view does not make a place less sure that was seen from near.
    grown = np.trace(covariance, axis1=1, axis2=2) > old_trace
    covariance = np.where(grown[:, None, None], old.covariance, covariance)
    # Far views mix up neighbours with a certainty of their own: near ones must be able to undo many of them.
    piece = (new.length_m < model.piece_share * old.length_m) & (old.weight > model.whole_m**-4)
    told = np.where(piece, model.piece_weight, 1.0) * new.weight
    share = told / (old.weight + told)
    centre = old.centre_w + np.einsum("nij,nj->ni", gain, new.centre_w - old.centre_w)
    yaw = old.yaw_rad + share * _half_turn(new.yaw_rad - old.yaw_rad)
    gained = np.minimum(old.log_odds + model.seen_gain * new.certainty, model.most_log_odds)
    fused = RockMemory(
        centre,
        0.5 * (covariance + np.swapaxes(covariance, 1, 2)),
        old.length_m + share * (new.length_m - old.length_m),
        old.width_m + share * (new.width_m - old.width_m),
        old.height_m + share * (new.height_m - old.height_m),
        old.height_sd_m + share * (new.height_sd_m - old.height_sd_m),  # views share errors: it does not shrink
        yaw,
        np.minimum(old.weight + told, model.most_weight),
        gained,
        new.seen_s,
        old.judged,
    )
    return _put(rocks, index, fused)


def _doubt(
    rocks: RockMemory, match: Index, observation: Observation, viewpoint_w: FloatArray, model: MemoryModel
) -> RockMemory:
    """Rocks that stand in view, near and large enough, unhidden, and were not seen, become less likely."""
    if len(rocks) == 0 or len(observation.footprint_w) < 3:
        return rocks
    sight = rocks.centre_w - viewpoint_w
    distance = np.linalg.norm(sight, axis=1)
    near, far = model.sure_range_m
    expected = (match < 0) & (distance > near) & (distance < far)
    expected &= rocks.width_m > model.sure_angle_rad * distance
    expected &= inside_polygon(observation.footprint_w, rocks.centre_w)
    index = np.flatnonzero(expected)
    if len(index) == 0:
        return rocks
    bearing = np.arctan2(sight[:, 1], sight[:, 0])
    apart = np.abs((bearing[index, None] - bearing[None] + np.pi) % (2 * np.pi) - np.pi)
    in_front = distance[None] < distance[index, None] - 0.1
    hidden = np.any(in_front & (apart < 0.5 * rocks.length_m[None] / distance[None]) & (rocks.height_m > 0.1), axis=1)
    # At the rim of the view a rock may be cut off; the loss grows with apparent size.
    clear = np.clip(rocks.width_m[index] / (2.0 * model.sure_angle_rad * distance[index]), 0.5, 1.0)
    log_odds = rocks.log_odds.copy()
    log_odds[index] -= np.where(hidden, 0.0, model.missed_loss * clear)
    return replace(rocks, log_odds=log_odds)


def _unite(rocks: RockMemory) -> RockMemory:
    """Rocks that lie inside larger and no lower ones are dropped: two views of one, or of no importance."""
    if len(rocks) < 2:
        return rocks
    ordered = rocks.select(np.argsort(-rocks.width_m, kind="stable"))
    lost = kernels.swallowed(ordered.centre_w, ordered.length_m, ordered.width_m, ordered.height_m) > 0
    return ordered.select(~lost)


def _cap(rocks: RockMemory, viewpoint_w: FloatArray, model: MemoryModel) -> RockMemory:
    if len(rocks) <= model.capacity:
        return rocks
    distance = np.linalg.norm(rocks.centre_w - viewpoint_w, axis=1)
    return rocks.select(np.sort(np.argsort(distance, kind="stable")[: model.capacity]))


def _join(first: RockMemory, second: RockMemory) -> RockMemory:
    return RockMemory(*(np.concatenate(pair) for pair in zip(first.columns, second.columns, strict=True)))


def _put(rocks: RockMemory, index: Index, new: RockMemory) -> RockMemory:
    columns = tuple(column.copy() for column in rocks.columns)
    for column, values in zip(columns, new.columns, strict=True):
        column[index] = values
    return RockMemory(*columns)


def _half_turn(angle: FloatArray) -> FloatArray:
    """Angle between two undirected axes, in [-pi/2, pi/2)."""
    return (angle + np.pi / 2) % np.pi - np.pi / 2


def rock_at(centre_w: Vector3, diameter_m: float, height_m: float, range_m: float = 2.0) -> PerceivedRock:
    """A round rock that is known to be there: for maps given from outside."""
    return PerceivedRock(centre_w, diameter_m, diameter_m, height_m, 0.0, 0.9, 0, range_m, 0.03)
