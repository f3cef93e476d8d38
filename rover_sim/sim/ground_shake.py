"""Shaking of the body by ground finer than the map's grid, and the chatter of the wheels' lugs.

Ground whose height has the spectral density ``G (n / n0)^-2`` over the waves per metre ``n`` (ISO 8608, n0 = 0.1 per
metre) is felt at a speed v as an acceleration of density ``16 pi^4 G n0^2 v f^2`` over the frequency f. A footprint
of length L takes the waves shorter than it, so the band ends at v / L, where most of it lies:
``rms = sqrt(16 pi^4 G n0^2 / (3 L^3)) v^2``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin, sqrt

import numpy as np

from rover_sim.sim.noise import ring
from worlds.scenario import GroundTexture
from worlds.sensor_tables import Imu
from worlds.types import FloatArray

# Geometric means of ISO 8608's classes B, C and D, cm3; which texture is which class is ours.
ROUGHNESS_CM3: dict[GroundTexture, float] = {"sand": 64.0, "ripples": 256.0, "gravel": 1024.0}
_REFERENCE_PER_M = 0.1
_DAMPING = 0.3  # a wide band
_AXES = np.array([0.5, 0.5, 1.0])  # share of the vertical shaking that is felt along each body axis; ours
_LEVER_M = 0.3  # over which vertical shaking rolls and pitches the body; ours
_LEAST_M_S = 1e-3


@dataclass(frozen=True)
class Ground:
    """What shakes: rms at 1 m/s, and the lengths."""

    rms_m_s2: float
    contact_m: float
    lug_m_s2: float
    lug_pitch_m: float


@dataclass(frozen=True, eq=False)
class Shake:
    """State of the shaking."""

    band: FloatArray  # (2, 5) as of `noise.ring`: along three axes, roll, pitch
    motion: FloatArray  # (6,) of the shaking, body axes: velocity (m/s) and angle (rad)
    lug_turns: float = 0.0


def ground_of(table: Imu, texture: GroundTexture) -> Ground:
    """What shakes a rover on a ground of that texture."""
    roughness = ROUGHNESS_CM3[texture] if table.roughness_cm3 is None else table.roughness_cm3
    return Ground(shake_rms(1e-6 * roughness, table.contact_m), table.contact_m, table.lug_m_s2, table.lug_pitch_m)


def shake_rms(roughness_m3: float, contact_m: float) -> float:
    """Vertical acceleration (rms, m/s2) at 1 m/s; it grows with the square of the speed."""
    return sqrt(16.0 * pi**4 * roughness_m3 * _REFERENCE_PER_M**2 / (3.0 * contact_m**3))


def begin(rng: np.random.Generator) -> Shake:
    """The shaking of a rover that stands: its phase is drawn, its size is zero."""
    return Shake(rng.standard_normal((2, 5)), np.zeros(6))


def shake(
    state: Shake, ground: Ground, speed_m_s: float, span_s: float, rng: np.random.Generator
) -> tuple[Shake, FloatArray, FloatArray]:
    """The state ``span_s`` later, and acceleration (3,) and rate (3,) of the shaking, body axes.

    Both are means over the span, as of a sensor that integrates: sampled, they would alias to a drift.
    """
    speed = max(speed_m_s, _LEAST_M_S)
    frequency = speed / ground.contact_m
    band = ring(state.band, frequency, _DAMPING, span_s, rng)
    turns = (state.lug_turns + speed_m_s * span_s / ground.lug_pitch_m) % 1.0
    size, omega = ground.rms_m_s2 * speed_m_s**2, 2.0 * pi * frequency
    motion = np.zeros(6)
    motion[:3] = size / omega * _AXES * band[0, :3]
    motion[3:5] = size / omega**2 / _LEVER_M * band[0, 3:]
    mean = (motion - state.motion) / span_s
    mean[2] += ground.lug_m_s2 * speed_m_s**2 * sin(2.0 * pi * turns)
    return Shake(band, motion, turns), mean[:3], mean[3:]
