"""The way that the rover came, to go back the same way."""

from __future__ import annotations

import math

import numpy as np

from worlds.types import FloatArray, Vector3


class Track:
    """Crumbs of the believed way since the rover was armed; loops are cut out."""

    def __init__(self) -> None:
        self.crumbs_w: list[Vector3] = []
        self.full = False

    def clear(self) -> None:
        """Begin anew."""
        self.crumbs_w = []
        self.full = False

    def add(self, position_w: FloatArray, spacing_m: float, most: int) -> None:
        """Note where the rover is if it has gone ``spacing_m``; where it was before, what lies between is forgotten."""
        place = float(position_w[0]), float(position_w[1]), float(position_w[2])
        if self.full or (self.crumbs_w and math.dist(self.crumbs_w[-1][:2], place[:2]) < spacing_m):
            return
        near = np.flatnonzero(_apart_m(self.crumbs_w, place) < spacing_m)
        if near.size:
            del self.crumbs_w[int(near[0]) + 1 :]
        elif len(self.crumbs_w) >= most:
            self.full = True
        else:
            self.crumbs_w.append(place)


def _apart_m(crumbs_w: list[Vector3], place: Vector3) -> FloatArray:
    away = np.asarray(crumbs_w).reshape(-1, 3) - np.asarray(place)
    return np.asarray(np.hypot(away[:, 0], away[:, 1]))
