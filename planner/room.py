"""Room around the rover's body: how far it can turn on the spot and back straight out."""

from __future__ import annotations

import numpy as np

from planner.ground_cells import GroundCells, sample
from planner.obstacle_map import Frame2, in_frame, let_leave, near, segment_clearance
from planner.room_kernels import free_turns
from worlds.types import FloatArray, Footprint

GAP_M = 0.04  # between body and rock while turning or backing
STEP_RAD = float(np.deg2rad(5.0))
_RIM_RAD = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
RIM = np.concatenate([share * np.stack([np.cos(_RIM_RAD), np.sin(_RIM_RAD)], axis=1) for share in (0.75, 0.95)])


def turn_range(
    table_w: FloatArray, cells: GroundCells | None, place_w: FloatArray, heading_rad: float, footprint: Footprint
) -> tuple[float, float]:
    """How far the body can turn on the spot to the right (<= 0) and left (>= 0), radians.

    It must meet no hard rock, nor, where ``cells`` are given, ground that was never seen: the camera looks elsewhere
    than where the corners sweep. What the body's outline holds already is left out: it is under the belly, or the map
    is wrong.
    """
    half_length, half_width = footprint.length_m / 2 + GAP_M, footprint.width_m / 2 + GAP_M
    hard = near(table_w, place_w, 1.6)
    hard = hard[hard[:, 6] > 0.5]
    if cells is not None:
        hard = np.vstack([hard, _unseen(cells, place_w, float(np.hypot(half_length, half_width)))])
    local = in_frame(hard, Frame2((float(place_w[0]), float(place_w[1])), heading_rad))
    right, left = free_turns(local, half_length, half_width, STEP_RAD)
    return float(right), float(left)


def backing_room(
    table_w: FloatArray,
    cells: GroundCells,
    place_w: FloatArray,
    heading_rad: float,
    footprint: Footprint,
    most_m: float,
) -> float:
    """How far the rover can back straight out over ground it has seen, metres, at most ``most_m``; 0 if not at all."""
    back = -np.array([np.cos(heading_rad), np.sin(heading_rad)])
    side = np.array([-back[1], back[0]])
    half_length, need = footprint.length_m / 2, footprint.width_m / 2 + GAP_M
    # Rocks beside or under the body now are no news to the way back.
    around = let_leave(near(table_w, place_w, most_m + 2.5), place_w, need)
    free = 0.0
    for distance in np.arange(0.1, most_m + 1e-9, 0.1):
        rear = place_w + (distance + half_length) * back
        start = place_w + (half_length - 0.05) * back
        if segment_clearance(around, np.stack([start, rear])).min() < need:
            break
        edge = rear + np.linspace(-need, need, 3)[:, None] * side
        if not sample(cells, edge)[0].all():
            break
        free = float(distance)
    return free


def _unseen(cells: GroundCells, place_w: FloatArray, radius_m: float) -> FloatArray:
    """Ground around the rover that was never seen, as obstacles (N, 7) without extent."""
    spots = place_w + radius_m * RIM
    spots = spots[~sample(cells, spots)[0]]
    shape: FloatArray = np.zeros((len(spots), 7))
    shape[:, 0:2] = shape[:, 2:4] = spots
    shape[:, 5:7] = 1.0
    return shape
