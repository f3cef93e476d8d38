"""Rendered pictures with the truth about every rock in them: what perception is taught on and scored against.

Each seed is a world with a sun and a rock cover of its own; the rover stands at random free places, its camera and
its believed ground tilted like the plane through the ground around it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from perception.camera import project
from rover_sim.sim.renderer import RenderedImage, add_noise, make_renderer
from rover_sim.sim.rover import load_rover
from worlds.build import build_world
from worlds.geometry import camera_pose, quaternion_from_rotation, to_sun
from worlds.heightfield import height_at
from worlds.scenario import Camera, Goal, GroundTexture, Rocks, Scenario, Sun, Terrain
from worlds.types import BoolArray, FloatArray, Frame, GroundPlane, HeightField, IntArray, Pose, World

SUNS_DEG = ((120, 40), (30, 25), (250, 60), (180, 15), (320, 35), (75, 50))  # azimuth, elevation
COVERS = (0.05, 0.03, 0.08)  # share of the ground under rock
WORLD_M, EDGE_M = 30.0, 3.0
REACH_M, LEAST_DEPTH_M = 12.0, 0.7  # rocks farther away, or nearer than any that is seen, get no truth
_STANDING_ROOM_M = 0.5
LEAST_M, WITHIN_M, LEAST_SHARE, LEAST_PX = 0.10, 5.0, 0.5, 12  # of the rocks that figures are about


@dataclass(frozen=True, eq=False)
class TrueRocks:
    """The rocks in view within `REACH_M`, one a row."""

    ids: IntArray  # (R,) as in the picture of ids
    position_w: FloatArray  # (R, 3) centre of the base
    diameter_m: FloatArray  # (R,) of the circle of equal base
    height_m: FloatArray  # (R,)
    range_m: FloatArray  # (R,) level distance from the camera
    seen_px: IntArray  # (R,) pixels that show it
    whole_px: FloatArray  # (R,) area that it would cover with nothing before it and no border
    cut: BoolArray  # (R,) part of it is outside the picture

    @property
    def seen_share(self) -> FloatArray:
        """Share (R,) of the rock that is seen."""
        return np.asarray(self.seen_px / np.maximum(self.whole_px, 1e-9))


@dataclass(frozen=True, eq=False)
class RenderedView:
    """One picture as perception gets it, what the renderer knows of its pixels, and the rocks in it."""

    frame: Frame
    truth: RenderedImage
    clasts: IntArray  # (H, W) ids of the picture with its pebbles numbered after the rocks
    rocks: TrueRocks


def make_world(
    seed: int, roughness_m: float, sun_deg: tuple[float, float] | None = None, texture: GroundTexture = "sand"
) -> World:
    """World of a seed: rocks and cover change with it, and the sun (azimuth, elevation) where none is given."""
    azimuth, elevation = SUNS_DEG[seed % len(SUNS_DEG)] if sun_deg is None else sun_deg
    scenario = Scenario(
        name="perception",
        terrain=Terrain(kind="fractal", size_m=(WORLD_M, WORLD_M), roughness_m=roughness_m, texture=texture),
        rocks=Rocks(cfa=COVERS[seed % len(COVERS)]),
        goal=Goal(position_m=(12.0, 0.0)),
        sun=Sun(azimuth_deg=azimuth, elevation_deg=elevation),
    )
    return build_world(scenario, seed)


def plane_around(ground: HeightField, x: float, y: float, reach_m: float) -> GroundPlane:
    """Plane through the ground within ``reach_m`` of a place."""
    steps = np.linspace(-reach_m, reach_m, 9)
    dx, dy = (axis.ravel() for axis in np.meshgrid(steps, steps))
    z = height_at(ground, x + dx, y + dy)
    a, b, c = np.linalg.lstsq(np.column_stack([dx, dy, np.ones_like(dx)]), z, rcond=None)[0]
    normal = np.array([-a, -b, 1.0])
    return GroundPlane(np.array([x, y, c]), normal / np.linalg.norm(normal))


def rendered_views(world: World, count: int, plane_reach_m: float = 0.5) -> Iterator[RenderedView]:
    """Views from random places that no rock is on, the same for the same world.

    The rover stands on the plane through the ground within half a metre; what it believes is level with the plane
    within ``plane_reach_m``, through the point under it.
    """
    rng = np.random.default_rng(world.seed)
    renderer, rover = make_renderer(world), load_rover("husky")
    camera, sun = rover.camera(Camera()), world.scenario.sun
    (x0, x1), (y0, y1) = world.ground.x_limits_m, world.ground.y_limits_m
    while count:
        x, y = rng.uniform(x0 + EDGE_M, x1 - EDGE_M), rng.uniform(y0 + EDGE_M, y1 - EDGE_M)
        yaw = rng.uniform(-np.pi, np.pi)
        apart = np.hypot(*(world.rocks.position_w[:, :2] - (x, y)).T)
        if (apart < world.rocks.extents_m[:, 0] / 2 + _STANDING_ROOM_M).any():
            continue
        stand = plane_around(world.ground, x, y, 0.5)
        pose = camera_pose(body_pose(stand, yaw, rover.wheel.radius_m), camera)
        truth = renderer.render(camera, pose)
        believed = GroundPlane(stand.point_w, plane_around(world.ground, x, y, plane_reach_m).normal_w)
        image = add_noise(truth.image, Camera().noise, rng)
        frame = Frame(0.0, image, camera, pose, believed, to_sun_w=to_sun(sun.azimuth_deg, sun.elevation_deg))
        yield RenderedView(frame, truth, renderer.clasts(camera, pose, truth), true_rocks(world, frame, truth.ids))
        count -= 1


def true_rocks(world: World, frame: Frame, ids: IntArray) -> TrueRocks:
    """What there is to see in a frame of ``world`` whose picture of ids is ``ids`` (H, W)."""
    assert frame.camera_pose is not None
    table, eye = world.rocks, frame.camera_pose.position_w
    away = np.hypot(*(table.position_w[:, :2] - eye[:2]).T)
    _, depth = project(frame.camera, frame.camera_pose, table.position_w)
    near: IntArray = np.flatnonzero(
        (away <= REACH_M) & (depth > LEAST_DEPTH_M) & np.isin(table.ids, world.shapes.ids)
    ).astype(np.int32)
    outlines = _silhouettes(world, frame, table.ids[near])
    size = np.array([frame.camera.width_px, frame.camera.height_px])
    inside = [bool(((hull > 0) & (hull < size)).all(axis=1).any()) for hull in outlines]
    near, outlines = near[inside], [hull for hull, there in zip(outlines, inside, strict=True) if there]
    chosen = table.chosen(near)
    seen = np.bincount(ids[ids > 0], minlength=int(table.ids.max(initial=0)) + 1)[chosen.ids]
    return TrueRocks(
        chosen.ids,
        chosen.position_w,
        chosen.diameters_m,
        chosen.extents_m[:, 2],
        away[near],
        seen.astype(np.int32),
        np.array([cv2.contourArea(hull) for hull in outlines]),
        np.array([bool(((hull < 0) | (hull > size)).any()) for hull in outlines], dtype=bool),
    )


def counted(rocks: TrueRocks) -> BoolArray:
    """Which rocks (R,) the figures are about."""
    wanted = (rocks.diameter_m >= LEAST_M) & (rocks.range_m <= WITHIN_M) & ~rocks.cut
    return np.asarray(wanted & (rocks.seen_share >= LEAST_SHARE) & (rocks.seen_px >= LEAST_PX))


def matches(labels: IntArray, ids: IntArray) -> dict[int, int]:
    """True id by reported label, both pictures (H, W): more than half of each one's pixels belong to the other."""
    both = (labels > 0) & (ids > 0)
    pairs, common = np.unique(np.stack([labels[both], ids[both]], axis=-1), axis=0, return_counts=True)
    found_px, true_px = np.bincount(labels.ravel()), np.bincount(ids[ids > 0])
    mutual = (2 * common > found_px[pairs[:, 0]]) & (2 * common > true_px[pairs[:, 1]])
    return {int(label): int(identity) for label, identity in pairs[mutual]}


def body_pose(stand: GroundPlane, yaw_rad: float, wheel_radius_m: float) -> Pose:
    """Pose of a rover that stands on a plane and heads along ``yaw_rad``."""
    forward = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    forward -= (forward @ stand.normal_w) * stand.normal_w
    forward /= np.linalg.norm(forward)
    axes = np.column_stack([forward, np.cross(stand.normal_w, forward), stand.normal_w])
    return Pose(stand.point_w + wheel_radius_m * stand.normal_w, quaternion_from_rotation(axes))


def _silhouettes(world: World, frame: Frame, ids: IntArray) -> list[FloatArray]:
    """Convex outlines, each (N, 2) in pixels, of what stands above the ground of the rocks ``ids`` (R,), ascending."""
    assert frame.camera_pose is not None
    mesh = world.shapes.picture(np.searchsorted(world.shapes.ids, ids).astype(np.int32))
    points = mesh.vertices_m.copy()
    points[:, 2] = np.maximum(points[:, 2], height_at(world.ground, points[:, 0], points[:, 1]))
    pixels = project(frame.camera, frame.camera_pose, points)[0].astype(np.float32)
    owner = np.empty(len(points), dtype=np.int64)
    owner[mesh.faces] = mesh.owner[:, None]
    groups = [pixels[owner == identity] for identity in ids]
    return [np.asarray(cv2.convexHull(group[np.isfinite(group[:, 0])])[:, 0]) for group in groups]
