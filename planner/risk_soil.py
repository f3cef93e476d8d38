"""What slip a rover needs on a slope in a soil: four steady Wong-Reece wheels that share weight and pull.

The rear wheels roll in the ruts of the front ones. Along the wheel and across it the soil is sheared as one: the pull
points against the shear displacement, whose parts are the slip and the sideways way over the rim's, as in the
wheel-soil step of the simulator (docs/terramechanics.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, hypot, pi, sqrt, tan

import numpy as np
from numba import njit

from worlds.soil import Soil
from worlds.types import FloatArray
from worlds.wong_reece import WheelShape, wheel_curve

COLUMNS = 15  # slips of a curve, (j / 14)^2
PULL, RESISTANCE, SINKAGE, WALL, CONTACT = range(5)
RUT_SLIP_COLUMN = 5  # slip 0.13, at which the front wheels press the ruts
ARC_POINTS = 25  # of the integrals
ROUNDS = 8  # at most ...
CLOSE = 2e-4  # ... or until slips change by less
FALSE_POSITIONS = 4  # in a segment of the curve
EARTH_M_S2 = 9.80665  # at which soils are weighed


@dataclass(frozen=True, eq=False)
class Traction:
    """Soils as a rover feels them; forces over the weight."""

    # (soils, COLUMNS, 5): pull beyond that of a rolling wheel, resistance less that, sinkage m, resistance of the soil
    # beside the wheels, and length of the contact over the shear modulus
    curves: FloatArray
    load_exponent: FloatArray  # (soils,) of the sinkage over the load


def traction(soils: tuple[Soil, ...], wheel: WheelShape, load_N: float, gravity_m_s2: float) -> Traction:
    """Curves of soils for a rover whose wheels carry ``load_N`` each."""
    curves = np.array([_curve(soil, wheel, load_N, gravity_m_s2) for soil in soils])
    # Bekker: load ~ z^(n + 1/2) under a wheel.
    exponent = np.array([1.0 / (soil.sinkage_exponent + 0.5) for soil in soils])
    return Traction(np.ascontiguousarray(curves), exponent)


def _curve(soil: Soil, wheel: WheelShape, load_N: float, gravity_m_s2: float) -> FloatArray:
    front = wheel_curve(soil, wheel, load_N, COLUMNS, points=ARC_POINTS)
    rut = float(front[RUT_SLIP_COLUMN, 2])
    rear = wheel_curve(soil, wheel, load_N, COLUMNS, rut_m=rut, points=ARC_POINTS)
    thrust, resistance, _, _ = (0.5 / load_N * (front + rear)).T
    # Pull cannot fall with the shear displacement here: what a spinning wheel loses is its sinkage, the resistance.
    pull = np.maximum.accumulate(thrust - thrust[0])
    limit = soil.cohesion_Pa * wheel.width_m * front[:, 3] / load_N + tan(soil.friction_angle_rad)
    sinkage = 0.5 * (front[:, 2] + rut + rear[:, 2])
    wall = _wall(soil, wheel, sinkage, gravity_m_s2) / load_N
    return np.column_stack(
        [np.minimum(pull, limit), resistance - thrust[0], sinkage, wall, front[:, 3] / soil.shear_modulus_m]
    )


def _wall(soil: Soil, wheel: WheelShape, sinkage_m: FloatArray, gravity_m_s2: float) -> FloatArray:
    """Passive earth pressure (N) on the side of a wheel, after Rankine, over the segment of it that is in the soil."""
    passive = tan(0.25 * pi + 0.5 * soil.friction_angle_rad) ** 2
    chord = np.sqrt(2.0 * wheel.radius_m * sinkage_m)
    cohesion = 2.0 * soil.cohesion_Pa * sqrt(passive)
    weight = 0.5 * soil.unit_weight_N_m3 * gravity_m_s2 / EARTH_M_S2 * passive
    return np.asarray(chord * sinkage_m * (4.0 / 3.0 * cohesion + 16.0 / 15.0 * weight * sinkage_m))


@njit(cache=True)
def looked_up(curve: FloatArray, column: int, slip: float) -> float:
    """Value of a curve at a slip of 0 to 1."""
    last = curve.shape[0] - 1
    place = min(max(slip, 0.0), 1.0) ** 0.5 * last
    i = min(int(place), last - 1)
    value: float = curve[i, column] + (place - i) * (curve[i + 1, column] - curve[i, column])
    return value


@njit(cache=True)
def slips(curve: FloatArray, climb: float, side: float, scrub: float) -> tuple[float, float]:
    """Slip along (negative where it brakes) and sideways way over the rim's, both to hold a rover on a slope.

    ``climb`` and ``side``: parts of gravity along and across over that into the ground, ``climb`` positive uphill;
    ``scrub``: sideways way over the rim's that a bend makes of each wheel. Along 1 where no slip suffices.
    """
    along, across, held = 0.0, 0.0, 0.0
    for _ in range(ROUNDS):
        ahead = climb + looked_up(curve, RESISTANCE, abs(along))
        # Half of the way at a time: what the wall holds, the wheels need not.
        build = abs(across) * looked_up(curve, CONTACT, abs(along))
        wall = looked_up(curve, WALL, abs(along)) * (1.0 - (1.0 - exp(-build)) / build if build > 1e-3 else 0.5 * build)
        held += 0.5 * (min(wall, abs(side)) - held)
        aside = side - held if side > 0.0 else side + held
        need = hypot(ahead, aside)
        if need < 1e-9:
            return 0.0, 0.0
        size = _size(curve, need, scrub)
        before = along, across
        if size > 1.0:
            along, across = (1.0 if climb > 0.0 else -1.0), aside / need
        else:
            share = size / looked_up(curve, PULL, size)
            along, across = share * ahead, share * aside
        if abs(along - before[0]) + abs(across - before[1]) < CLOSE:
            break
    return along, across


@njit(cache=True)
def _size(curve: FloatArray, need: float, scrub: float) -> float:
    """Shear displacement over the contact length at which the soil gives ``need``, ``scrub`` across; 2 if never."""
    last = curve.shape[0] - 1
    high = _spare(curve, last, 0.0, need, scrub)
    if high <= 0.0:
        return 2.0
    first = sqrt(scrub) * last
    below, above = int(first), last
    while above - below > 1:
        middle = (below + above) // 2
        spare = _spare(curve, middle, 0.0, need, scrub)
        if spare >= 0.0:
            above, high = middle, spare
        else:
            below = middle
    # False position within a segment of the curve; the end that stays is halved (Illinois).
    start, end = max(first - below, 0.0), float(above - below)
    low, side = _spare(curve, below, start, need, scrub), 0
    for _ in range(FALSE_POSITIONS):
        place = end - high * (end - start) / (high - low)
        spare = _spare(curve, below, place, need, scrub)
        if spare >= 0.0:
            end, high, low, side = place, spare, 0.5 * low if side == 1 else low, 1
        else:
            start, low, high, side = place, spare, 0.5 * high if side == -1 else high, -1
    root: float = (below + end) / last
    return root * root


@njit(cache=True)
def _spare(curve: FloatArray, column: int, on: float, need: float, scrub: float) -> float:
    """What is left of the squared pull along and across at a place ``on`` past a column of the curve."""
    last = curve.shape[0] - 1
    size = ((column + on) / last) ** 2
    pull = curve[column, PULL] + (on * (curve[column + 1, PULL] - curve[column, PULL]) if on > 0.0 else 0.0)
    across = scrub / size if size > scrub else (1.0 if scrub > 0.0 else 0.0)
    spare: float = pull * pull * (1.0 - across * across) - need * need
    return spare
