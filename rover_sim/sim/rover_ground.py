"""A rover on the ground: soil under its wheels and the belly that may touch."""

from __future__ import annotations

from math import sqrt

import numpy as np

from rover_sim.sim import linkage
from rover_sim.sim import soil_kernels as kernel
from rover_sim.sim.motion_kernels import BODY_COLUMNS, MOTION_COLUMNS, locate
from rover_sim.sim.rover import Box, RoverModel
from rover_sim.sim.ruts import RutField
from rover_sim.sim.terramechanics import WheelSoil
from worlds.types import FloatArray, World

_BELLY_FRICTION = 0.5
_BELLY_DAMPING_RATIO = 0.5


class RoverGround:
    """What the ground does to one rover; positions are relative to the centre of mass of its chassis."""

    def __init__(self, world: World, rover: RoverModel) -> None:
        self.soil = WheelSoil(
            world.ground,
            world.soil,
            rover,
            world.scenario.gravity_m_s2,
            soil_map=world.soil_map,
            ruts=RutField(world.ground) if world.scenario.soil.ruts else None,
        )
        centre = np.array(rover.chassis.centre_of_mass_m)
        self._masses_kg, self._arm_offsets = linkage.masses(rover), linkage.arm_offsets(rover)
        self._hubs, self._arms = linkage.hub_table(rover), linkage.arm_table(rover)
        self._points = belly_points(rover) - centre
        stiffness = rover.wheel.stiffness_N_m
        share = rover.mass_kg / len(self._hubs)
        damping = 2.0 * _BELLY_DAMPING_RATIO * sqrt(stiffness * share)
        self._belly = np.array([stiffness, damping, _BELLY_FRICTION])
        self.raw = np.zeros(13 + len(self._hubs) + 2 * len(self._arms))
        self.body = np.zeros(BODY_COLUMNS)
        self.motion = np.zeros((len(self._hubs), MOTION_COLUMNS))
        self.wrench = np.zeros(6)

    def step(self, dt: float) -> int:
        """Forces for the motion in ``raw``, into ``soil.result`` and ``wrench``; number of belly points that touch."""
        soil = self.soil
        return int(
            kernel.ground_forces(
                soil.ground,
                soil.grid,
                soil.soils,
                soil.rut_view,
                soil.tables,
                soil.constants,
                self._points,
                self._belly,
                self._hubs,
                self._arms,
                self.raw,
                self.body,
                self.motion,
                soil.state,
                soil.result,
                self.wrench,
                dt,
            )
        )

    def locate(self) -> tuple[FloatArray, FloatArray]:
        """Hubs (n, 3) and centre of mass (3,) of the whole rover in the world, for ``raw`` as it is now."""
        locate(self.raw, self._hubs, self._arms, self.body, self.motion)
        centre = linkage.mass_centre_w(self._masses_kg, self._arm_offsets, self.body, self.motion, self._arms)
        return self.motion[:, :3].copy(), centre


def belly_points(rover: RoverModel) -> FloatArray:
    """Points (n, 3) of the hull's underside, body axes: a grid under the lowest box, the corners of the others."""
    lowest = min(rover.chassis.box, key=lambda box: box.centre_m[2] - 0.5 * box.size_m[2])
    parts = [_underside(box, (5, 3) if box is lowest else (2, 2)) for box in rover.chassis.box]
    return np.concatenate(parts)


def _underside(box: Box, counts: tuple[int, int]) -> FloatArray:
    (length, width, height), (x, y, z) = box.size_m, box.centre_m
    along = np.linspace(x - length / 2, x + length / 2, counts[0])
    across = np.linspace(y - width / 2, y + width / 2, counts[1])
    u, v = np.meshgrid(along, across)
    return np.stack([u.ravel(), v.ravel(), np.full(u.size, z - height / 2)], axis=1)
