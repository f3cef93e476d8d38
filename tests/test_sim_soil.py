from __future__ import annotations

from dataclasses import fields, replace
from math import cos, isfinite, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from worlds.errors import ScenarioError
from worlds.soil import PRESETS, Soil, soil_preset
from worlds.wong_reece import WheelShape, climbing_slip, steady_wheel, wheel_table

WHEEL = WheelShape(0.165, 0.114)


def test_presets_are_complete_and_name_what_was_calibrated() -> None:
    names = {field.name for field in fields(Soil)}
    assert {"firm", "loose_sand", "mars_sand", "dry_sand", "dlr_mars_simulant"} <= set(PRESETS)
    for name, soil in PRESETS.items():
        assert soil.name == name
        assert soil.source
        assert set(soil.calibrated) <= names


def test_unknown_preset_lists_the_names() -> None:
    with pytest.raises(ScenarioError, match=r"soil\.preset = 'mud': unknown soil; allowed: .*loose_sand") as caught:
        soil_preset("mud")
    assert "\n" not in str(caught.value)


def _trapezoid(soil: Soil, entry: float, slip: float) -> tuple[float, float]:
    """Load and drawbar pull of the 0.165 x 0.114 m wheel by numpy, straight from the equations."""
    r, b = WHEEL.radius_m, WHEEL.width_m
    stiffness = soil.cohesive_modulus / b + soil.frictional_modulus
    theta = np.linspace(0.0, entry, 2001)
    peak = (0.4 + 0.15 * slip) * entry
    mirrored = np.where(theta >= peak, theta, entry - theta * (entry - peak) / peak)
    depth = np.clip(r * (np.cos(mirrored) - cos(entry)), 0.0, None)
    sigma = stiffness * depth**soil.sinkage_exponent
    j = r * ((entry - theta) - (1.0 - slip) * (sin(entry) - np.sin(theta)))
    tau = (soil.cohesion_Pa + sigma * tan(soil.friction_angle_rad)) * (1.0 - np.exp(-j / soil.shear_modulus_m))
    load = r * b * np.trapezoid(sigma * np.cos(theta) + tau * np.sin(theta), theta)
    pull = r * b * np.trapezoid(tau * np.cos(theta) - sigma * np.sin(theta), theta)
    return float(load), float(pull)


@pytest.mark.parametrize("name", ["dry_sand", "upland_sandy_loam", "lunar_nominal"])
@pytest.mark.parametrize("slip", [0.05, 0.3, 0.8])
def test_steady_wheel_agrees_with_a_direct_integration(name: str, slip: float) -> None:
    found = steady_wheel(PRESETS[name], WHEEL, 120.0, slip)
    entry = found.contact_m / WHEEL.radius_m
    load, pull = _trapezoid(PRESETS[name], entry, slip)
    assert load == pytest.approx(120.0, rel=2e-3)
    assert pull == pytest.approx(found.drawbar_N, abs=0.3)


def test_smooth_plate_limit_by_hand() -> None:
    # n = 1, no shear: W = r b B int (cos t - cos t1) cos t over the front only when the peak is at zero.
    soil = Soil("x", 0.0, 1e6, 1.0, 0.0, 0.0, 0.0, 1.0, stress_peak_offset=1e-9, stress_peak_slip=0.0)
    found = steady_wheel(soil, WHEEL, 50.0, 0.0, 4001)
    t1 = found.contact_m / WHEEL.radius_m
    by_hand = 0.165**2 * 0.114 * 1e6 * (0.5 * t1 + 0.25 * sin(2 * t1) - cos(t1) * sin(t1))
    assert by_hand == pytest.approx(50.0, rel=2e-3)
    assert found.thrust_N == 0.0


def test_softer_soil_sinks_deeper() -> None:
    order = ["firm", "dry_sand", "dlr_mars_simulant", "snow"]
    depths = [steady_wheel(PRESETS[name], WHEEL, 50.0, 0.1).sinkage_m for name in order]
    assert depths == sorted(depths)
    assert depths[0] < 0.001


def test_slip_sinkage_digs() -> None:
    soil = PRESETS["mars_sand"]
    depths = [steady_wheel(soil, WHEEL, 50.0, slip).sinkage_m for slip in (0.0, 0.3, 0.9)]
    assert depths == sorted(depths)
    still = replace(soil, sinkage_exponent_slip=0.0)
    assert depths[2] > 1.5 * steady_wheel(still, WHEEL, 50.0, 0.9).sinkage_m


def test_grousers_lower_the_slip_on_sand() -> None:
    weight = 140.0
    pull = 0.1 * weight
    smooth = climbing_slip(PRESETS["dry_sand"], WHEEL, weight, pull)
    lugged = climbing_slip(PRESETS["dry_sand"], WheelShape(0.165, 0.114, 0.02), weight, pull)
    assert smooth is not None
    assert lugged is not None
    assert lugged < smooth


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(sorted(PRESETS)), st.floats(1.0, 600.0), st.floats(0.0, 1.0))
def test_thrust_stays_within_the_strength_of_the_soil(name: str, load: float, slip: float) -> None:
    soil = PRESETS[name]
    wheel = steady_wheel(soil, WHEEL, load, slip, 61)
    assert all(isfinite(value) for value in (wheel.thrust_N, wheel.resistance_N, wheel.sinkage_m))
    # Integral of (c + sigma tan phi) over the arc; sigma cos carries at most the load, sigma sin is the resistance.
    area = wheel.contact_m * WHEEL.width_m
    limit = soil.cohesion_Pa * area + tan(soil.friction_angle_rad) * hypotenuse(load, wheel.resistance_N)
    assert wheel.thrust_N <= limit * 1.001


def hypotenuse(a: float, b: float) -> float:
    return sqrt(a * a + b * b)


def test_table_agrees_with_the_wheel_it_was_made_from() -> None:
    soil = PRESETS["loose_sand"]
    table = wheel_table(soil, WHEEL, 1000.0)
    _, rows, columns, _ = table.values.shape
    load, slip = (12 * table.load_step) ** 2, (20 / (columns - 1)) ** 2
    direct = steady_wheel(soil, WHEEL, load, slip)
    assert rows > 12
    assert table.values[0, 12, 20] == pytest.approx(
        [direct.thrust_N, direct.resistance_N, direct.sinkage_m, direct.contact_m], rel=2e-3
    )
