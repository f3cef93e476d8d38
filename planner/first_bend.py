"""The beginning of a way as a bend instead of a turn on the spot, where there is room: turning wheels dig and jam."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from planner.choice import Place
from worlds.types import FloatArray

RADIUS_M = 1.3  # a little more than path following drives, so that it has something to correct with
SPACING_M = 0.3
MOST_BEND_RAD = 2.0
MOST_KINK_RAD = float(np.deg2rad(50.0))  # where the bend meets the way
MOST_JOINTS = 5


def bends_onto(way_w: FloatArray, place: Place) -> Iterator[FloatArray]:
    """Ways (M, 2) that begin with a bend to either side and join ``way_w`` (N, 2) at one of its next waypoints."""
    for joint in range(1, min(len(way_w), MOST_JOINTS + 1)):
        for side in (1.0, -1.0):
            bend = _bend(place, way_w[joint], side)
            if bend is not None and _kink(bend[-1], way_w[joint:]) < MOST_KINK_RAD:
                yield np.vstack([bend, way_w[joint:]])


def begin_with_bend(
    way_w: FloatArray, place: Place, free: Callable[[FloatArray], bool], cost: Callable[[FloatArray], float]
) -> FloatArray:
    """The cheapest of the free ways that begin with a bend, if it is cheaper than ``way_w`` with its turn."""
    best, least = way_w, cost(way_w)
    for bent in bends_onto(way_w, place):
        if free(bent):
            price = cost(bent)
            if price < least:
                best, least = bent, price
    return best


def _bend(place: Place, target_w: FloatArray, side: float) -> FloatArray | None:
    """Points (M, 2) from the rover round a circle to where its tangent leads to the target; None if it is too long.

    ``side``: 1 to the left, -1 to the right.
    """
    position, heading = np.asarray(place.position_w), place.heading_rad
    centre = position + side * RADIUS_M * np.array([-np.sin(heading), np.cos(heading)])
    east, north = target_w - centre
    apart = float(np.hypot(east, north))
    if apart <= RADIUS_M:
        return None
    straight = np.sqrt(apart**2 - RADIUS_M**2)
    final = np.arctan2(north, east) + side * np.arctan2(RADIUS_M, straight)
    angle = float((side * (final - heading)) % (2.0 * np.pi))
    if angle > MOST_BEND_RAD:
        return None
    turned = heading + side * np.linspace(0.0, angle, 1 + max(1, int(np.ceil(angle * RADIUS_M / SPACING_M))))
    points: FloatArray = centre + side * RADIUS_M * np.stack([np.sin(turned), -np.cos(turned)], axis=1)
    return points


def _kink(from_w: FloatArray, way_w: FloatArray) -> float:
    """Angle between the leg from a point to the first waypoint of a way and the leg after it."""
    if len(way_w) < 2:
        return 0.0
    first, second = way_w[0] - from_w, way_w[1] - way_w[0]
    return abs(float(np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second)))
