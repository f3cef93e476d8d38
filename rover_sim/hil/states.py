"""The rover's motion as autopilots want it told: north-east-down from the start, body axes forward-right-down."""

from __future__ import annotations

import numpy as np

from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from rover_sim.sim.simulation import Simulation
from worlds.geometry import quaternion_from_rotation, rotation_from_quaternion
from worlds.types import FloatArray, Vector3

__all__ = ["STANDARD_GRAVITY_M_S2", "NedSampler", "NedState", "ned_state"]

_TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from east-north-up
_HELD_UP = np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])  # what a body at rest feels
_TO_FRD = np.array([1.0, -1.0, -1.0])  # from forward-left-up


class NedSampler:
    """Turns what the physics holds into `NedState`, once a step."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.restart()

    def restart(self) -> None:
        """Take the place of now for the start; the first sample then has no acceleration."""
        motion = self._simulation.chassis_motion
        self._start_w, self._velocity_w, self._time_s = motion[:3], motion[7:10], self._simulation.time_s

    def sample(self) -> NedState:
        """The state now; its acceleration is the mean since the sample before."""
        time_s, motion = self._simulation.time_s, self._simulation.chassis_motion
        span_s = time_s - self._time_s
        gained_w = motion[7:10] - self._velocity_w
        acceleration_w = gained_w / span_s if span_s > 0.0 else np.zeros(3)
        self._time_s, self._velocity_w = time_s, motion[7:10]
        return ned_state(time_s, motion, self._start_w, acceleration_w)


def ned_state(time_s: float, motion: FloatArray, start_w: FloatArray, acceleration_w: FloatArray) -> NedState:
    """From east-north-up and forward-left-up, as autopilots see it.

    ``motion`` (13,): place, quaternion (x, y, z, w), velocity and rate in the world; ``start_w`` (3,) m;
    ``acceleration_w`` (3,) m/s^2 without gravity.
    """
    rotation = rotation_from_quaternion(motion[3:7])  # body to world
    felt_w = acceleration_w + _HELD_UP
    x, y, z, w = quaternion_from_rotation(_TO_NED @ rotation * _TO_FRD).tolist()
    return NedState(
        time_s,
        _triple(_TO_NED @ (motion[:3] - start_w)),
        _triple(_TO_NED @ motion[7:10]),
        (w, x, y, z),
        _triple(_TO_FRD * (motion[10:13] @ rotation)),
        _triple(_TO_FRD * (felt_w @ rotation)),
    )


def _triple(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return x, y, z
