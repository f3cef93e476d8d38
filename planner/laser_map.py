"""What the laser scanner has told: an occupancy grid around the rover, each cell with its log-odds and position error.

A beam frees the cells it passes and marks the one it ends in; what stands there has no known height, so it is hard to
drive over. Beams that end on the believed ground say nothing beyond it. Method: Moravec and Elfes, ICRA 1985; log-odds
as in Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), section 9.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from planner.ground_cells import CELL_M as GROUND_CELL_M
from planner.ground_cells import GroundCells, Source, mark_seen
from planner.laser_kernels import take_scan
from worlds.geometry import rotation_from_quaternion
from worlds.types import BoolArray, FloatArray, PoseEstimate, RangeScan

CELL_M = 0.05
CELLS = 400  # 20 m
BLOCK = round(GROUND_CELL_M / CELL_M)  # laser cells along a ground cell

Layer = NDArray[np.float32]


@dataclass(frozen=True)
class LaserTrust:
    """How returns are weighed."""

    hit: float = 1.2  # log-odds of a return ...
    sure_sd_m: float = 0.08  # ... that is placed so well; in proportion less of one that is placed worse
    miss: float = 0.5  # of a beam that passes
    most: float = 4.0
    free_below: float = -0.4
    occupied_above: float = 0.5
    ground_m: float = 0.08  # a return lower than this above the believed ground is the ground ...
    ground_slope: float = 0.03  # ... and this much more a metre away


@dataclass(frozen=True, eq=False)
class LaserMap:
    """Cells ``[ix, iy]`` whose lower left corner lies at ``origin_w + CELL_M * (ix, iy)``."""

    origin_w: FloatArray  # (2,)
    log_odds: Layer  # (CELLS, CELLS); 0 where no beam has been
    sd_m: Layer  # (CELLS, CELLS) position error of the last return in a cell
    trust: LaserTrust = LaserTrust()

    def clearance_m(self, sd_share: float) -> Layer:
        """Distance from the middle of each cell to the nearest obstacle, less ``sd_share`` of that one's error."""
        occupied: BoolArray = self.log_odds > self.trust.occupied_above
        if not occupied.any():
            return np.full(self.log_odds.shape, CELLS * CELL_M, dtype=np.float32)
        free = (~occupied).astype(np.uint8)
        distance, nearest = cv2.distanceTransformWithLabels(
            free, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
        )
        sd_of = np.zeros(int(nearest.max()) + 1, dtype=np.float32)
        sd_of[nearest[occupied]] = self.sd_m[occupied]
        return np.asarray(distance * CELL_M - 0.5 * CELL_M - sd_share * sd_of[nearest], dtype=np.float32)

    def obstacles(self, place_w: FloatArray, radius_m: float, sd_share: float) -> FloatArray:
        """Occupied cells within ``radius_m`` as obstacles (N, 7), see `planner.obstacle_map.obstacles`."""
        low = np.clip(((place_w - radius_m - self.origin_w) / CELL_M).astype(int), 0, CELLS)
        high = np.clip(((place_w + radius_m - self.origin_w) / CELL_M).astype(int) + 1, 0, CELLS)
        window = np.s_[low[0] : high[0], low[1] : high[1]]
        cells = np.argwhere(self.log_odds[window] > self.trust.occupied_above)
        places = self.origin_w + CELL_M * (cells + low + 0.5)
        radius = 0.5 * CELL_M + sd_share * self.sd_m[window][cells[:, 0], cells[:, 1]]
        one = np.ones(len(cells))
        table: FloatArray = np.column_stack([places, places, radius, one, one]).astype(np.float64)
        return table


def empty_laser_map(centre_w: FloatArray) -> LaserMap:
    """A map of nothing around a place."""
    origin = np.floor(np.asarray(centre_w, dtype=float)[:2] / GROUND_CELL_M) * GROUND_CELL_M - CELLS * CELL_M / 2
    return LaserMap(origin, np.zeros((CELLS, CELLS), dtype=np.float32), np.zeros((CELLS, CELLS), dtype=np.float32))


def note_scan(laser_map: LaserMap, scan: RangeScan, estimate: PoseEstimate) -> LaserMap:
    """The map after one turn of the scanner, moved along with the rover."""
    trust = laser_map.trust
    moved = _recentre(laser_map, scan.pose.position_w[:2])
    ends, hit, spread = _returns(scan, estimate, trust)
    log_odds, sd = moved.log_odds.copy(), moved.sd_m.copy()
    start = (scan.pose.position_w[:2] - moved.origin_w) / CELL_M
    gain = trust.hit * np.minimum(1.0, trust.sure_sd_m / spread)
    cells, least = (ends - moved.origin_w) / CELL_M, scan.least_m / CELL_M
    take_scan(log_odds, sd, start, cells, least, hit, spread, gain, trust.miss, trust.most)
    return replace(moved, log_odds=log_odds, sd_m=sd)


def mark_free(cells: GroundCells, laser_map: LaserMap, time_s: float) -> GroundCells:
    """The ground cells, seen where every laser cell in them has been passed by beams."""
    blocks = laser_map.log_odds.reshape(CELLS // BLOCK, BLOCK, CELLS // BLOCK, BLOCK)
    free = np.asarray((blocks < laser_map.trust.free_below).all(axis=(1, 3))).T
    column, row = (int(value) for value in np.round((laser_map.origin_w - cells.origin_w) / GROUND_CELL_M))
    return mark_seen(cells, free, (row, column), Source.LASER, time_s)


def _returns(scan: RangeScan, estimate: PoseEstimate, trust: LaserTrust) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Ends (N, 2) of the beams in the world, which of them met an obstacle, and their position errors (N,)."""
    angles = scan.angles_rad
    back = np.isfinite(scan.ranges_m)
    ranges = np.where(back, scan.ranges_m, scan.reach_m)
    rotation = rotation_from_quaternion(scan.pose.quaternion_w)
    beams = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ rotation[:, :2].T
    ends = scan.pose.position_w + ranges[:, None] * beams
    above = (ends - scan.ground.point_w) @ scan.ground.normal_w
    obstacle: BoolArray = back & (above > trust.ground_m + trust.ground_slope * ranges)
    spread = np.hypot(scan.range_sd_m, ranges * estimate.yaw_sd_rad)
    return ends[:, :2], obstacle, spread


def _recentre(laser_map: LaserMap, place_w: FloatArray) -> LaserMap:
    """The same cells, moved by whole ground cells so that ``place_w`` lies in the middle third of the window."""
    middle = laser_map.origin_w + CELLS * CELL_M / 2
    if np.all(np.abs(place_w - middle) < CELLS * CELL_M / 6):
        return laser_map
    shift = np.round((place_w - middle) / GROUND_CELL_M).astype(int) * BLOCK
    moved = [np.zeros((CELLS, CELLS), dtype=np.float32) for _ in range(2)]
    if np.all(np.abs(shift) < CELLS):
        target = tuple(slice(max(-step, 0), CELLS - max(step, 0)) for step in shift)
        source = tuple(slice(max(step, 0), CELLS - max(-step, 0)) for step in shift)
        moved[0][target], moved[1][target] = laser_map.log_odds[source], laser_map.sd_m[source]
    return replace(laser_map, origin_w=laser_map.origin_w + CELL_M * shift, log_odds=moved[0], sd_m=moved[1])
