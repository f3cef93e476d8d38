"""The rigid wheel on soft soil in steady motion: Wong-Reece stresses, their integrals and a table of them.

J. Y. Wong and A. R. Reece, J. Terramechanics 4(1) and 4(2), 1967; shear after Janosi and Hanamoto (1961);
sinkage exponent that grows with slip after Ding et al. (2015). The exit angle is zero.

In a rut of depth z_p the soil yields again at the pressure that made the rut (repetitive loading: Wong, "Theory of
Ground Vehicles", 2008, section 2.4): at a depth h below the floor of the rut it carries B (z_p + h)^n, reached over a
short reloading depth. Packed soil is sheared over a shorter way than loose soil (for dry sand K = 10 mm firm, 25 mm
loose: Wong 2008).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, exp, sin, sqrt, tan

import numpy as np
from numba import njit

from worlds.soil import Soil
from worlds.types import FloatArray

_LARGEST_ENTRY_RAD = 1.5  # a wheel sunk to its axle
_LOADS = 32
_SLIPS = 41
_RUTS = 8
_DEEPEST_SLIP = 0.3  # the deepest rut of the table is what the largest load presses at this slip
GROUSER_SHARE = 0.5  # of the grouser height that adds to the shearing radius


@dataclass(frozen=True)
class WheelShape:
    """What the soil feels of a wheel."""

    radius_m: float
    width_m: float
    grouser_m: float = 0.0

    @property
    def shear_radius_m(self) -> float:
        """Radius at which the soil is sheared, between rim and grouser tips."""
        return self.radius_m + GROUSER_SHARE * self.grouser_m


@dataclass(frozen=True)
class SteadyWheel:
    """Forces of one wheel in steady motion."""

    thrust_N: float  # forward part of the shear stress
    resistance_N: float  # backward part of the normal stress
    torque_Nm: float
    sinkage_m: float
    contact_m: float  # length of the arc in the soil

    @property
    def drawbar_N(self) -> float:
        """Pull that is left for the rover."""
        return self.thrust_N - self.resistance_N


@dataclass(frozen=True, eq=False)
class WheelTable:
    """Steady wheel forces over depth of rut, load and slip.

    Sheet k is a rut of ``deepest_rut_m`` (k / (sheets - 1))^2, row i is load i^2 ``load_step``^2 and column j is slip
    (j / (columns - 1))^2.
    """

    values: FloatArray  # (ruts, loads, slips, 4): thrust N, resistance N, sinkage below the rut m, contact length m
    load_step: float  # sqrt N between rows
    deepest_rut_m: float


@njit(cache=True)
def _integrals(entry: float, slip: float, p: FloatArray, count: int) -> tuple[float, float, float, float]:
    """Load, thrust, resistance and torque (N, N, N, N m) for an entry angle; trapezoid of ``count`` points."""
    stiffness, exponent0, exponent1, cohesion, tan_phi, shear_modulus = p[0], p[1], p[2], p[3], p[4], p[5]
    a0, a1, radius, width, shear_radius = p[6], p[7], p[8], p[9], p[10]
    rut, reload_depth, packed_share = p[11], p[12], p[13]
    exponent = exponent0 + exponent1 * slip
    peak = min((a0 + a1 * slip) * entry, entry)
    cos_entry, sin_entry = cos(entry), sin(entry)
    # The share of the depth that was packed before is sheared as dense soil.
    packed = rut / max(rut + radius * (1.0 - cos_entry), 1e-9)
    shear_modulus *= 1.0 - packed * (1.0 - packed_share)
    load = thrust = resistance = torque = 0.0
    for i in range(count):
        angle = entry * i / (count - 1)
        mirror = angle if angle >= peak else entry - angle * (entry - peak) / peak
        depth = max(radius * (cos(mirror) - cos_entry), 0.0)
        sigma = stiffness * (rut + depth) ** exponent
        if depth < reload_depth:
            sigma *= depth / reload_depth
        j = max(shear_radius * ((entry - angle) - (1.0 - slip) * (sin_entry - sin(angle))), 0.0)
        tau = (cohesion + sigma * tan_phi) * (1.0 - exp(-j / shear_modulus))
        weight = 0.5 if i * (count - 1 - i) == 0 else 1.0
        load += weight * (sigma * cos(angle) + tau * sin(angle))
        thrust += weight * tau * cos(angle)
        resistance += weight * sigma * sin(angle)
        torque += weight * tau
    scale = radius * width * entry / (count - 1)
    return load * scale, thrust * scale, resistance * scale, torque * scale * radius


@njit(cache=True)
def _entry_angle(load: float, slip: float, guess: float, p: FloatArray, count: int) -> float:
    """Entry angle (rad) at which the soil carries ``load``, by false position; the largest if never."""
    low, high = 0.0, min(1.2 * guess, _LARGEST_ENTRY_RAD)
    below, above = -load, _integrals(high, slip, p, count)[0] - load
    if above <= 0.0:
        low, below, high = high, above, _LARGEST_ENTRY_RAD
        above = _integrals(high, slip, p, count)[0] - load
        if above <= 0.0:
            return high
    elif 0.8 * guess > 0.0:
        value = _integrals(0.8 * guess, slip, p, count)[0] - load
        if value < 0.0:
            low, below = 0.8 * guess, value
        else:
            high, above = 0.8 * guess, value
    side = 0
    for _ in range(80):
        middle = low + (high - low) * below / (below - above)
        value = _integrals(middle, slip, p, count)[0] - load
        if abs(value) < 1e-7 * load or high - low < 1e-12:
            return middle
        if value < 0.0:
            low, below = middle, value
            above = 0.5 * above if side < 0 else above
            side = -1
        else:
            high, above = middle, value
            below = 0.5 * below if side > 0 else below
            side = 1
    return 0.5 * (low + high)


@njit(cache=True)
def _fill(table: FloatArray, load_step: float, p: FloatArray, count: int) -> None:
    radius, shear_radius = p[8], p[10]
    rows, columns = table.shape[0], table.shape[1]
    for i in range(1, rows):
        entry = _LARGEST_ENTRY_RAD
        for k in range(columns):
            slip = (k / (columns - 1)) ** 2
            entry = _entry_angle((i * load_step) ** 2, slip, entry, p, count)
            _, thrust, resistance, _ = _integrals(entry, slip, p, count)
            table[i, k, 0], table[i, k, 1] = thrust, resistance
            table[i, k, 2] = radius * (1.0 - cos(entry))
            table[i, k, 3] = shear_radius * entry


def _pack(soil: Soil, wheel: WheelShape, rut_m: float = 0.0) -> FloatArray:
    stiffness = soil.cohesive_modulus / wheel.width_m + soil.frictional_modulus
    return np.array(
        [
            stiffness,
            soil.sinkage_exponent,
            soil.sinkage_exponent_slip,
            soil.cohesion_Pa,
            tan(soil.friction_angle_rad),
            soil.shear_modulus_m,
            soil.stress_peak_offset,
            soil.stress_peak_slip,
            wheel.radius_m,
            wheel.width_m,
            wheel.shear_radius_m,
            rut_m,
            soil.reload_share * rut_m,
            soil.packed_shear_share,
        ]
    )


def steady_wheel(
    soil: Soil, wheel: WheelShape, load_N: float, slip: float, points: int = 241, *, rut_m: float = 0.0
) -> SteadyWheel:
    """Forces of a wheel that carries ``load_N`` at ``slip`` (0..1), by a trapezoid of ``points`` over the arc.

    ``rut_m``: depth of the rut that it rolls in; the sinkage is from the surface beside the rut.
    """
    p = _pack(soil, wheel, rut_m)
    entry = float(_entry_angle(load_N, slip, _LARGEST_ENTRY_RAD, p, points))
    _, thrust, resistance, torque = _integrals(entry, slip, p, points)
    sinkage = rut_m + wheel.radius_m * (1.0 - cos(entry))
    return SteadyWheel(thrust, resistance, torque, sinkage, wheel.shear_radius_m * entry)


@lru_cache(maxsize=32)
def wheel_table(soil: Soil, wheel: WheelShape, largest_load_N: float, points: int = 41) -> WheelTable:
    """Table of the steady wheel up to ``largest_load_N``, computed once for a soil and a wheel."""
    values = np.zeros((_RUTS, _LOADS, _SLIPS, 4))
    load_step = sqrt(largest_load_N) / (_LOADS - 1)
    deepest = steady_wheel(soil, wheel, largest_load_N, _DEEPEST_SLIP, points).sinkage_m
    for k, sheet in enumerate(values):
        _fill(sheet, load_step, _pack(soil, wheel, deepest * (k / (_RUTS - 1)) ** 2), points)
    values.flags.writeable = False
    return WheelTable(values, load_step, deepest)


def wheel_curve(
    soil: Soil, wheel: WheelShape, load_N: float, columns: int, *, rut_m: float = 0.0, points: int = 41
) -> FloatArray:
    """Forces (columns, 4) as in `WheelTable` of one load in one rut, over slips (j / (columns - 1))^2."""
    table = np.zeros((2, columns, 4))
    _fill(table, sqrt(load_N), _pack(soil, wheel, rut_m), points)
    return np.asarray(table[1])


def climbing_slip(soil: Soil, wheel: WheelShape, load_N: float, pull_N: float) -> float | None:
    """Smallest slip at which the drawbar pull reaches ``pull_N``; None where the wheel stalls (no slip <= 0.98)."""
    for slip in np.arange(0.0, 0.9801, 0.005):
        if steady_wheel(soil, wheel, load_N, float(slip), 121).drawbar_N >= pull_N:
            return float(slip)
    return None
