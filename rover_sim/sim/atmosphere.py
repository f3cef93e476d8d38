"""Pressure and temperature of the standard atmosphere (ISO 2533:1975; US Standard Atmosphere 1976) below 32 km.

Below sea level the lowest layer is carried on; a rover on a world of other gravity is given this air all the same, as
its autopilot knows no other.
"""

from __future__ import annotations

from math import exp, log

from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2

_RADIUS_M = 6_356_766.0  # that turns height into geopotential height
_SEA_LEVEL_PA, _SEA_LEVEL_K = 101_325.0, 288.15
_GAS_J_KG_K = 287.05287
_LAYERS = ((0.0, -6.5e-3), (11_000.0, 0.0), (20_000.0, 1.0e-3))  # base (m, geopotential) and gradient (K/m)
ZERO_CELSIUS_K = 273.15


def _layer_bases() -> list[tuple[float, float, float, float]]:
    """Base height, temperature and pressure, and gradient, of each layer."""
    bases = [(0.0, _SEA_LEVEL_K, _SEA_LEVEL_PA, _LAYERS[0][1])]
    for height, gradient in _LAYERS[1:]:
        temperature, pressure = _within(bases[-1], height)
        bases.append((height, temperature, pressure, gradient))
    return bases


def _within(base: tuple[float, float, float, float], height: float) -> tuple[float, float]:
    """Temperature and pressure at a geopotential height, by the layer that begins at ``base``."""
    bottom, warm, pressure, gradient = base
    temperature = warm + gradient * (height - bottom)
    if gradient == 0.0:
        return temperature, pressure * exp(-STANDARD_GRAVITY_M_S2 * (height - bottom) / (_GAS_J_KG_K * warm))
    return temperature, pressure * (temperature / warm) ** (-STANDARD_GRAVITY_M_S2 / (_GAS_J_KG_K * gradient))


_BASES = _layer_bases()


def air(altitude_m: float) -> tuple[float, float]:
    """Pressure (Pa) and temperature (K) at a height over sea level."""
    height = _RADIUS_M * altitude_m / (_RADIUS_M + altitude_m)
    base = next((base for base in reversed(_BASES) if height >= base[0]), _BASES[0])
    temperature, pressure = _within(base, height)
    return pressure, temperature


def pressure_altitude_m(pressure_Pa: float) -> float:
    """The height over sea level that has this pressure."""
    bottom, warm, at_base, gradient = next((base for base in reversed(_BASES) if pressure_Pa <= base[2]), _BASES[0])
    if gradient == 0.0:
        height = bottom + _GAS_J_KG_K * warm / STANDARD_GRAVITY_M_S2 * log(at_base / pressure_Pa)
    else:
        ratio = (pressure_Pa / at_base) ** (-_GAS_J_KG_K * gradient / STANDARD_GRAVITY_M_S2)
        height = bottom + warm / gradient * (ratio - 1.0)
    return _RADIUS_M * height / (_RADIUS_M - height)
