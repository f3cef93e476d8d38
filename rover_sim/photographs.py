"""Pictures of the rover's camera on request, as files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from rover_sim.eyes import Eye
from rover_sim.files import atomic_path
from rover_sim.sim.renderer import add_noise, make_renderer
from rover_sim.sim.simulation import Simulation
from worlds.geometry import camera_pose
from worlds.types import ByteArray, CameraModel, World


class Photographer:
    """Renders what the camera sees from where it truly is."""

    def __init__(
        self, world: World, simulation: Simulation, camera: CameraModel, eye: Eye, rng: np.random.Generator
    ) -> None:
        self._simulation, self._camera, self._eye, self._rng = simulation, camera, eye, rng
        self._noise = world.scenario.camera.noise
        self._renderer = make_renderer(world, simulation.ruts)
        self._picture()  # the first one takes a second, in which the link would be silent

    def take(self, path: Path) -> bool:
        """Write a PNG, whole or not at all; False while the camera gives nothing; raises OSError if it cannot write."""
        if not self._eye.sees(self._simulation.time_s):
            return False
        image = self._picture()
        with atomic_path(path) as temporary:
            written = cv2.imwrite(str(temporary), image[..., ::-1])
            if not written:
                raise OSError(f"{path}: cannot be written")
        return True

    def _picture(self) -> ByteArray:
        pose = camera_pose(self._simulation.state.pose, self._camera)
        return add_noise(self._renderer.render(self._camera, pose).image, self._noise, self._rng)
