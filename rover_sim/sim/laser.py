"""The 2-D laser scanner: ray casting against the true ground and obstacles, with seeded noise."""

from __future__ import annotations

from math import inf

import numpy as np

from rover_sim.sim.laser_kernels import meet_ground, meet_obstacles
from rover_sim.sim.obstacle_index import ObstacleIndex
from worlds.geometry import rotation_from_quaternion
from worlds.types import FloatArray, LaserModel, Pose, World

SLACK_M = 5.0  # the rover may move so far before the obstacles within reach are looked up anew
_BOX_REACH_M = 0.25  # by which the index widens its boxes


class LaserScanner:
    """Scans one world; all randomness comes from ``rng``."""

    def __init__(self, world: World, laser: LaserModel, rng: np.random.Generator) -> None:
        self._world, self.laser, self._rng = world, laser, rng
        angles = laser.angles_rad
        self._first_rad = float(angles[0])
        self._beams_b = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
        ground = world.ground
        self._grid = (*ground.origin_m, 1.0 / ground.resolution_m)
        self._heights = np.ascontiguousarray(ground.heights_m, dtype=np.float64)
        self._looked_up = np.array([inf, inf])
        self._index = ObstacleIndex(world.shapes.collision(np.zeros(0, dtype=np.int32)))

    def scan(self, body: Pose) -> FloatArray:
        """Ranges (N,) in metres from a rover that truly is at ``body``; inf where nothing came back."""
        rotation = rotation_from_quaternion(body.quaternion_w)
        origin = body.position_w + rotation @ np.asarray(self.laser.position_b)
        self._follow(origin)
        directions = self._beams_b @ rotation.T
        ranges = np.full(len(directions), self.laser.reach_m)
        index = self._index
        boxes = (index.low + _BOX_REACH_M, index.high - _BOX_REACH_M)
        mesh = (index.mesh_vertices, index.faces, index.face_starts, *boxes)
        meet_obstacles(ranges, directions, origin, rotation, mesh, self._first_rad, self.laser.step_rad)
        meet_ground(ranges, directions, origin, self._heights, self._grid)
        noise = self._rng.normal(0.0, self.laser.range_sd_m, len(ranges))
        return np.where(ranges < self.laser.reach_m, np.maximum(ranges + noise, 0.0), inf)

    def _follow(self, origin: FloatArray) -> None:
        """Hold the obstacles that the beams may meet around here."""
        if not np.any(np.abs(origin[:2] - self._looked_up) > SLACK_M):
            return
        self._looked_up = origin[:2].copy()
        low, high = self._world.shapes.bounds_w
        reach = self.laser.reach_m + SLACK_M
        near = np.all((high[:, :2] > origin[:2] - reach) & (low[:, :2] < origin[:2] + reach), axis=1)
        self._index.take(self._world.shapes.collision(np.flatnonzero(near).astype(np.int32)))
