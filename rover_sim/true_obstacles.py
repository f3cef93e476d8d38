"""The true obstacles of a world as the planner would see them, for whoever judges."""

from __future__ import annotations

import numpy as np

from planner.obstacle_map import Frame2, in_frame
from rover_sim.errors import ScenarioError
from worlds.geometry import euler_from_quaternion
from worlds.types import FloatArray, Footprint, World


def obstacle_table(world: World, above_m: float) -> FloatArray:
    """Rocks and cylinders higher than ``above_m`` as obstacles (N, 7), see `planner.obstacle_map.obstacles`."""
    length, width, height = world.rocks.extents_m.T
    half = 0.5 * np.maximum(length - width, 0.0)
    yaw = world.rocks.yaw_rad
    axis = half[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    centre = world.rocks.position_w[:, :2]
    one = np.ones(len(height))
    rocks = np.column_stack([centre - axis, centre + axis, 0.5 * np.minimum(width, length), one, one])
    pillars = [
        (*item.position_w[:2], *item.position_w[:2], item.radius_m, 1.0, 1.0)
        for item in world.cylinders
        if item.height_m > above_m
    ]
    return np.concatenate([rocks[height > above_m], np.array(pillars, dtype=np.float64).reshape(-1, 7)])


def check_start(world: World, footprint: Footprint) -> None:
    """Raise a `ScenarioError` where the body at its start would stand in something higher than its belly."""
    x, y = world.scenario.rover.start_m
    table = in_frame(
        obstacle_table(world, footprint.clearance_m),
        Frame2((x, y), euler_from_quaternion(world.start.quaternion_w)[2]),
    )
    size = np.array([footprint.length_m, footprint.width_m]) / 2.0
    for share in (0.0, 0.5, 1.0):  # along the axis of a long rock
        middle = table[:, 0:2] + share * (table[:, 2:4] - table[:, 0:2])
        inside = np.linalg.norm(np.maximum(np.abs(middle) - size, 0.0), axis=1) < table[:, 4]
        if inside.any():
            place = Frame2((x, y), euler_from_quaternion(world.start.quaternion_w)[2]).to_world(middle[inside][0])
            raise ScenarioError(
                f"rover.start_m = [{x:g}, {y:g}]: the rover would stand on the obstacle at "
                f"[{place[0]:.2f}, {place[1]:.2f}]; move one of them, or raise rocks.clear_radius_m"
            )
