"""The software rasteriser: a deferred renderer of one world on one processor thread.

Order of a frame: choose tiles and rocks, project and draw them into keys and tags, then light each pixel once.
"""

from __future__ import annotations

import numpy as np

from rover_sim.sim import raster_kernels as raster
from rover_sim.sim import shade_kernels as shading
from rover_sim.sim.appearance import draw_looks, make_light
from rover_sim.sim.clasts import clast_ids, pebble_map, strength_of
from rover_sim.sim.ground_textures import ground_look
from rover_sim.sim.raster_scene import View, ground_plane, make_apron, make_tiles
from rover_sim.sim.renderer import RenderedImage, check_camera, pose_rotation
from rover_sim.sim.ruts import RutField, no_marks
from rover_sim.sim.shade_types import Lens, Stones, Surface
from rover_sim.sim.shadow_map import BIAS_TEXELS, SunShadows
from rover_sim.sim.stone_store import StoneStore
from rover_sim.sim.textures import drift_texture, rock_texture
from worlds.types import CameraModel, FloatArray, HeightField, IntArray, Pose, World

BAND_ROWS = 256  # of the ground are worked out at a time


class Rasteriser:
    """Takes pictures of one world with the ruts of now; the same world, ruts and pose give the same bytes."""

    def __init__(self, world: World, ruts: RutField | None = None) -> None:
        self._ruts = ruts
        rng = np.random.default_rng([world.seed, 0xCA3E7A])
        look = ground_look(world.scenario.terrain.texture, world.scenario.rocks.cfa, rng)
        self._fine, self._pebbles, self._drift = look.pyramid, pebble_map(look.pebbles), drift_texture(rng)
        self._strength, self._solid = strength_of(self._drift), rock_texture(rng)
        self._light = make_light(world.scenario.sun)
        self._store = StoneStore(world.shapes)
        cylinders = frozenset(cylinder.id for cylinder in world.cylinders)
        self._first_pebble = int(max(self._store.owner, default=0)) + 1  # pebbles are numbered after all rocks
        self._look = draw_looks(self._store.owner, self._store.radius_m, cylinders, rng)
        self._apron = make_apron(world.ground)
        self._set_ground(world.ground)

    def _set_ground(self, ground: HeightField) -> None:
        """Everything that follows from the heights: tiles, slopes, shadows."""
        self._ground = ground
        self._heights = np.ascontiguousarray(ground.heights_m, dtype=np.float64)
        self._grid = (*ground.origin_m, ground.resolution_m)
        self._tiles = make_tiles(ground)
        self._surface = make_surface(ground)
        self._shadows = SunShadows(ground, self._tiles, self._store, self._light.to_sun_w)

    def update_ground(self, heights_m: FloatArray) -> None:
        """Take new heights (ny, nx), m, of the same grid; slopes, tiles and shadows follow, rocks stay where they are.

        Raises ValueError for heights of another shape.
        """
        if heights_m.shape != self._ground.heights_m.shape:
            raise ValueError(f"heights of shape {heights_m.shape}: must be {self._ground.heights_m.shape}")
        self._set_ground(HeightField(heights_m, self._ground.resolution_m, self._ground.origin_m))

    def render(self, camera: CameraModel, camera_pose: Pose) -> RenderedImage:
        """Picture, depth and ids from a pose whose axes are the camera's right, down and forward."""
        check_camera(camera)
        view = View(
            np.asarray(camera_pose.position_w, dtype=float),
            pose_rotation(camera_pose),
            camera.focal_px,
            camera.width_px,
            camera.height_px,
        )
        keys = np.zeros((camera.height_px, camera.width_px), dtype=np.float32)
        tags = np.full(keys.shape, raster.EMPTY_TAG, dtype=np.int32)
        self._draw(view, keys, tags)
        shadow = self._shadows.around(view.eye_w)
        raw = np.empty((*keys.shape, 3), dtype=np.uint8)
        image = np.empty_like(raw)
        shading.shade(
            keys,
            tags,
            Lens(view.eye_w, np.ascontiguousarray(view.rotation), camera.focal_px),
            self._surface,
            self._fine,
            self._drift,
            Stones(self._store.normals, self._store.face_block, self._look),
            self._solid,
            shadow,
            BIAS_TEXELS / shadow.matrix[0, 0],
            self._light,
            no_marks() if self._ruts is None else self._ruts.marks,
            raw,
        )
        shading.soften_outlines(raw, tags, image)
        depth = np.full(keys.shape, np.inf, dtype=np.float32)
        np.divide(np.float32(1.0), keys, out=depth, where=keys > 0)
        return RenderedImage(image, depth, self._store.ids(tags))

    def clasts(self, camera: CameraModel, camera_pose: Pose, picture: RenderedImage) -> IntArray:
        """The ids of a picture from there with the pebbles of the ground texture, each numbered after all rocks."""
        return clast_ids(picture, camera, camera_pose, self._pebbles, self._strength, self._first_pebble)

    def _draw(self, view: View, keys: raster.KeyArray, tags: IntArray) -> None:
        """Fill the key and tag buffers."""
        matrix = view.matrix()
        tiles, drops = self._tiles.choose(view)
        raster.draw_tiles(self._heights, self._grid, tiles, drops, matrix, keys, tags)
        ranges = self._store.choose(view)
        faces = self._store.faces
        raster.draw_blocks(self._store.vertices_w, faces, ranges, len(faces), 1.0, matrix, keys, tags)
        apron = self._apron
        whole = np.array([[0, len(apron.vertices_m), 0, len(apron.faces)]], dtype=np.int32)
        raster.draw_blocks(apron.vertices_m, apron.faces, whole, 0, 1.0, matrix, keys, tags)


def make_surface(ground: HeightField) -> Surface:
    """Slopes by central differences, and those of the mean plane for what lies beyond the edge."""
    ny, nx = ground.heights_m.shape
    slopes = np.empty((ny, nx, 2), dtype=np.float32)
    for first in range(0, ny, BAND_ROWS):  # to save memory
        last, before = min(first + BAND_ROWS, ny), max(first - 1, 0)
        own, around = slice(first - before, last - before), ground.heights_m[before : last + 1]
        for axis, name in ((0, 1), (1, 0)):
            slopes[first:last, :, name] = np.gradient(around, ground.resolution_m, axis=axis)[own]
    beyond_x, beyond_y, _ = ground_plane(ground)
    return Surface(slopes, *ground.origin_m, ground.resolution_m, beyond_x, beyond_y)
