"""Soil parameters and named presets.

The model behind the numbers: pressure-sinkage after Bekker, p = (k_c / b + k_phi) z^n, shear after Janosi and
Hanamoto, tau = (c + sigma tan phi)(1 - exp(-j / K)), wheel stresses after Wong and Reece (J. Terramechanics 4, 1967).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from types import MappingProxyType

from worlds.errors import ScenarioError


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
    stress_peak_offset: float = 0.4  # a0: where the normal stress peaks, as a share of the entry angle
    stress_peak_slip: float = 0.15  # a1: growth of that share with slip
    damping_ratio: float = 0.5  # of the shear spring that holds a parked wheel
    unit_weight_N_m3: float = 15000.0  # on Earth; for bulldozing
    reload_share: float = 0.1  # of the depth of a rut, over which its floor regains the pressure that made it
    packed_shear_share: float = 0.4  # K of packed soil over K of loose soil: 10 / 25 mm for dry sand (Wong 2008)
    source: str = ""
    calibrated: tuple[str, ...] = ()  # fields that were fitted or filled in, not read in the source


def _row(
    name: str,
    moduli_kN: tuple[float, float],
    exponent: tuple[float, float],
    shear: tuple[float, float, float],
    source: str,
    *calibrated: str,
) -> Soil:
    """A preset in the units of the tables: kN, kPa, degrees and millimetres."""
    cohesion_kPa, friction_deg, shear_modulus_mm = shear
    return Soil(
        name=name,
        cohesive_modulus=1e3 * moduli_kN[0],
        frictional_modulus=1e3 * moduli_kN[1],
        sinkage_exponent=exponent[0],
        sinkage_exponent_slip=exponent[1],
        cohesion_Pa=1e3 * cohesion_kPa,
        friction_angle_rad=radians(friction_deg),
        shear_modulus_m=1e-3 * shear_modulus_mm,
        source=source,
        calibrated=calibrated,
    )


_K = "shear_modulus_m"
_WONG = "Wong, Theory of Ground Vehicles (2008), via public code"
_CHRONO = "Project Chrono demos; Wong (2008)"
_DING = "Ding et al. (2015), table I, via a public plug-in"

_TABLE = (
    # Calibrated, for a grousered wheel, to the slip-slope band of firm natural ground (Cuadriga field data).
    _row(
        "firm",
        (0.0, 2.5e7),
        (1.5, 0.0),
        (0.2, 25.2, 0.355),
        "ours: stiff natural ground, slip-slope points of the Cuadriga data",
        "cohesive_modulus",
        "frictional_modulus",
        "sinkage_exponent",
        "cohesion_Pa",
        "friction_angle_rad",
        _K,
    ),
    # Bekker part and cohesion published; friction angle and K calibrated to slip-slope curves of loose sand.
    _row(
        "loose_sand",
        (0.99, 1528.43),
        (1.10, 0.0),
        (1.04, 38.5, 18.0),
        f"{_WONG}: dry sand (LLL), friction angle and K fitted to published slip-slope curves",
        "friction_angle_rad",
        _K,
    ),
    _row("mars_sand", (13.6, 2259.1), (0.92, 0.5), (0.4623, 35.0, 15.0), "Zhou et al. (2023), table 2 (MarsSim)"),
    _row("dry_sand", (0.99, 1528.43), (1.10, 0.0), (1.04, 28.0, 20.0), f"{_WONG}; Ding (2015) table I", _K),
    _row("lete_sand", (102.0, 5301.0), (0.793, 0.0), (1.3, 31.1, 12.0), _CHRONO),
    _row("sandy_loam_15", (5.27, 1515.04), (0.7, 0.0), (1.72, 29.0, 20.0), _WONG, _K),
    _row("sandy_loam_11", (52.53, 1127.97), (0.9, 0.0), (4.83, 20.0, 20.0), f"{_WONG} (Michigan)", _K),
    _row("sandy_loam_23", (11.42, 808.96), (0.4, 0.0), (9.65, 35.0, 20.0), _WONG, _K),
    _row("upland_sandy_loam", (74.6, 2080.0), (1.10, 0.0), (3.3, 33.7, 20.0), f"{_WONG}, 51 % moisture", _K),
    _row("rubicon_sandy_loam", (6.9, 752.0), (0.66, 0.0), (3.7, 29.8, 20.0), f"{_WONG}, 43 % moisture", _K),
    _row("grenville_loam", (0.06, 5880.0), (1.01, 0.0), (3.1, 29.8, 20.0), f"{_WONG}, 24 % moisture", _K),
    _row("clayey_soil", (13.19, 692.15), (0.5, 0.0), (4.14, 13.0, 6.0), f"{_CHRONO}; Thailand, 38 % moisture"),
    _row("heavy_clay", (12.7, 1555.95), (0.13, 0.0), (68.95, 34.0, 6.0), f"{_WONG}, 25 % moisture", _K),
    _row("snow", (4.37, 196.72), (1.6, 0.0), (1.03, 19.7, 30.0), f"{_WONG} (US)", _K),
    _row("lunar_nominal", (1.4, 820.0), (1.0, 0.0), (0.170, 35.0, 17.8), f"Project Chrono Curiosity demo; {_DING}"),
    _row("hit_lss1", (15.6, 2407.4), (1.10, 0.0), (0.250, 31.9, 11.4), f"{_DING}; K is the middle of 9.7-13.1 mm"),
    _row("marssim_sand", (13.6, 2259.1), (0.92, 0.5), (0.4623, 35.0, 15.0), "Zhou et al. (2023), table 2 (MarsSim)"),
    _row(
        "dlr_mars_simulant",
        (5.79, 180.0),
        (0.8, 0.0),
        (0.300, 17.8, 10.0),
        "'Strength of soil deposits' (MER), via public code; the trap soil",
        _K,
    ),
    _row("cdt_fgs_dry", (5085.6, 6259.1), (1.42, 0.0), (1.58, 34.1, 22.17), "Project Chrono (RoboSimian)"),
    _row("soil_direct_90", (0.0, 8000.0), (1.46, 0.01), (1.0, 29.0, 21.0), "Pavlov (2024), via a public plug-in"),
)

PRESETS: Mapping[str, Soil] = MappingProxyType({soil.name: soil for soil in _TABLE})
"""All named soils; each says its source, and in `calibrated` which fields are not from that source."""


def soil_preset(name: str) -> Soil:
    """The preset of that name.

    Raises `ScenarioError` that lists the names if there is none.
    """
    if name not in PRESETS:
        message = f"soil.preset = {name!r}: unknown soil; allowed: {', '.join(sorted(PRESETS))}"
        raise ScenarioError(message)
    return PRESETS[name]
