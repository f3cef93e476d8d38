"""Fences: areas that the rover must stay inside of or keep out of, and how far a place is from their lines."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from worlds.types import FloatArray, Vector3

NO_FENCE_M = float("inf")  # clearance where there is no line at all


@dataclass(frozen=True, eq=False)
class Polygon:
    """An area with straight sides, closed from the last corner to the first."""

    corners_w: FloatArray  # (N, 2), N >= 3
    inclusion: bool

    def depth_m(self, x_m: float, y_m: float) -> float:
        """Distance to the outline, positive inside of it (even-odd rule)."""
        start, end = self.corners_w, np.roll(self.corners_w, -1, axis=0)
        here = np.array([x_m, y_m])
        side = end - start
        length2 = np.maximum((side**2).sum(axis=1), 1e-12)
        along = np.clip(((here - start) * side).sum(axis=1) / length2, 0.0, 1.0)
        away = start + along[:, None] * side - here
        distance = float(np.sqrt((away**2).sum(axis=1).min()))
        crosses = (start[:, 1] > y_m) != (end[:, 1] > y_m)
        rise = np.where(crosses, side[:, 1], 1.0)
        ahead = start[:, 0] + (y_m - start[:, 1]) / rise * side[:, 0] > x_m
        return distance if np.count_nonzero(crosses & ahead) % 2 else -distance


@dataclass(frozen=True)
class Circle:
    """A round area."""

    centre_w: tuple[float, float]
    radius_m: float
    inclusion: bool

    def depth_m(self, x_m: float, y_m: float) -> float:
        """Distance to the outline, positive inside of it."""
        return self.radius_m - float(np.hypot(x_m - self.centre_w[0], y_m - self.centre_w[1]))


@dataclass(frozen=True)
class Fence:
    """All areas, and where to go after a breach where no rally point says it."""

    areas: tuple[Polygon | Circle, ...] = ()
    return_w: Vector3 | None = None

    def clearance_m(self, x_m: float, y_m: float, *, any_inclusion: bool) -> float:
        """How far a place is from leaving what is allowed; below 0 it is outside, `NO_FENCE_M` without areas.

        ``any_inclusion``: one inclusion area around the rover is enough (PX4); otherwise all must be (ArduPilot).
        """
        inside = [area.depth_m(x_m, y_m) for area in self.areas if area.inclusion]
        outside = [-area.depth_m(x_m, y_m) for area in self.areas if not area.inclusion]
        allowed = NO_FENCE_M if not inside else max(inside) if any_inclusion else min(inside)
        return min([allowed, *outside])


def nearest(places_w: Iterable[Vector3], position_w: FloatArray | Vector3) -> Vector3 | None:
    """The nearest of some places, seen from above; None if there are none."""
    x_m, y_m = float(position_w[0]), float(position_w[1])
    return min(places_w, key=lambda place: float(np.hypot(place[0] - x_m, place[1] - y_m)), default=None)
