"""Pictures of a world: the top view that maps are drawn over, and a close look at the rocks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]

from worlds.geometry import euler_from_quaternion
from worlds.heightfield import contains, grid_points, window
from worlds.rock_shape import outlines
from worlds.types import FloatArray, HeightField, World

if TYPE_CHECKING:
    from rover_sim.sim.ruts import SavedRuts

SAND = LinearSegmentedColormap.from_list("sand", ["#3b2416", "#a8734a", "#f0d3ae"])
ROCK = LinearSegmentedColormap.from_list("rock", ["#8d6f5c", "#4a3930", "#17110e"])
ROCK_EDGE = "#17110e"
RUT, RUT_OPACITY = (0.12, 0.06, 0.03), 0.55
DEEP_M = 0.02  # ruts of this depth and more are drawn darkest
MOST_PX = 2500  # of the shading; no map is printed finer
FINEST_SHARE = 1500  # a rock smaller than this part of the map's side cannot be seen on it
TALL_M = 0.30  # rocks of this height and more are drawn darkest


Box = tuple[float, float, float, float]


def draw_ground(axes: Axes, world: World, box_m: Box | None = None) -> None:
    """Draw shaded ground, filled rock outlines (darker is higher), cylinders, start and goal on metre axes.

    ``box_m`` (left, right, bottom, top): only this part; what is too small to see in it is left out. Start and goal
    carry legend labels; the caller draws the legend. Rocks without a mesh show as shading only.
    """
    left, right, bottom, top = box_m or (*world.ground.x_limits_m, *world.ground.y_limits_m)
    field = window(world.ground, (left, right), (bottom, top))
    stride = int(np.ceil(max(field.heights_m.shape) / MOST_PX))
    field = HeightField(field.heights_m[::stride, ::stride], field.resolution_m * stride, field.origin_m)
    half = field.resolution_m / 2.0
    (west, east), (south, north) = field.x_limits_m, field.y_limits_m
    extent = (west - half, east + half, south - half, north + half)
    shade = _shade(field, _sun(world))
    axes.imshow(shade, cmap=SAND, vmin=0.0, vmax=1.0, origin="lower", extent=extent, interpolation="bilinear")
    _draw_rocks(axes, world, (left, right, bottom, top))
    for item in world.cylinders:
        axes.add_patch(Circle(item.position_w[:2], item.radius_m, facecolor="#3d5a80", edgecolor="black", zorder=3))
    _draw_ends(axes, world)
    limits = extent if box_m is None else box_m
    axes.set(xlim=limits[:2], ylim=limits[2:], xlabel="x east, m", ylabel="y north, m", aspect="equal")


def draw_ruts(axes: Axes, ruts: SavedRuts) -> None:
    """Darken the ground where wheels went, the more the deeper their ruts."""
    side = ruts.depth_m.shape[1] * ruts.texel_m
    for (row, column), depth in zip(ruts.tile, ruts.depth_m, strict=True):
        west, south = ruts.origin_m[0] + column * side, ruts.origin_m[1] + row * side
        picture = np.zeros((*depth.shape, 4))
        picture[..., :3] = RUT
        picture[..., 3] = RUT_OPACITY * np.sqrt(np.clip(depth / DEEP_M, 0.0, 1.0))
        extent = (west, west + side, south, south + side)
        axes.imshow(picture, origin="lower", extent=extent, interpolation="nearest", zorder=2)


def draw_scale(axes: Axes, world: World) -> None:
    """A bar of a round length at the lower left of the map."""
    (west, east), (south, north) = world.ground.x_limits_m, world.ground.y_limits_m
    length = 10.0 ** np.floor(np.log10((east - west) / 4.0))
    length *= max(step for step in (1.0, 2.0, 5.0) if step * length <= (east - west) / 4.0)
    x, y = west + 0.04 * (east - west), south + 0.04 * (north - south)
    axes.plot([x, x + length], [y, y], color="white", linewidth=4, solid_capstyle="butt", zorder=8)
    axes.text(x, y + 0.012 * (north - south), f"{length:g} m", color="white", fontsize=9, zorder=8)


def draw_close_up(axes: Axes3D, world: World, centre_m: tuple[float, float], side_m: float) -> None:
    """A square of ground with its rocks in perspective, as the picture mesh has them."""
    (x, y), half = centre_m, side_m / 2
    patch = window(world.ground, (x - half, x + half), (y - half, y + half))
    ground = _patch_triangles(patch)
    low, high = world.shapes.bounds_w
    reach = half + (high - low)[:, :2].max(axis=1)
    near = (np.abs((low + high)[:, :2] / 2 - centre_m) <= reach[:, None]).all(axis=1)
    mesh = world.shapes.picture(np.flatnonzero(near).astype(np.int32))
    rocks = mesh.vertices_m[mesh.faces]
    middle = rocks.mean(axis=1)
    inside = contains(patch, middle[:, 0], middle[:, 1])
    rocks = rocks[inside]
    normals = [_unit_normals(faces) for faces in (ground, rocks)]
    light = [np.clip(normal @ _sun(world), 0.05, 1.0) for normal in normals]
    colours = np.concatenate([SAND(0.15 + 0.75 * light[0]), 0.75 * SAND(0.05 + 0.85 * light[1])])
    colours[:, 3] = 1.0
    # One collection, so that ground and rocks are sorted by depth together.
    triangles = np.concatenate([ground, rocks])
    axes.add_collection3d(Poly3DCollection(triangles, facecolors=colours, edgecolors=colours, linewidths=0.3))
    top = float(patch.heights_m.max()) + 0.5
    bottom = float(patch.heights_m.min())
    axes.set(xlim=patch.x_limits_m, ylim=patch.y_limits_m, zlim=(bottom, top))
    axes.set_box_aspect((side_m, side_m, top - bottom))
    axes.view_init(elev=35, azim=-70)


def _shade(field: HeightField, sun: FloatArray) -> FloatArray:
    """Brightness (ny, nx) in 0..1 of the bare ground with the sun in the direction ``sun`` (3,)."""
    along_y, along_x = np.gradient(field.heights_m, field.resolution_m)
    normal = np.stack([-along_x, -along_y, np.ones_like(along_x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    # Level ground is mid-tone whatever the sun's height.
    return np.asarray(np.clip(0.55 + 0.9 * (normal @ sun - sun[2]), 0.0, 1.0))


def _sun(world: World) -> FloatArray:
    """Unit vector (3,) towards the sun."""
    azimuth, elevation = np.radians([world.scenario.sun.azimuth_deg, world.scenario.sun.elevation_deg])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def _draw_rocks(axes: Axes, world: World, box_m: Box) -> None:
    left, right, bottom, top = box_m
    smallest = max(right - left, top - bottom) / FINEST_SHARE
    reach, (x, y) = world.rocks.extents_m[:, 0] / 2, world.rocks.position_w[:, :2].T
    here = (x >= left - reach) & (x <= right + reach) & (y >= bottom - reach) & (y <= top + reach)
    rocks = world.rocks.chosen(here & (world.rocks.diameters_m >= smallest))
    if not len(rocks):
        return
    shapes = outlines(rocks.section_ratio, rocks.extents_m[:, 0], rocks.extents_m[:, 1], rocks.yaw_rad)
    collection = PolyCollection(
        list(shapes + rocks.position_w[:, None, :2]),
        facecolors=ROCK(np.clip(rocks.extents_m[:, 2] / TALL_M, 0.0, 1.0)),
        edgecolors=ROCK_EDGE,
        linewidths=0.3,
        zorder=3,
    )
    axes.add_collection(collection)


def _draw_ends(axes: Axes, world: World) -> None:
    """Start with its heading, goal with its circle."""
    x, y = world.start.position_w[:2]
    yaw = euler_from_quaternion(world.start.quaternion_w)[2]
    arrow = {"arrowstyle": "-|>", "color": "lime", "linewidth": 1.8}
    axes.annotate("", (x + 1.2 * np.cos(yaw), y + 1.2 * np.sin(yaw)), (x, y), arrowprops=arrow, zorder=7)
    axes.plot(
        x, y, marker="o", linestyle="", markersize=7, color="lime", markeredgecolor="black", label="start", zorder=7
    )
    goal = world.goal_w[:2]
    axes.add_patch(Circle(goal, world.scenario.goal.radius_m, fill=False, edgecolor="red", linewidth=1.5, zorder=7))
    axes.plot(
        *goal, marker="*", linestyle="", markersize=13, color="red", markeredgecolor="black", label="goal", zorder=7
    )


def _patch_triangles(patch: HeightField) -> FloatArray:
    """Triangles (F, 3, 3) of a height field, two a cell, facing up."""
    x, y = grid_points(patch)
    points = np.stack([*np.meshgrid(x, y), patch.heights_m], axis=-1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    lower, upper = np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)
    return np.concatenate([lower.reshape(-1, 3, 3), upper.reshape(-1, 3, 3)])


def _unit_normals(triangles: FloatArray) -> FloatArray:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
