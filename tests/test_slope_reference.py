"""The steady wheel, and the simulated rover, against the derived Wong-Reece reference table."""

from __future__ import annotations

from math import cos, radians, sin

import msgspec
import numpy as np
import pytest

from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.slope.bands import STALL_SLIP
from rover_sim.slope.rig import Setup, slope_drive, travel_slip
from tests.wong_reece_reference import MASS_KG, SINKAGE_SLIP, SLOPES_DEG, TABLE, WHEEL, Row, reference_soil
from worlds.wong_reece import climbing_slip, steady_wheel

SLIP_TOLERANCE = 0.03
SINKAGE_TOLERANCE = 0.10


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row.soil}-{row.gravity_m_s2:g}")
def test_steady_wheel_agrees_with_every_row(row: Row) -> None:
    soil, weight = reference_soil(row.soil), MASS_KG * row.gravity_m_s2 / 4.0
    for slope_deg, expected in zip(SLOPES_DEG, row.slips, strict=True):
        load, need = weight * cos(radians(slope_deg)), weight * sin(radians(slope_deg))
        found = climbing_slip(soil, WHEEL, load, need)
        assert found == (None if expected is None else pytest.approx(expected, abs=SLIP_TOLERANCE)), slope_deg
    sinkage_mm = 1e3 * steady_wheel(soil, WHEEL, weight, SINKAGE_SLIP).sinkage_m
    assert sinkage_mm == pytest.approx(row.sinkage_mm, rel=SINKAGE_TOLERANCE)
    pulls = [steady_wheel(soil, WHEEL, weight, slip).drawbar_N / weight for slip in np.arange(0.0, 0.981, 0.02)]
    assert max(pulls) == pytest.approx(row.largest_pull, abs=0.01)


def reference_rover() -> RoverModel:
    """50 kg on the wheels of the reference; its centre of mass lies on the ground, so that a slope moves no load."""
    husky = load_rover("husky")
    wheel = msgspec.structs.replace(
        husky.wheel, radius_m=WHEEL.radius_m, width_m=WHEEL.width_m, mass_kg=1.0, grouser_m=0.0
    )
    chassis_kg = MASS_KG - 4.0
    low = -WHEEL.radius_m * MASS_KG / chassis_kg
    chassis = msgspec.structs.replace(husky.chassis, mass_kg=chassis_kg, centre_of_mass_m=(0.0, 0.0, low))
    return msgspec.structs.replace(husky, name="reference", chassis=chassis, wheel=wheel)


@pytest.mark.parametrize(
    ("name", "gravity", "slope_deg"), [("hit_lss1", 9.81, 10), ("marssim_sand", 3.71, 10), ("clayey_soil", 9.81, 15)]
)
def test_simulated_rover_agrees_with_the_reference(name: str, gravity: float, slope_deg: int) -> None:
    row = next(row for row in TABLE if (row.soil, row.gravity_m_s2) == (name, gravity))
    expected = row.slips[SLOPES_DEG.index(slope_deg)]
    setup = Setup(name, gravity, "reference", 0.0, 0.2)
    slip = travel_slip(slope_drive(reference_rover(), setup, "up", slope_deg, reference_soil(name), ruts=False)[1])
    if expected is None:
        assert slip > STALL_SLIP
    else:
        assert slip == pytest.approx(expected, abs=SLIP_TOLERANCE)
