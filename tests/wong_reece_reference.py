"""A derived reference for the steady wheel: computed once from the published equations by another program than ours.

Wong and Reece (1967) stresses with the shear of Janosi and Hanamoto, integrated by a trapezoid of 241 points; 50 kg on
four equal wheels of 0.165 m radius and 0.114 m width, no grousers, no multipass, exit angle zero, peak of the normal
stress at (0.4 + 0.15 s) of the entry angle, sinkage exponent constant. Soil parameters as published, apart from those
below. None: no slip up to 0.98 carries the rover. Slips are given to two digits, so half a hundredth is rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from worlds.soil import PRESETS, Soil
from worlds.wong_reece import WheelShape

MASS_KG = 50.0
WHEEL = WheelShape(radius_m=0.165, width_m=0.114)
SLOPES_DEG = (0, 5, 10, 15, 20, 25, 30)
SINKAGE_SLIP = 0.2

_S = None  # stalls


@dataclass(frozen=True)
class Row:
    """One soil under one gravity."""

    soil: str
    gravity_m_s2: float
    slips: tuple[float | None, ...]  # at SLOPES_DEG
    sinkage_mm: float  # at SINKAGE_SLIP on level ground
    largest_pull: float  # drawbar over weight


TABLE = (
    Row("dry_sand", 3.71, (0.15, 0.29, 0.48, 0.81, _S, _S, _S), 13.7, 0.29),
    Row("lete_sand", 3.71, (0.10, 0.28, 0.51, 0.83, _S, _S, _S), 1.4, 0.30),
    Row("sandy_loam_11", 3.71, (0.12, 0.23, 0.36, 0.52, 0.73, _S, _S), 6.7, 0.43),
    Row("upland_sandy_loam", 3.71, (0.08, 0.15, 0.24, 0.35, 0.48, 0.66, 0.92), 9.5, 0.57),
    Row("clayey_soil", 3.71, (0.08, 0.24, 0.49, 0.97, _S, _S, _S), 1.3, 0.27),
    Row("lunar_nominal", 3.71, (0.12, 0.23, 0.39, 0.67, _S, _S, _S), 14.8, 0.32),
    Row("dlr_mars_simulant", 3.71, (0.21, _S, _S, _S, _S, _S, _S), 18.9, 0.08),
    Row("hit_lss1", 3.71, (0.08, 0.17, 0.29, 0.51, _S, _S, _S), 9.9, 0.35),
    Row("marssim_sand", 3.71, (0.11, 0.22, 0.37, 0.59, 0.96, _S, _S), 5.4, 0.37),
    Row("dry_sand", 9.81, (0.18, 0.36, 0.76, _S, _S, _S, _S), 25.0, 0.19),
    Row("lete_sand", 9.81, (0.11, 0.25, 0.43, 0.72, _S, _S, _S), 3.1, 0.32),
    Row("sandy_loam_11", 9.81, (0.18, 0.33, 0.55, 0.93, _S, _S, _S), 13.3, 0.27),
    Row("upland_sandy_loam", 9.81, (0.09, 0.18, 0.29, 0.44, 0.69, _S, _S), 17.4, 0.42),
    Row("clayey_soil", 9.81, (0.11, 0.28, 0.68, _S, _S, _S, _S), 3.6, 0.20),
    Row("lunar_nominal", 9.81, (0.10, 0.22, 0.41, _S, _S, _S, _S), 27.9, 0.26),
    Row("dlr_mars_simulant", 9.81, (_S, _S, _S, _S, _S, _S, _S), 39.8, -0.04),
    Row("hit_lss1", 9.81, (0.07, 0.15, 0.29, 0.63, _S, _S, _S), 18.1, 0.29),
    Row("marssim_sand", 9.81, (0.10, 0.20, 0.34, 0.56, _S, _S, _S), 10.7, 0.35),
)


def reference_soil(name: str) -> Soil:
    """The soil with which the reference was computed: a preset, apart from rounded or constant parameters."""
    soil = PRESETS[name]
    if name == "lete_sand":
        return replace(soil, sinkage_exponent=0.79)
    if name == "lunar_nominal":
        return replace(soil, shear_modulus_m=0.018)
    if name == "marssim_sand":
        return replace(soil, sinkage_exponent_slip=0.0)
    return soil
