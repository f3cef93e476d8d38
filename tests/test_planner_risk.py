import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.risk import Chance, Forecast, Vehicle, forecast
from planner.risk_prior import MapError, SoilPrior, SoilSpread, draw_error, draw_soils
from planner.risk_scores import Line, fit_line, reliability, scores
from planner.risk_soil import COLUMNS, CONTACT, PULL, RESISTANCE, WALL, slips, traction
from planner.route_cost import soils as measured_soils
from rover_sim.sim.rover import load_rover
from worlds.errors import InputError
from worlds.soil import soil_preset
from worlds.types import FloatArray, HeightField

MARS = 3.71
ROVER = load_rover("husky")
SURE = SoilSpread(0.0, 0.0, 0.0, 0.0)
EXACT = MapError(0.0, 1.0)
AHEAD = np.array([[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]])


def vehicle(raised_m: float = 0.0) -> Vehicle:
    ahead, left, up = ROVER.centre_of_mass_b
    stiffness = ROVER.wheel.stiffness_N_m
    return Vehicle(ROVER.footprint(), ROVER.wheel_shape(), ROVER.mass_kg, (ahead, left, up + raised_m), stiffness)


def plane(climb_deg: float = 0.0, lean_deg: float = 0.0) -> HeightField:
    """Rises along x and along y."""
    axis = np.arange(-4.0, 12.01, 0.5)
    rise = np.tan(np.radians([climb_deg, lean_deg]))
    return HeightField(rise[0] * axis[None, :] + rise[1] * axis[:, None], 0.5, (-4.0, -4.0))


def prior(name: str = "firm", spread: SoilSpread = SURE) -> SoilPrior:
    return SoilPrior((soil_preset(name),), (1.0,), spread)


def told(ground: HeightField, soils: SoilPrior, *, raised_m: float = 0.0, seed: int = 0, count: int = 30) -> Forecast:
    rng = np.random.default_rng(seed)
    return forecast(AHEAD, ground, EXACT, soils, vehicle(raised_m), MARS, rng, count)


def test_flat_firm_ground_has_no_risk() -> None:
    found = told(plane(), prior(spread=SoilSpread()))
    assert found.fails.probability == 0.0
    assert found.fails.low == 0.0
    assert found.fails.high < 0.1


@pytest.mark.parametrize(("lean_deg", "goes_over"), [(12.0, 0.0), (28.0, 1.0)])
def test_a_plane_past_the_tip_angle_rolls_the_rover_over(lean_deg: float, goes_over: float) -> None:
    # Half a track of 0.2854 m over a centre of mass 0.165 + 0.024 + 0.5 m up: 22.5 degrees.
    assert told(plane(lean_deg=lean_deg), prior(), raised_m=0.5).rollover.probability == goes_over


def test_sand_that_gives_less_than_the_slope_takes_stops_the_rover() -> None:
    found = told(plane(climb_deg=25.0), prior("mars_sand"))
    assert found.immobilised.probability == 1.0
    assert found.arcs_m.max() < 2.0


def test_the_rover_strays_as_far_as_it_is_wrong_about_its_place() -> None:
    # It drives the line that it believes to be on: the largest distance is that of a normal error of 5 cm, half folded.
    found = told(plane(), prior(), count=300)
    assert found.lateral_mean_m == pytest.approx(0.05 * np.sqrt(2.0 / np.pi), rel=0.15)
    assert found.lateral_sd_m == pytest.approx(0.05 * np.sqrt(1.0 - 2.0 / np.pi), rel=0.2)


def test_the_same_seed_gives_the_same_forecast_and_another_another() -> None:
    ground, soils = plane(climb_deg=14.0), prior("mars_sand", SoilSpread())
    first, again, other = (told(ground, soils, seed=seed).arcs_m for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_risk_grows_with_the_slope() -> None:
    soils = prior("mars_sand", SoilSpread())
    fails = [told(plane(climb_deg=slope), soils).fails.probability for slope in (5.0, 11.0, 14.0, 17.0, 22.0)]
    assert fails == sorted(fails)
    assert fails[0] < 0.1
    assert fails[-1] > 0.9


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_slips_in_a_soil_whose_pull_grows_with_the_displacement(climb: float, side: float) -> None:
    # Pull 0.8 times the displacement and no resistance: both slips are the parts of gravity over 0.8.
    along, across = slips(_linear_soil(0.8), climb, side, 0.0)
    assert (along, across) == pytest.approx((climb / 0.8, side / 0.8), abs=2e-3)


def _linear_soil(gain: float) -> FloatArray:
    curve = np.zeros((COLUMNS, 5))
    curve[:, PULL] = gain * np.linspace(0.0, 1.0, COLUMNS) ** 2
    curve[:, [RESISTANCE, WALL]], curve[:, CONTACT] = 0.0, 1.0
    return curve


@pytest.mark.parametrize("name", ["firm", "mars_sand", "loose_sand"])
def test_slips_are_those_of_the_test_rig(name: str) -> None:
    """Against ``knowledge/slopes/husky.toml``, measured with the whole physics, where slip is below the stop."""
    measured = measured_soils("husky")[name]
    curve = traction((soil_preset(name),), ROVER.wheel_shape(), 0.25 * ROVER.mass_kg * MARS, MARS).curves[0]
    for slope, slip in zip(measured.slope_deg, measured.slip_up, strict=False):
        if slip < 0.35:
            assert slips(curve, float(np.tan(np.radians(slope))), 0.0, 0.0)[0] == pytest.approx(slip, abs=0.05)
    for slope, angle in zip(measured.slope_deg, measured.slip_angle_deg, strict=False):
        if angle < 15.0:
            along, across = slips(curve, 0.0, float(np.tan(np.radians(slope))), 0.0)
            assert np.degrees(np.arctan2(across, 1.0 - along)) == pytest.approx(angle, abs=1.0)


def test_errors_of_the_map_have_the_wanted_spread_and_likeness() -> None:
    field = HeightField(np.zeros((200, 200)), 0.5, (0.0, 0.0))
    drawn = draw_error(field, MapError(0.1, 2.0), np.random.default_rng(0))
    assert drawn.std() == pytest.approx(0.1, rel=0.05)
    alike = float((drawn[:, :-4] * drawn[:, 4:]).mean()) / 0.01  # 2 m apart: exp(-1)
    assert alike == pytest.approx(np.exp(-1.0), abs=0.06)


def test_drawn_soils_scatter_as_told() -> None:
    soils = draw_soils(prior("mars_sand", SoilSpread(0.0, 3.0, 0.0, 0.0)), 2000, np.random.default_rng(0))
    angles = np.degrees([soil.friction_angle_rad for soil in soils])
    assert angles.mean() == pytest.approx(35.0, abs=0.3)
    assert angles.std() == pytest.approx(3.0, rel=0.06)
    assert {soil.cohesion_Pa for soil in soils} == {soil_preset("mars_sand").cohesion_Pa}


@pytest.mark.parametrize(
    ("soils", "error", "words"),
    [
        (prior(spread=SoilSpread(friction_deg=-1.0)), EXACT, "spread.friction_deg = -1"),
        (prior(spread=SoilSpread(cohesion=float("nan"))), EXACT, "spread.cohesion = nan"),
        (SoilPrior((soil_preset("firm"),), (-0.5,)), EXACT, "weight = -0.5"),
        (SoilPrior((soil_preset("firm"),), ()), EXACT, "1 soils and 0 weights"),
        (prior(), MapError(-0.1, 1.0), "sd_m = -0.1"),
        (prior(), MapError(0.1, 1.0, 0.0, -0.1), "relief_m = -0.1"),
        (prior(), MapError(0.1, 0.0), "correlation_m = 0"),
    ],
)
def test_a_prior_that_cannot_be_is_named(soils: SoilPrior, error: MapError, words: str) -> None:
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        forecast(AHEAD, plane(), error, soils, vehicle(), MARS, np.random.default_rng(0), 2)


def test_a_count_leaves_an_interval() -> None:
    # Jeffreys: the 2.5 and 97.5 % points of Beta(5.5, 15.5), from tables.
    chance = Chance.of(5, 20)
    assert chance.probability == 0.25
    assert (chance.low, chance.high) == pytest.approx((0.1020, 0.4642), abs=2e-3)


def test_scores_of_four_forecasts() -> None:
    forecasts, happened = np.array([0.1, 0.1, 0.9, 0.9]), np.array([False, False, True, False])
    found, bins = scores(forecasts, happened), reliability(forecasts, happened)
    assert found.brier == pytest.approx((0.01 + 0.01 + 0.01 + 0.81) / 4.0)
    assert found.base == pytest.approx(0.25 * 0.75)
    assert found.ece == pytest.approx(0.5 * 0.1 + 0.5 * 0.4)
    np.testing.assert_allclose(bins.happened, [0.0, 0.5])


def test_a_line_finds_the_odds_that_made_the_events() -> None:
    rng = np.random.default_rng(0)
    forecasts = rng.uniform(0.02, 0.98, 20_000)
    happened = rng.random(20_000) < Line(0.6, -0.4).applied(forecasts)
    found = fit_line(forecasts, happened)
    assert (found.slope, found.offset) == pytest.approx((0.6, -0.4), abs=0.05)
