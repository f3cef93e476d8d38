"""Compiled lighting of what the raster kernels left: textures, bumps, sun, shadow, sky light and haze."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_sim.sim.raster_kernels import EMPTY_TAG, GROUND_TAG, KeyArray
from rover_sim.sim.rut_shading import NO_LOOK, Depths, Marks, look, marked
from rover_sim.sim.shade_types import Colour, Lens, Light, ShadowMap, Stones, Surface
from rover_sim.sim.texture_kernels import Texels, sample_plane, sample_solid, sample_strip
from rover_sim.sim.textures import Pyramid
from worlds.types import ByteArray, IntArray

Slopes = NDArray[np.float32]
CHURNED_DARKER = 0.08  # share of its brightness that soil loses where a wheel was
CHURNED_BUMPS = 0.3  # how much rougher it is
CHURNED_BURIES = 0.8  # share of the pebbles that are pressed in
LEVEL_LIFT, STEEP_LIFT = 0.1, 4.0  # share of the lift over level ground, and more of it by its slope
Grid = tuple[float, float, float, float, float]  # x and y of the first sample, samples a metre, slopes beyond
Shear = tuple[float, float, float, float, float, float]  # u = 0 x + 1 z + 2, v = 0 y + 3 z + 4, key = z + 5


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _lit(top_key: KeyArray, shear: Shear, x: float, y: float, z: float) -> float:
    """Share of the sun (0..1) that reaches a point: four comparisons, blended; outside the map all of it."""
    u = shear[0] * x + shear[1] * z + shear[2] - 0.5
    v = shear[0] * y + shear[3] * z + shear[4] - 0.5
    key = z + shear[5]
    j, i = int(np.floor(u)), int(np.floor(v))
    if i < 0 or j < 0 or i >= top_key.shape[0] - 1 or j >= top_key.shape[1] - 1:
        return 1.0
    u, v = u - j, v - i
    i0, j0, i1, j1 = np.uintp(i), np.uintp(j), np.uintp(i + 1), np.uintp(j + 1)
    top = (1 - u) * (key >= top_key[i0, j0]) + u * (key >= top_key[i0, j1])
    bottom = (1 - u) * (key >= top_key[i1, j0]) + u * (key >= top_key[i1, j1])
    share: float = (1 - v) * top + v * bottom
    return share


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _ground_slope(s: Slopes, grid: Grid, x: float, y: float) -> tuple[float, float]:
    """Bilinear slopes of the ground; those of the plane beyond its edge."""
    ny, nx = s.shape[0], s.shape[1]
    u, v = (x - grid[0]) * grid[2], (y - grid[1]) * grid[2]
    if u < 0.0 or v < 0.0 or u > nx - 1 or v > ny - 1:
        return grid[3], grid[4]
    j, i = min(int(u), nx - 2), min(int(v), ny - 2)
    u, v = u - j, v - i
    i0, j0, i1, j1 = np.uintp(i), np.uintp(j), np.uintp(i + 1), np.uintp(j + 1)
    wa, wb, wc, wd = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
    return (
        wa * s[i0, j0, 0] + wb * s[i0, j1, 0] + wc * s[i1, j0, 0] + wd * s[i1, j1, 0],
        wa * s[i0, j0, 1] + wb * s[i0, j1, 1] + wc * s[i1, j0, 1] + wd * s[i1, j1, 1],
    )


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _illuminate(
    light: Light,
    top_key: KeyArray,
    shear: Shear,
    point: Colour,
    smooth: Colour,
    bumped: Colour,
    colour: Colour,
    bias_m: float,
    share: float,
) -> Colour:
    """Light that a surface of ``colour`` sends; the true normal places the shadow, the bumped one shades.

    ``share``: how much of the sun passes what the shadow map does not know.
    """
    s = light.to_sun_w
    sun = bumped[0] * s[0] + bumped[1] * s[1] + bumped[2] * s[2]
    if sun <= 0.0 or smooth[0] * s[0] + smooth[1] * s[1] + smooth[2] * s[2] <= 0.0:
        sun = 0.0
    else:
        sun *= share * _lit(
            top_key, shear, point[0] + bias_m * smooth[0], point[1] + bias_m * smooth[1], point[2] + bias_m * smooth[2]
        )
    sky = 0.6 + 0.4 * bumped[2]  # a face that looks down sees little of the sky
    return (
        colour[0] * (sun * light.sun[0] + sky * light.ambient[0]),
        colour[1] * (sun * light.sun[1] + sky * light.ambient[1]),
        colour[2] * (sun * light.sun[2] + sky * light.ambient[2]),
    )


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _unit(x: float, y: float, z: float) -> Colour:
    """The vector at length one."""
    scale = 1.0 / np.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _ground(
    slopes: Slopes,
    grid: Grid,
    fine: Texels,
    fine_px: int,
    fine_per_m: float,
    drift: Texels,
    drift_px: int,
    drift_per_m: float,
    light: Light,
    top_key: KeyArray,
    shear: Shear,
    point: Colour,
    ray: Colour,
    minor_m: float,
    bias_m: float,
    directory: IntArray,
    rut_depth: Depths,
    rut_grid: tuple[float, float, float],
) -> tuple[float, float, float, float]:
    """Colour of the ground at a point that a pixel of width ``minor_m`` sees along ``ray``, and the way on to a rut."""
    gx, gy = _ground_slope(slopes, grid, point[0], point[1])
    smooth = _unit(-gx, -gy, 1.0)
    cosine = max(abs(smooth[0] * ray[0] + smooth[1] * ray[1] + smooth[2] * ray[2]), 0.04)
    major_m = minor_m / cosine
    seen = NO_LOOK
    if marked(directory, rut_grid, point[0], point[1]):
        seen = look(directory, rut_depth, rut_grid, point, ray, (gx, gy), light.to_sun_w, minor_m, major_m)
    way, churned = seen[0], seen[3]
    # Above the rut on the natural ground: what casts shadows there does so in the rut.
    point = (
        point[0] + way * ray[0],
        point[1] + way * ray[1],
        point[2] + way * (gx * ray[0] + gy * ray[1]),
    )
    normal = _unit(seen[1] - gx, seen[2] - gy, 1.0)
    t = sample_strip(fine, fine_px, fine_per_m, point, ray, minor_m, major_m)
    # Turned by about 37 degrees so that the two periods do not line up.
    dx, dy = 0.8 * point[0] - 0.6 * point[1], 0.6 * point[0] + 0.8 * point[1]
    broad = sample_plane(drift, drift_px, drift_per_m, dx, dy, np.sqrt(minor_m * major_m))
    strength = broad[3] * (1.0 + CHURNED_BUMPS * churned)
    brightness = broad[0] * (1.0 + strength * (t[0] - 1.0)) * (1.0 - CHURNED_DARKER * churned)
    pebble = min(strength * t[3], 1.0) * (1.0 - CHURNED_BURIES * churned)
    bumped = _unit(
        normal[0] - normal[2] * (strength * t[1] + 0.8 * broad[1] + 0.6 * broad[2]),
        normal[1] - normal[2] * (strength * t[2] - 0.6 * broad[1] + 0.8 * broad[2]),
        normal[2],
    )
    colour = (
        brightness * (light.sand[0] + pebble * (light.pebble[0] - light.sand[0])),
        brightness * (light.sand[1] + pebble * (light.pebble[1] - light.sand[1])),
        brightness * (light.sand[2] + pebble * (light.pebble[2] - light.sand[2])),
    )
    # Level ground throws no shadow on itself: lifted less, it keeps the shadows of low rocks at their length.
    lift_m = bias_m * min(1.0, LEVEL_LIFT + STEEP_LIFT * np.sqrt(gx * gx + gy * gy))
    r, g, b = _illuminate(light, top_key, shear, point, smooth, bumped, colour, lift_m, seen[4])
    return r, g, b, way


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _stone(
    normals: Texels,
    blocks: IntArray,
    looks: Texels,
    face: int,
    solid: Texels,
    solid_px: int,
    solid_per_m: float,
    light: Light,
    top_key: KeyArray,
    shear: Shear,
    point: Colour,
    minor_m: float,
    bias_m: float,
) -> Colour:
    """Colour of a rock's face at a point."""
    n = (float(normals[face, 0]), float(normals[face, 1]), float(normals[face, 2]))
    rock = blocks[face]
    x, y, z = point[0] + looks[rock, 4], point[1] + looks[rock, 5], point[2] + looks[rock, 6]
    fine = sample_solid(solid, solid_px, solid_per_m, x, y, z, minor_m)
    broad = sample_solid(solid, solid_px, solid_per_m, 0.23 * x, 0.23 * y, 0.23 * z, 0.23 * minor_m)
    rough = float(looks[rock, 7])
    g = (rough * (fine[1] + 0.6 * broad[1]), rough * (fine[2] + 0.6 * broad[2]), rough * (fine[3] + 0.6 * broad[3]))
    # Only the part of the gradient in the surface bends the normal (Perlin, "An image synthesizer", 1985).
    along = g[0] * n[0] + g[1] * n[1] + g[2] * n[2]
    bumped = _unit(n[0] - g[0] + along * n[0], n[1] - g[1] + along * n[1], n[2] - g[2] + along * n[2])
    brightness = 1.0 + rough * (fine[0] + broad[0] - 2.0)
    dust = looks[rock, 3] * max(bumped[2], 0.0) ** 2
    # A rock of two pixels or less would glitter as the camera moves: it takes on the colour of the sand around it.
    dust = max(dust, 1.0 - 0.5 * float(looks[rock, 8]) / minor_m)
    colour = (
        brightness * (looks[rock, 0] + dust * (light.sand[0] - looks[rock, 0])),
        brightness * (looks[rock, 1] + dust * (light.sand[1] - looks[rock, 1])),
        brightness * (looks[rock, 2] + dust * (light.sand[2] - looks[rock, 2])),
    )
    return _illuminate(light, top_key, shear, point, n, bumped, colour, bias_m, 1.0)


@njit(cache=True, nogil=True, fastmath=True)
def shade(
    keys: KeyArray,
    tags: IntArray,
    lens: Lens,
    surface: Surface,
    fine: Pyramid,
    drift: Pyramid,
    stones: Stones,
    solid: Pyramid,
    shadow: ShadowMap,
    bias_m: float,
    light: Light,
    marks: Marks,
    image: ByteArray,
) -> None:
    """Fill ``image`` (H, W, 3) from the keys (1 / depth) and tags (H, W) of the raster kernels.

    Keys of pixels that look into a rut are set to its depth.
    """
    rows, columns = keys.shape
    r, eye = lens.rotation, lens.eye_w
    # Taken out of the tuples once: inside the loop each would cost an atomic count of references.
    slopes, grid = (
        surface.slopes,
        (surface.x0_m, surface.y0_m, 1.0 / surface.resolution_m, surface.slope_beyond_x, surface.slope_beyond_y),
    )
    fine_data, drift_data, solid_data = fine.data, drift.data, solid.data
    normals, blocks, looks = stones.normal, stones.block, stones.look
    directory, rut_depth, rut_grid = marks.directory, marks.depth_m, (marks.x0_m, marks.y0_m, marks.per_m)
    top_key, m = shadow.key, shadow.matrix
    shear = (m[0, 0], m[0, 2], m[0, 3], m[1, 2], m[1, 3], m[3, 3])
    for row in range(rows):
        for column in range(columns):
            u, v = (column + 0.5 - columns / 2) / lens.focal_px, (row + 0.5 - rows / 2) / lens.focal_px
            dx, dy = r[0, 0] * u + r[0, 1] * v + r[0, 2], r[1, 0] * u + r[1, 1] * v + r[1, 2]
            dz = r[2, 0] * u + r[2, 1] * v + r[2, 2]
            ray = _unit(dx, dy, dz)
            depth_share = 1.0 / np.sqrt(dx * dx + dy * dy + dz * dz)
            up = min(max(1.6 * ray[2], 0.0), 1.0)
            sky = (
                light.horizon[0] + up * (light.zenith[0] - light.horizon[0]),
                light.horizon[1] + up * (light.zenith[1] - light.horizon[1]),
                light.horizon[2] + up * (light.zenith[2] - light.horizon[2]),
            )
            tag = tags[row, column]
            clear = 0.0
            colour = (0.0, 0.0, 0.0)
            if tag != EMPTY_TAG:
                depth = 1.0 / keys[row, column]
                point = (eye[0] + depth * dx, eye[1] + depth * dy, eye[2] + depth * dz)
                clear = np.exp(-light.haze_per_m * depth)
                minor_m = depth / lens.focal_px
                # Far tiles and rocks are drawn coarse and may lie that much below what casts the shadow.
                lift_m = bias_m + 0.7 * minor_m
                if tag == GROUND_TAG:
                    red, green, blue, way = _ground(
                        slopes,
                        grid,
                        fine_data,
                        fine.size_px,
                        fine.per_m,
                        drift_data,
                        drift.size_px,
                        drift.per_m,
                        light,
                        top_key,
                        shear,
                        point,
                        ray,
                        minor_m,
                        lift_m,
                        directory,
                        rut_depth,
                        rut_grid,
                    )
                    colour = (red, green, blue)
                    if way != 0.0:  # the ray is as long as the depth over its cosine to the camera's axis
                        keys[row, column] = 1.0 / (depth + way * depth_share)
                else:
                    colour = _stone(
                        normals,
                        blocks,
                        looks,
                        tag - 1,
                        solid_data,
                        solid.size_px,
                        solid.per_m,
                        light,
                        top_key,
                        shear,
                        point,
                        minor_m,
                        lift_m,
                    )
            for channel in range(3):
                value = clear * colour[channel] + (1.0 - clear) * sky[channel]
                image[row, column, channel] = np.uint8(min(max(value + 0.5, 0.0), 255.0))


@njit(cache=True, nogil=True)
def soften_outlines(image: ByteArray, tags: IntArray, out: ByteArray) -> None:
    """Copy ``image`` (H, W, 3) to ``out``, with the outlines of rocks and of the sky averaged over their neighbours.

    A pixel is lit at its centre alone, so that outlines would be stairs and far rocks would glitter; a lens and a
    pixel of some width average them.
    """
    rows, columns = tags.shape
    for row in range(rows):
        above, below = max(row - 1, 0), min(row + 1, rows - 1)
        for column in range(columns):
            left, right = max(column - 1, 0), min(column + 1, columns - 1)
            here = min(tags[row, column], 1)
            edge = (
                min(tags[above, column], 1) != here
                or min(tags[below, column], 1) != here
                or min(tags[row, left], 1) != here
                or min(tags[row, right], 1) != here
            )
            for channel in range(3):
                value = int(image[row, column, channel])
                if edge:
                    around = int(image[above, column, channel]) + int(image[below, column, channel])
                    around += int(image[row, left, channel]) + int(image[row, right, channel])
                    value = (4 * value + around + 4) // 8
                out[row, column, channel] = value
