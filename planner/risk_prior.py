"""What is not known before a drive - soil, and the errors of the map - as distributions to draw from.

After Golda, Iagnemma and Dubowsky, "Probabilistic modeling and analysis of high-speed rough-terrain mobile robots",
ICRA 2004, who draw terrain and vehicle parameters for a Monte Carlo forecast; the distributions are ours.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache
from math import inf, pi, radians

import numpy as np
from scipy import ndimage

from worlds.errors import InputError
from worlds.soil import Soil
from worlds.types import FloatArray, HeightField

LEAST_FRICTION_RAD, MOST_FRICTION_RAD = radians(5.0), radians(60.0)


@dataclass(frozen=True)
class SoilSpread:
    """One sigma of what soils of one name differ by: factors (of a logarithm) and an angle."""

    cohesion: float = 0.30
    friction_deg: float = 2.0
    moduli: float = 0.30  # both pressure-sinkage moduli together
    shear_modulus: float = 0.20


@dataclass(frozen=True)
class SoilPrior:
    """Soils that may lie there, how likely each is, and how far a soil may be from the figures of its name."""

    soils: tuple[Soil, ...]
    weights: tuple[float, ...]  # need not sum to 1
    spread: SoilSpread = SoilSpread()


@dataclass(frozen=True)
class MapError:
    """How far the ground is from the map of it."""

    sd_m: float  # of a height
    correlation_m: float  # distance over which errors of the map are alike
    roughness_m: float = 0.0  # rms of what is too fine for the map: bumps as wide as a wheel, stones
    relief_m: float = 0.0  # rms of what lies between the map's heights, in ``sd_m``; 0: that is of the heights only


def check_prior(prior: SoilPrior) -> None:
    """Raise InputError, which names the part and what is allowed, for a prior that no soil can be drawn from."""
    if not prior.soils or len(prior.soils) != len(prior.weights):
        raise InputError(
            f"soil prior: {len(prior.soils)} soils and {len(prior.weights)} weights; "
            "one weight for each of at least one soil is wanted"
        )
    for weight in prior.weights:
        _within("soil prior: weight", weight, 0.0, inf)
    _within("soil prior: sum of the weights", sum(prior.weights), 1e-9, inf)
    for part in fields(prior.spread):
        most = 45.0 if part.name == "friction_deg" else 3.0
        _within(f"soil prior: spread.{part.name}", getattr(prior.spread, part.name), 0.0, most)


def check_map_error(error: MapError) -> None:
    """Raise InputError, which names the part and what is allowed, for an error that no map can have."""
    _within("map error: sd_m", error.sd_m, 0.0, 100.0)
    _within("map error: roughness_m", error.roughness_m, 0.0, 10.0)
    _within("map error: relief_m", error.relief_m, 0.0, 10.0)
    _within("map error: correlation_m", error.correlation_m, 1e-3, 1e5)


def draw_soils(prior: SoilPrior, count: int, rng: np.random.Generator) -> tuple[Soil, ...]:
    """Soils drawn from the prior."""
    check_prior(prior)
    share = np.asarray(prior.weights) / sum(prior.weights)
    which = rng.choice(len(prior.soils), count, p=share)
    normal = rng.normal(size=(count, 4))
    return tuple(_drawn(prior.soils[i], prior.spread, row) for i, row in zip(which, normal, strict=True))


def draw_error(field: HeightField, error: MapError, rng: np.random.Generator) -> FloatArray:
    """Errors (ny, nx) of the heights of a field: normal, of the wanted spread, alike over the wanted distance.

    White noise under a Gaussian of sigma d / 2 has the correlation exp(-(x / d)^2).
    """
    shape, sigma = field.heights_m.shape, 0.5 * error.correlation_m / field.resolution_m
    if error.sd_m == 0.0:
        return np.zeros(shape)
    white = rng.normal(size=shape)
    if sigma < 0.2:  # cells farther apart than errors are alike
        return error.sd_m * white
    # Of infinite white noise; a wrapped border keeps the variance the same everywhere.
    smooth = ndimage.gaussian_filter(white, sigma, mode="wrap")
    return np.asarray(error.sd_m * smooth / _kept(shape, sigma))


@cache
def _kept(shape: tuple[int, ...], sigma: float) -> float:
    """Standard deviation that a wrapped Gaussian filter leaves of white noise."""
    kept = 1.0
    for size in shape:
        impulse = np.zeros(size)
        impulse[0] = 1.0
        kept *= float(np.linalg.norm(ndimage.gaussian_filter1d(impulse, sigma, mode="wrap")))
    return kept


def _drawn(soil: Soil, spread: SoilSpread, normal: FloatArray) -> Soil:
    """The soil, off its figures by so many sigma in cohesion, friction, moduli and shear modulus."""
    moduli = float(np.exp(spread.moduli * normal[2]))
    friction = soil.friction_angle_rad + spread.friction_deg * pi / 180.0 * normal[1]
    return replace(
        soil,
        cohesion_Pa=soil.cohesion_Pa * float(np.exp(spread.cohesion * normal[0])),
        friction_angle_rad=float(np.clip(friction, LEAST_FRICTION_RAD, MOST_FRICTION_RAD)),
        cohesive_modulus=soil.cohesive_modulus * moduli,
        frictional_modulus=soil.frictional_modulus * moduli,
        shear_modulus_m=soil.shear_modulus_m * float(np.exp(spread.shear_modulus * normal[3])),
    )


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        allowed = f"at least {low:g}" if high == inf else f"{low:g} to {high:g}"
        raise InputError(f"{name} = {value:g}: allowed are {allowed}")
