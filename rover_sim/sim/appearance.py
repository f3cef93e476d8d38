"""Colours: light of the Martian day, sand, and how each rock differs.

Levels are those of a picture of 0..255. They were set beside Curiosity Mastcam pictures of sand with rocks (mean red,
green, blue about 165, 140, 98; rocks darker and greyer; NASA/JPL-Caltech/MSSS).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rover_sim.sim.shade_types import Light
from worlds.geometry import to_sun
from worlds.scenario import Sun
from worlds.types import FloatArray, IntArray

SAND = np.array([176.0, 144.0, 101.0])  # level sand in full light
PEBBLE = np.array([138.0, 121.0, 97.0])
HORIZON = (212.0, 186.0, 148.0)
ZENITH = (178.0, 150.0, 116.0)
SUNLIGHT = np.array([0.97, 0.95, 0.91])
SKYLIGHT = np.array([0.40, 0.385, 0.375])
DUST_DEPTH = 0.15  # optical depth of the air over what the exposure takes care of
LARGEST_EXPOSURE = 1.6
HAZE_PER_M = 0.003

# Share of rocks, colour, spread of the logarithm of brightness: basalt, dusty, bright.
KINDS = (
    (0.62, (116.0, 112.0, 101.0), 0.15),
    (0.28, (150.0, 125.0, 94.0), 0.10),
    (0.10, (168.0, 154.0, 128.0), 0.07),
)
CYLINDER_COLOUR = (150.0, 150.0, 150.0)


def make_light(sun: Sun) -> Light:
    """Light of a day with the sun there; the exposure holds level sand at its usual brightness."""
    direction = to_sun(sun.azimuth_deg, sun.elevation_deg)
    up = direction[2]
    # Below the horizon the sun gives nothing; the sky still does.
    direct = SUNLIGHT * np.exp(-DUST_DEPTH * (1 / max(up, 0.02) - 1)) if up > 0 else np.zeros(3)
    exposure = min(1 / float((direct * max(up, 0.0) + SKYLIGHT)[1]), LARGEST_EXPOSURE)
    return Light(
        to_sun_w=direction,
        sun=_colour(exposure * direct),
        ambient=_colour(exposure * SKYLIGHT),
        sand=_colour(SAND),
        pebble=_colour(PEBBLE),
        horizon=HORIZON,
        zenith=ZENITH,
        haze_per_m=HAZE_PER_M,
    )


def _colour(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[float, float, float]:
    """Three plain numbers."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def draw_looks(
    owner: IntArray, radius_m: FloatArray, cylinders: frozenset[int], rng: np.random.Generator
) -> NDArray[np.float32]:
    """Colour, dust, place in the texture, roughness and width (N, 9) of each rock and cylinder."""
    n = len(owner)
    look = np.zeros((n, 9), dtype=np.float32)
    kind = rng.choice(len(KINDS), n, p=[share for share, _, _ in KINDS])
    brightness = np.exp(np.array([spread for _, _, spread in KINDS])[kind] * rng.standard_normal(n))
    look[:, :3] = np.array([colour for _, colour, _ in KINDS])[kind] * brightness[:, None]
    look[:, 3] = rng.uniform(0.05, 0.55, n)
    look[:, 4:7] = rng.uniform(0.0, 10.0, (n, 3))
    look[:, 7] = rng.uniform(0.7, 1.3, n)
    look[:, 8] = 2 * radius_m
    painted = np.isin(owner, list(cylinders))
    look[painted, :8] = (*CYLINDER_COLOUR, 0.0, 0.0, 0.0, 0.0, 0.15)
    return look
