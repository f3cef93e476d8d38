"""Paths through one picture: the planner's candidates over the rocks that the picture shows, back in its pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs

from perception.camera import project
from perception.pipeline import View
from planner.choice import Models, Place, choose, dense
from planner.obstacle_map import obstacles
from planner.terrain_map import empty_memory, remember
from worlds.types import BoolArray, FloatArray, Footprint, Observation

GOAL_RANGE_M = 8.0  # straight ahead; within the range that the perception places rocks at
GOAL_RADIUS_M = 0.5
_SPACING_M = 0.05
_SAME_PLANE_SD_M = 0.05
_ORIGIN = np.zeros(2)


@dataclass(frozen=True, eq=False)
class PicturePath:
    """A free path, from where the ground comes into view."""

    traversability: float
    points_px: FloatArray  # (N, 2) column, row
    points_w: FloatArray  # (N, 2) on the ground
    whole_w: FloatArray  # (M, 2) with what lies before it, from the rover's place on


def picture_paths(observation: Observation, view: View, footprint: Footprint) -> tuple[PicturePath, ...]:
    """Candidate paths straight ahead, highest traversability first, for a rover under the camera at x = y = 0.

    Empty where no row is free or none of a path lies in the picture.
    """
    # Rocks and paths go through the same plane and back into the same picture, so its error does not part them.
    rocks = tuple(structs.replace(rock, position_sd_m=_SAME_PLANE_SD_M) for rock in observation.rocks)
    memory = remember(empty_memory(_ORIGIN), replace(observation, rocks=rocks), _ORIGIN)
    models = Models(footprint)
    place = Place((0.0, 0.0), 0.0, (GOAL_RANGE_M, 0.0), GOAL_RADIUS_M)
    table = obstacles(memory.rocks, models.drive, footprint.climb_height_m)
    choice = choose(memory, table, place, models, detour=False)
    found = [
        path
        for candidate, score in zip(choice.candidates, choice.scores, strict=True)
        if (path := in_picture(candidate.waypoints_w, float(score), view)) is not None
    ]
    return tuple(sorted(found, key=lambda path: -path.traversability))


def in_picture(waypoints_w: FloatArray, traversability: float, view: View) -> PicturePath | None:
    """The part of a ground path that the camera sees: where it enters the picture, and the waypoints after that."""
    fine = dense(waypoints_w, _SPACING_M)
    inside, _ = in_view(fine, view)
    if not inside.any():
        return None
    first, last = int(np.argmax(inside)), len(inside) - 1 - int(np.argmax(inside[::-1]))
    # Waypoints are among the fine points: keep those between entry and exit, with both ends.
    corner = (fine[:, None] == waypoints_w[None]).all(axis=2).any(axis=1)
    corner[[first, last]] = True
    chosen = fine[first : last + 1][corner[first : last + 1]]
    pixels, _ = project(view.camera, view.pose, _on_plane(chosen, view))
    return PicturePath(traversability, pixels, chosen, waypoints_w)


def in_view(points_w: FloatArray, view: View) -> tuple[BoolArray, FloatArray]:
    """Which ground places (N, 2) the picture shows, and the pixels (N, 2) of all."""
    pixels, depth = project(view.camera, view.pose, _on_plane(points_w, view))
    limits = np.array([view.camera.width_px, view.camera.height_px])
    return np.asarray((depth > 0) & (pixels >= 0).all(axis=1) & (pixels <= limits).all(axis=1)), pixels


def _on_plane(points_w: FloatArray, view: View) -> FloatArray:
    """Points (N, 3) of the plane over ground places (N, 2)."""
    normal, point = view.plane.normal_w, view.plane.point_w
    z = point[2] - ((points_w - point[:2]) @ normal[:2]) / normal[2]
    return np.column_stack([points_w, z])
