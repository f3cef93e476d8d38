"""PyBullet's TinyRenderer behind the `Renderer` protocol: an independent check on the rasteriser, but slow."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import numpy as np

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.heightfield_body import add_heightfield
from rover_sim.sim.renderer import GROUND_ID, SKY_ID, RenderedImage, check_camera, pose_rotation
from worlds.geometry import to_sun
from worlds.types import CameraModel, FloatArray, IntArray, Pose, TriangleMesh, World

NEAR_M, FAR_M = 0.05, 400.0
LIGHT_DISTANCE_M = 100.0


class TinyRenderer:
    """Takes pictures of one world with a physics client of its own; `close` it, or use it in a ``with``."""

    def __init__(self, world: World, *, shadow: bool = True) -> None:
        sun = world.scenario.sun
        self._to_sun = to_sun(sun.azimuth_deg, sun.elevation_deg)
        self._shadow = shadow
        self._client: int | None = int(pybullet.connect(pybullet.DIRECT))
        # Body number -> id; body numbers count up from zero.
        bodies = {add_heightfield(self._client, world.ground): GROUND_ID}
        bodies |= add_obstacles(self._client, world.picture_mesh)
        self._id_of_body = np.array([bodies[body] for body in range(len(bodies))], dtype=np.int32)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the physics client; a second call does nothing."""
        if self._client is not None:
            pybullet.disconnect(self._client)
            self._client = None

    def render(self, camera: CameraModel, camera_pose: Pose) -> RenderedImage:
        """Picture, depth and ids from a pose whose axes are the camera's right, down and forward."""
        check_camera(camera)
        if self._client is None:
            raise RuntimeError("render after close")
        width, height = camera.width_px, camera.height_px
        _, _, colour, buffer, bodies = pybullet.getCameraImage(
            width,
            height,
            viewMatrix=view_matrix(camera_pose).T.ravel().tolist(),
            projectionMatrix=projection_matrix(camera).T.ravel().tolist(),
            renderer=pybullet.ER_TINY_RENDERER,
            lightDirection=self._to_sun,
            lightDistance=LIGHT_DISTANCE_M,
            shadow=int(self._shadow),
            physicsClientId=self._client,
        )
        body = np.asarray(bodies, dtype=np.int32).reshape(height, width)
        ids = np.where(body < 0, np.int32(SKY_ID), self._id_of_body[np.maximum(body, 0)])
        return RenderedImage(
            np.asarray(colour, dtype=np.uint8).reshape(height, width, 4)[:, :, :3].copy(),
            metric_depth(np.asarray(buffer, dtype=np.float64).reshape(height, width), ids),
            ids,
        )

    def clasts(self, camera: CameraModel, camera_pose: Pose, picture: RenderedImage) -> IntArray:  # noqa: ARG002
        """The ids of ``picture``: this renderer draws no ground texture, hence no pebbles."""
        return picture.ids


def add_obstacles(client: int, mesh: TriangleMesh) -> dict[int, int]:
    """Add one visual body per owner, so that the segmentation tells them apart; body number -> owner id."""
    bodies = {}
    for owner in np.unique(mesh.owner):
        used, corner = np.unique(mesh.faces[mesh.owner == owner], return_inverse=True)
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=mesh.vertices_m[used].tolist(),
            indices=corner.ravel().tolist(),
            rgbaColor=[0.5, 0.5, 0.5, 1.0],
            physicsClientId=client,
        )
        bodies[int(pybullet.createMultiBody(0.0, -1, shape, physicsClientId=client))] = int(owner)
    return bodies


def view_matrix(pose: Pose) -> FloatArray:
    """World to OpenGL eye axes (right, up, backward), (4, 4)."""
    # OpenGL's y and z are the camera's down and forward, reversed.
    turn = (pose_rotation(pose) * [1.0, -1.0, -1.0]).T
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, -turn @ pose.position_w
    return matrix


def projection_matrix(camera: CameraModel) -> FloatArray:
    """OpenGL projection (4, 4) of a pinhole camera with its principal point in the middle."""
    matrix = np.zeros((4, 4))
    # TinyRenderer samples a pixel at its corner; half a pixel of shift makes that its centre.
    matrix[0, 2], matrix[1, 2] = 1 / camera.width_px, 1 / camera.height_px
    matrix[0, 0], matrix[1, 1] = 2 * camera.focal_px / camera.width_px, 2 * camera.focal_px / camera.height_px
    matrix[2, 2], matrix[2, 3] = (FAR_M + NEAR_M) / (NEAR_M - FAR_M), 2 * FAR_M * NEAR_M / (NEAR_M - FAR_M)
    matrix[3, 2] = -1.0
    return matrix


def metric_depth(buffer: FloatArray, ids: IntArray) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    """Depth along the camera's axis, m, of an OpenGL depth buffer (0..1); inf where the ids say sky."""
    depth = FAR_M * NEAR_M / (FAR_M - (FAR_M - NEAR_M) * np.clip(buffer, 0.0, 1.0))
    return np.where(ids == SKY_ID, np.inf, depth).astype(np.float32)
