"""The hemisphere and the nine rock formations, and how random rocks take their shape.

The 2004 paper (section 4) measures a rock by nine diameters A0..A8 across its first principal axis and picks one of
nine formation models by the direction of that axis; its figure of the models is not reproduced anywhere. Our reading:
A0..A8 are equally spaced along the axis from tip to tip; formation n in 1..9 belongs to axis directions of
20 (n - 1) to 20 n degrees, modulo 180, and has a profile of its own; 0 is the hemisphere, for square proportions.
"""

from __future__ import annotations

import numpy as np

from worlds.types import FloatArray, IntArray, RockShape

SECTOR_RAD = np.pi / 9.0
PROBES = np.linspace(-1.0, 1.0, 9)  # places of A0..A8 along the axis, tips at -1 and 1

# Diameters A0..A8 over the largest one. The hemisphere is the circle 1 - s^2.
PROFILES = np.array(
    [
        np.sqrt(1.0 - PROBES**2),  # 0: hemisphere
        [0.00, 0.66, 0.87, 0.97, 1.00, 0.97, 0.87, 0.66, 0.00],  # 1: ellipsoid
        [0.10, 0.85, 1.00, 0.97, 0.88, 0.76, 0.62, 0.44, 0.00],  # 2: egg
        [0.35, 0.95, 1.00, 0.82, 0.65, 0.50, 0.36, 0.22, 0.00],  # 3: wedge
        [0.60, 0.94, 0.99, 1.00, 1.00, 1.00, 0.99, 0.94, 0.60],  # 4: loaf
        [0.00, 0.30, 0.55, 0.80, 1.00, 0.80, 0.55, 0.30, 0.00],  # 5: spindle
        [0.25, 0.86, 1.00, 0.84, 0.70, 0.84, 1.00, 0.86, 0.25],  # 6: waisted
        [0.30, 0.58, 0.62, 0.66, 0.90, 1.00, 1.00, 0.90, 0.40],  # 7: shouldered
        [0.00, 0.56, 0.70, 0.66, 0.60, 0.76, 1.00, 0.90, 0.20],  # 8: unequal twins
        [0.85, 1.00, 1.00, 1.00, 0.99, 0.95, 0.84, 0.60, 0.00],  # 9: bullet
    ]
)

MIN_ASPECT, MAX_ASPECT = 1.3, 2.2  # length over width of an elongated rock; less than 1.25 counts as square
USUAL_ASPECT = 1.6
PROFILE_SPREAD = 0.05  # one sigma of each diameter between rocks of one formation


def formation_of_axis(yaw_rad: float) -> int:
    """The formation, 1 to 9, of an elongated rock by the direction of its axis."""
    return int(np.mod(yaw_rad, np.pi) / SECTOR_RAD) % 9 + 1


def rock_shape(formation: int) -> RockShape:
    """The plain shape of a formation, without variation."""
    return RockShape(formation, tuple(float(ratio) for ratio in PROFILES[formation]))


def base_extents(formation: int, diameter_m: float, aspect: float | None = None) -> tuple[float, float]:
    """Length and width in metres of a rock whose base has the area of a circle of ``diameter_m``.

    ``aspect`` is length over width; None: 1 for the hemisphere, else 1.6.
    """
    usual = 1.0 if formation == 0 else USUAL_ASPECT
    stretch = float(np.sqrt(usual if aspect is None else aspect))
    return diameter_m * stretch, diameter_m / stretch


def draw_formations(count: int, allowed: tuple[int, ...], rng: np.random.Generator) -> tuple[IntArray, FloatArray]:
    """Formation (count,) with equal odds and yaw (count,) in radians, uniform within the formation's sector.

    With all formations allowed the yaw is uniform over the circle.
    """
    formation = np.asarray(allowed, dtype=np.int32)[rng.integers(len(allowed), size=count)]
    place, turn = rng.uniform(size=count), rng.integers(2, size=count)
    in_sector = (formation - 1 + place) * SECTOR_RAD + turn * np.pi
    return formation, np.asarray(np.where(formation == 0, 2 * np.pi * place, in_sector))


def draw_aspects(formation: IntArray, rng: np.random.Generator) -> FloatArray:
    """Length over width (N,) of rocks of these formations."""
    drawn = rng.uniform(MIN_ASPECT, MAX_ASPECT, size=len(formation))
    return np.asarray(np.where(formation == 0, 1.0, drawn))


def draw_profiles(formation: IntArray, rng: np.random.Generator) -> FloatArray:
    """Diameters A0..A8 (N, 9) over the largest, the formation's profile with some variation."""
    spread = np.clip(rng.normal(1.0, PROFILE_SPREAD, size=(len(formation), 9)), 0.85, 1.15)
    varied = PROFILES[formation] * np.where(formation[:, None] == 0, 1.0, spread)
    return np.asarray(varied / varied.max(axis=1, keepdims=True))


def diameters_along(profiles: FloatArray, places: FloatArray) -> FloatArray:
    """Relative diameters (N, M) at ``places`` (M,) in -1..1 of profiles (N, 9).

    Squares are interpolated, as the square of an ellipse's diameter is a parabola along its axis: tips come out round.
    """
    position = (np.clip(places, -1.0, 1.0) + 1.0) * 4.0
    left = np.minimum(position.astype(np.int64), 7)
    share = position - left
    squared = profiles**2
    return np.asarray(np.sqrt((1.0 - share) * squared[:, left] + share * squared[:, left + 1]))


def outlines(profiles: FloatArray, lengths_m: FloatArray, widths_m: FloatArray, yaws_rad: FloatArray) -> FloatArray:
    """Outlines (N, 32, 2) in metres of rock bases about their centres, counter-clockwise."""
    places = -np.cos(np.linspace(0.0, np.pi, 17))
    half_width = diameters_along(profiles, places) * widths_m[:, None] / 2.0
    along = np.concatenate([places, places[-2:0:-1]]) * lengths_m[:, None] / 2.0
    across = np.concatenate([-half_width, half_width[:, -2:0:-1]], axis=1)
    cos, sin = np.cos(yaws_rad)[:, None], np.sin(yaws_rad)[:, None]
    return np.stack([cos * along - sin * across, sin * along + cos * across], axis=-1)
