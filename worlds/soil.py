"""Soil parameters and named presets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Soil:
    """Bekker pressure-sinkage and Janosi-Hanamoto shear parameters of one soil."""

    name: str
    cohesive_modulus: float  # k_c, N/m^(n+1)
    frictional_modulus: float  # k_phi, N/m^(n+2)
    sinkage_exponent: float  # n at zero slip
    sinkage_exponent_slip: float  # growth of n with slip ratio
    cohesion_Pa: float
    friction_angle_rad: float
    shear_modulus_m: float  # K
