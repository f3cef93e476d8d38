"""Room around the rover's body: how far it can turn on the spot."""

from __future__ import annotations

import numpy as np

from planner.ground_cells import GroundCells, sample
from planner.obstacle_map import Frame2, in_frame, near
from planner.room_kernels import free_turns
from planner.terrain_map import RockMemory
from worlds.types import FloatArray, Footprint

GAP_M = 0.04  # between body and rock while turning
SLIDE_M_RAD = 1.5  # of way downhill for each radian of turn, where the ground rises by a metre a metre
ROLLED_OVER_M, SURE = 0.03, 0.35  # of rocks: what hardly holds a wheel, and the least certainty that counts
STEP_RAD = float(np.deg2rad(5.0))
_RIM_RAD = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
RIM = np.concatenate([share * np.stack([np.cos(_RIM_RAD), np.sin(_RIM_RAD)], axis=1) for share in (0.75, 0.95)])


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


def jam(rocks: RockMemory, places_w: FloatArray, footprint: Footprint) -> FloatArray:
    """Heights of the rocks in the ring that wheels sweep in a turn on the spot at places (..., 2), in climb heights.

    A wheel rolls over what it would not get over sideways: the side of a wheel is a wall.
    """
    middle = 0.5 * float(np.hypot(footprint.wheelbase_m, footprint.track_m))
    half = float(np.hypot(footprint.wheel_radius_m, 0.5 * footprint.wheel_width_m))
    holding = (rocks.certainty > SURE) & (rocks.height_m > ROLLED_OVER_M)
    reach = half + 0.25 * (rocks.length_m + rocks.width_m)[holding]
    x, y = np.moveaxis(places_w[..., None, :] - rocks.centre_w[holding], -1, 0)
    met = np.abs(np.hypot(x, y) - middle) < reach
    heights: FloatArray = np.where(met, rocks.height_m[holding], 0.0).sum(axis=-1) / footprint.climb_height_m
    return heights


def _unseen(cells: GroundCells, place_w: FloatArray, radius_m: float) -> FloatArray:
    """Ground around the rover that was never seen, as obstacles (N, 7) without extent."""
    spots = place_w + radius_m * RIM
    spots = spots[~sample(cells, spots)[0]]
    shape: FloatArray = np.zeros((len(spots), 7))
    shape[:, 0:2] = shape[:, 2:4] = spots
    shape[:, 5:7] = 1.0
    return shape
