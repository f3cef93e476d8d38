from __future__ import annotations

from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.slope.bands import (
    SLIP_ANGLE_CURVES,
    SLIP_CURVES,
    Band,
    band_slopes,
    is_inside,
    pioneer_track_ratio,
    slip_band,
)
from worlds.soil import PRESETS

EARTH = 9.81


def test_bands_at_the_slopes_of_the_reference() -> None:
    assert slip_band("loose_sand", EARTH, "up", 10.0) == Band(0.14, 0.24)
    assert slip_band("loose_sand", EARTH, "up", 17.5) == Band(0.37, 0.60)
    assert slip_band("loose_sand", EARTH, "up", 20.0) == Band(0.50, 1.0, stall=True)
    assert slip_band("loose_sand", EARTH, "up", 40.0) == Band(0.98, 1.0, stall=True)
    assert slip_band("firm", EARTH, "up", 20.0) == Band(0.12, 0.28)


def test_between_its_slopes_a_band_is_interpolated() -> None:
    # 5 deg: 0.05 to 0.15, 10 deg: 0.14 to 0.24.
    band = slip_band("loose_sand", EARTH, "up", 7.5)
    assert band is not None
    assert (band.low, band.high) == pytest.approx((0.095, 0.195))


@pytest.mark.parametrize(
    ("soil", "gravity", "direction", "slope_deg"),
    [
        ("mars_sand", EARTH, "up", 10.0),
        ("loose_sand", 3.71, "up", 10.0),
        ("loose_sand", EARTH, "down", 10.0),
        ("loose_sand", EARTH, "across", 10.0),
        ("firm", EARTH, "up", 20.1),
    ],
)
def test_no_band_where_nothing_was_published(soil: str, gravity: float, direction: str, slope_deg: float) -> None:
    assert slip_band(soil, gravity, direction, slope_deg) is None
    assert is_inside(None, 0.1, stuck=False) is None


def test_stalling_agrees_only_where_the_band_says_so() -> None:
    assert is_inside(Band(0.5, 1.0, stall=True), 7.0, stuck=True)
    assert not is_inside(Band(0.28, 0.45), 1.0, stuck=True)
    assert not is_inside(Band(0.98, 1.0, stall=True), 0.9, stuck=False)


@given(st.sampled_from(["loose_sand", "firm"]), st.floats(0.0, 45.0))
def test_bands_are_ordered_and_rise_with_the_slope(soil: str, slope_deg: float) -> None:
    band = slip_band(soil, EARTH, "up", slope_deg)
    steeper = slip_band(soil, EARTH, "up", slope_deg + 1.0)
    if band is None:
        assert steeper is None
        return
    assert band.low < band.high
    if steeper is not None:
        assert steeper.high >= band.high
        # Firm ground: the lower end falls a little up to 10 deg, as the spread of the data grows.
        assert steeper.low >= band.low - 0.005


def test_curves_by_hand() -> None:
    sutoh, ex1, cuadriga = SLIP_CURVES
    assert sutoh.value[10] == pytest.approx(0.07 * exp(1.0))
    assert sutoh.value[20] == pytest.approx(0.517, abs=5e-4)
    # (0.000522 + 0.00105) 15^2 + 0.00265 + 0.0256
    assert ex1.value[15] == pytest.approx(0.38195)
    assert ex1.slope_deg[-1] == 18
    assert cuadriga.value[-1] == 0.196
    assert SLIP_ANGLE_CURVES[0].value[10] == pytest.approx(6.54, abs=5e-3)


def test_every_curve_names_its_source_and_fits_its_slopes() -> None:
    for curve in (*SLIP_CURVES, *SLIP_ANGLE_CURVES):
        assert curve.source
        assert curve.confidence
        assert curve.soil in PRESETS
        assert len(curve.slope_deg) == len(curve.value)
        assert len(curve.low) == len(curve.high)
        assert all(low <= value <= high for low, value, high in zip(curve.low, curve.value, curve.high, strict=False))


def test_curves_of_loose_sand_lie_in_its_band_from_5_to_15_degrees() -> None:
    for curve in SLIP_CURVES[:2]:
        for slope_deg in (5.0, 10.0, 15.0):
            band = slip_band("loose_sand", EARTH, "up", slope_deg)
            value = curve.value[curve.slope_deg.index(slope_deg)]
            assert is_inside(band, value, stuck=False)


def test_band_slopes_name_the_reference() -> None:
    assert band_slopes("loose_sand") == (0.0, 5.0, 10.0, 15.0, 17.5, 20.0, 25.0)
    assert band_slopes("snow") == ()


def test_track_ratio_of_the_pioneer_falls_with_the_radius() -> None:
    assert pioneer_track_ratio(0.0) == pytest.approx(1.4728)
    # sqrt 25 = 5: 0.4728 / 1.269
    assert pioneer_track_ratio(25.0) == pytest.approx(1.3726, abs=1e-4)
    assert pioneer_track_ratio(-25.0) == pioneer_track_ratio(25.0)
