"""The simulated rover and the steady wheel against the derived Wong-Reece reference table, with all exceptions.

Run: OMP_NUM_THREADS=1 uv run python benchmarks/wong_reece_table.py
"""

from __future__ import annotations

import sys
from math import cos, radians, sin
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rover_sim.slope.bands import STALL_SLIP
from rover_sim.slope.rig import Setup, slope_drive, travel_slip
from tests.test_slope_reference import SLIP_TOLERANCE, reference_rover
from tests.wong_reece_reference import MASS_KG, SINKAGE_SLIP, SLOPES_DEG, TABLE, WHEEL, Row, reference_soil
from worlds.wong_reece import climbing_slip, steady_wheel

Slip = float | None


def steady_slips(row: Row) -> list[Slip]:
    """Slip of the steady wheel at every slope; None where it stalls."""
    soil, weight = reference_soil(row.soil), MASS_KG * row.gravity_m_s2 / 4.0
    angles = [radians(slope_deg) for slope_deg in SLOPES_DEG]
    return [climbing_slip(soil, WHEEL, weight * cos(angle), weight * sin(angle)) for angle in angles]


def driven_slips(row: Row) -> list[Slip]:
    """Slip of the simulated rover at every slope; None where it stalls."""
    setup = Setup(row.soil, row.gravity_m_s2, "reference", 0.0, 0.1)
    soil, rover = reference_soil(row.soil), reference_rover()
    slips = [travel_slip(slope_drive(rover, setup, "up", slope_deg, soil, ruts=False)[1]) for slope_deg in SLOPES_DEG]
    return [None if slip > STALL_SLIP else slip for slip in slips]


def differences(row: Row, found: list[Slip]) -> tuple[float, list[str]]:
    """Largest difference of the slips, and every point that is off or stalls where the other does not."""
    worst, off = 0.0, []
    for slope_deg, expected, slip in zip(SLOPES_DEG, row.slips, found, strict=True):
        if expected is None or slip is None:
            agree = expected is slip
        else:
            worst = max(worst, abs(slip - expected))
            agree = abs(slip - expected) <= SLIP_TOLERANCE
        if not agree:
            text = ["stall" if value is None else f"{value:.3f}" for value in (expected, slip)]
            off.append(f"{row.soil} g {row.gravity_m_s2} {slope_deg} deg: {text[0]} -> {text[1]}")
    return worst, off


def main() -> int:
    """Print a line a row; exit code 1 where the steady wheel is off."""
    steady_off: list[str] = []
    driven_off: list[str] = []
    for row in TABLE:
        worst_steady, off = differences(row, steady_slips(row))
        steady_off += off
        worst_driven, off = differences(row, driven_slips(row))
        driven_off += off
        soil, weight = reference_soil(row.soil), MASS_KG * row.gravity_m_s2 / 4.0
        sinkage = 1e3 * steady_wheel(soil, WHEEL, weight, SINKAGE_SLIP).sinkage_m / row.sinkage_mm - 1.0
        print(
            f"{row.soil:18s} g {row.gravity_m_s2:4.2f}  slip differs by at most {worst_steady:.3f} (steady wheel), "
            f"{worst_driven:.3f} (simulated rover); sinkage {100 * sinkage:+.1f} %"
        )
    for title, points in (("steady wheel", steady_off), ("simulated rover", driven_off)):
        print(f"{title}: {len(points)} of {len(TABLE) * len(SLOPES_DEG)} off", *points, sep="\n  ")
    return int(bool(steady_off))


if __name__ == "__main__":
    sys.exit(main())
