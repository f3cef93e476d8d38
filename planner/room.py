"""Room around the rover's body: how far it can turn on the spot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.ground_cells import GroundCells, sample
from planner.obstacle_map import Frame2, in_frame, near
from planner.room_kernels import free_turns, heights_met, holding, swept_heights
from planner.terrain_map import RockMemory
from worlds.types import FloatArray, Footprint

GAP_M = 0.04  # between body and rock while turning
SLIDE_M_RAD = 1.5  # of way downhill for each radian of turn, where the ground rises by a metre a metre
ROLLED_OVER_M, SURE = 0.03, 0.35  # of rocks: what hardly holds a wheel, and the least certainty that counts
STEP_RAD = float(np.deg2rad(5.0))
HELD_RAD = 0.3  # of pushing against a rock, after which it counts in full
HOLDS_M = 1.0  # farther rocks are not met by wheels
DUG_M, PIT_WALLS = 0.45, 2.0  # so near, the wheels stand in pits, whose walls count as rocks of so many climb heights
NOT_DUG = np.zeros((0, 2))
SURE_LOG_ODDS = float(np.log(SURE / (1.0 - SURE)))
_RIM_RAD = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
RIM = np.concatenate([share * np.stack([np.cos(_RIM_RAD), np.sin(_RIM_RAD)], axis=1) for share in (0.75, 0.95)])


@dataclass(frozen=True, eq=False)
class Turning:
    """Heights of the rocks that wheels meet in turns on the spot, in climb heights, by side and angle."""

    met: FloatArray  # (2, K): to the right and to the left, by 0, 1, .. K - 1 steps of STEP_RAD

    def heights(self, turns_rad: FloatArray) -> FloatArray:
        """What turns (N,), left positive, would meet."""
        heights: FloatArray = heights_met(self.met, STEP_RAD, turns_rad)
        return heights

    def reach(self, most: float) -> tuple[float, float]:
        """How far to the right (<= 0) and left (>= 0) it can turn and meet rocks of no more than ``most``, radians."""
        right, left = (STEP_RAD * max(0, int(np.searchsorted(side, most, side="right")) - 1) for side in self.met)
        return -right, left


FREE = Turning(np.zeros((2, 1 + round(np.pi / STEP_RAD))))


def turn_range(
    table_w: FloatArray,
    cells: GroundCells | None,
    place_w: FloatArray,
    heading_rad: float,
    footprint: Footprint,
    downhill_w: tuple[float, float] = (0.0, 0.0),
) -> tuple[float, float]:
    """How far the body can turn on the spot to the right (<= 0) and left (>= 0), radians.

    It must meet no hard rock, nor, where ``cells`` are given, ground that was never seen: the camera looks elsewhere
    than where the corners sweep. What the body's outline holds already is left out: it is under the belly, or the map
    is wrong. ``downhill_w``: downhill direction, as long as the slope is steep (rise over run); soft ground lets a
    turning rover slide.
    """
    half_length, half_width = footprint.length_m / 2 + GAP_M, footprint.width_m / 2 + GAP_M
    slide = SLIDE_M_RAD * np.asarray(downhill_w)
    hard = near(table_w, place_w, 1.6 + np.pi * float(np.hypot(*slide)))
    hard = hard[hard[:, 6] > 0.5]
    if cells is not None:
        hard = np.vstack([hard, _unseen(cells, place_w, float(np.hypot(half_length, half_width)))])
    local = in_frame(hard, Frame2((float(place_w[0]), float(place_w[1])), heading_rad))
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    slide_b = np.array([slide[0] * cos + slide[1] * sin, slide[1] * cos - slide[0] * sin])
    right, left = free_turns(local, half_length, half_width, STEP_RAD, slide_b)
    return float(right), float(left)


def turning(
    rocks: RockMemory, place_w: FloatArray, heading_rad: float, footprint: Footprint, dug_w: FloatArray = NOT_DUG
) -> Turning:
    """What the wheels would meet in turns on the spot from a heading.

    A rock counts by its height, in full once a wheel has pushed against it for a third of a radian: it would not get
    over it sideways, as the side of a wheel is a wall. Middle wheels roll in a turn and are left out. ``dug_w`` (D, 2):
    where turns were in vain; the walls of the pits that the wheels dug there hold them as rocks do.
    """
    steps = STEP_RAD * np.arange(FREE.met.shape[1])
    in_pits = (np.hypot(*(dug_w - place_w).T) < DUG_M).any()
    pits = PIT_WALLS * np.minimum(steps / HELD_RAD, 1.0) if in_pits else np.zeros(len(steps))
    place, sizes = (float(place_w[0]), float(place_w[1])), (rocks.length_m, rocks.width_m, rocks.height_m)
    limits = HOLDS_M, ROLLED_OVER_M, SURE_LOG_ODDS
    shape = holding(rocks.centre_w, sizes, rocks.yaw_rad, rocks.log_odds, place, limits)
    if not len(shape):
        return Turning(np.stack([pits, pits]))
    wheels = (
        0.5 * footprint.wheelbase_m,
        0.5 * footprint.track_m,
        footprint.wheel_radius_m,
        0.5 * footprint.wheel_width_m,
    )
    return Turning(swept_heights(shape, heading_rad, wheels, STEP_RAD, HELD_RAD) / footprint.climb_height_m + pits)


def _unseen(cells: GroundCells, place_w: FloatArray, radius_m: float) -> FloatArray:
    """Ground around the rover that was never seen, as obstacles (N, 7) without extent."""
    spots = place_w + radius_m * RIM
    spots = spots[~sample(cells, spots)[0]]
    shape: FloatArray = np.zeros((len(spots), 7))
    shape[:, 0:2] = shape[:, 2:4] = spots
    shape[:, 5:7] = 1.0
    return shape
