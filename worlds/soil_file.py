"""A soil of the user's own: a strict TOML file in SI units, checked for what no soil can be."""

from __future__ import annotations

from math import radians
from pathlib import Path

import msgspec

from worlds.errors import ScenarioError
from worlds.soil import PRESETS, Soil, soil_preset
from worlds.strict_toml import Limits, check_limits, convert_table, read_table

_LIMITS: Limits = {
    "cohesive_modulus": (0.0, 1e9),
    "frictional_modulus": (0.0, 1e10),
    "sinkage_exponent": (0.05, 3.0),
    "sinkage_exponent_slip": (0.0, 2.0),
    "cohesion_Pa": (0.0, 1e6),
    "friction_angle_deg": (0.0, 60.0),  # above no soil was ever measured; at 90 its strength is infinite
    "shear_modulus_m": (1e-5, 1.0),
    "stress_peak_offset": (0.05, 0.9),
    "stress_peak_slip": (0.0, 0.9),
    "damping_ratio": (0.05, 2.0),
    "unit_weight_N_m3": (500.0, 50_000.0),
    "reload_share": (0.01, 1.0),
    "packed_shear_share": (0.05, 1.0),
}


class SoilFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The keys of a soil file; those without a default are required. Meanings as in `worlds.soil.Soil`."""

    name: str = ""  # default: the name of the file
    cohesive_modulus: float
    frictional_modulus: float
    sinkage_exponent: float
    sinkage_exponent_slip: float = 0.0
    cohesion_Pa: float
    friction_angle_deg: float
    shear_modulus_m: float
    stress_peak_offset: float = 0.4
    stress_peak_slip: float = 0.15
    damping_ratio: float = 0.5
    unit_weight_N_m3: float = 15000.0
    reload_share: float = 0.1
    packed_shear_share: float = 0.4
    source: str = ""


def is_soil_file(name_or_path: str) -> bool:
    """Whether a scenario's soil is meant as a file and not as the name of a preset."""
    return name_or_path not in PRESETS and name_or_path.endswith(".toml")


def load_soil(name_or_path: str) -> Soil:
    """A preset by name, or a soil of one's own by the path of its TOML file.

    Raises `ScenarioError` for an unknown name, and one that names the file, the key and what is allowed for a soil that
    cannot be.
    """
    if not is_soil_file(name_or_path):
        return soil_preset(name_or_path)
    path = Path(name_or_path)
    if not path.is_file():
        raise ScenarioError(f"soil.preset = {name_or_path!r}: no such soil file; a preset's name has no .toml")
    file = convert_table(read_table(path), SoilFile, str(path))
    check_limits(file, _LIMITS, str(path))
    _check_strength(file, str(path))
    return Soil(
        name=file.name or path.stem,
        cohesive_modulus=file.cohesive_modulus,
        frictional_modulus=file.frictional_modulus,
        sinkage_exponent=file.sinkage_exponent,
        sinkage_exponent_slip=file.sinkage_exponent_slip,
        cohesion_Pa=file.cohesion_Pa,
        friction_angle_rad=radians(file.friction_angle_deg),
        shear_modulus_m=file.shear_modulus_m,
        stress_peak_offset=file.stress_peak_offset,
        stress_peak_slip=file.stress_peak_slip,
        damping_ratio=file.damping_ratio,
        unit_weight_N_m3=file.unit_weight_N_m3,
        reload_share=file.reload_share,
        packed_shear_share=file.packed_shear_share,
        source=file.source or str(path),
    )


def _check_strength(file: SoilFile, source: str) -> None:
    """Raise `ScenarioError` where the keys together describe no ground to stand or pull on."""
    if file.cohesive_modulus + file.frictional_modulus <= 0.0:
        raise ScenarioError(f"{source}: frictional_modulus = 0: one of cohesive_modulus and it must be above 0")
    if file.cohesion_Pa + file.friction_angle_deg <= 0.0:
        raise ScenarioError(f"{source}: friction_angle_deg = 0: one of cohesion_Pa and it must be above 0")
    if file.stress_peak_offset + file.stress_peak_slip > 1.0:
        raise ScenarioError(
            f"{source}: stress_peak_slip = {file.stress_peak_slip:g}: with stress_peak_offset at most 1, "
            "as the stress peaks inside the contact"
        )
