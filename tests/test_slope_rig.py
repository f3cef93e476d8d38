from __future__ import annotations

from math import atan, degrees, radians, sin
from pathlib import Path

import numpy as np
import pytest

from rover_sim.sim import rover as rover_file
from rover_sim.sim.rover import load_rover
from rover_sim.slope.drawbar import measure_drawbar
from rover_sim.slope.rig import Setup, loaded, measure_slope, plane_world
from rover_sim.slope.tilt_table import AXES, Axis, measure_tilt
from rover_sim.slope.turning import RADII_IN_TRACKS, measure_turn
from worlds.heightfield import height_at
from worlds.soil import PRESETS

ROVER = load_rover("husky")
WEIGHT = ROVER.mass_kg * 9.81


def setup(soil: str, *, rover: str = "husky", speed: float = 0.3, gravity: float = 9.81) -> Setup:
    return Setup(soil, gravity, rover, 0.0, speed)


@pytest.mark.parametrize("slope_deg", [0.0, 5.0, 10.0, 15.0, 17.5, 20.0, 25.0])
def test_loose_sand_is_inside_its_band(slope_deg: float) -> None:
    point = measure_slope(setup("loose_sand", speed=0.1), "up", slope_deg)
    assert point.inside
    assert point.stalled == (slope_deg == 25.0)


@pytest.mark.parametrize("slope_deg", [0.0, 5.0, 10.0, 15.0, 20.0])
def test_firm_ground_is_inside_its_band(slope_deg: float) -> None:
    point = measure_slope(setup("firm", speed=0.1), "up", slope_deg)
    assert point.inside
    assert not point.stalled


def test_a_steady_climb_is_carried_by_the_soil() -> None:
    point = measure_slope(setup("loose_sand"), "up", 10.0)
    assert point.drawbar_N == pytest.approx(WEIGHT * sin(radians(10.0)), rel=5e-3)
    # It lifts its weight at the speed that slip leaves it, and pays for the electronics.
    lifting = WEIGHT * sin(radians(10.0)) * 0.3 * (1.0 - point.slip)
    assert point.power_W > lifting + ROVER.motor.idle_power_W


def test_downhill_brakes_and_across_slides_downhill() -> None:
    down = measure_slope(setup("loose_sand"), "down", 10.0)
    across = measure_slope(setup("loose_sand"), "across", 10.0)
    assert down.slip < 0.0 < across.slip < 0.1
    assert down.drawbar_N == pytest.approx(-WEIGHT * sin(radians(10.0)), rel=5e-3)
    # Not calibrated: the published slip angle there is 6.5 deg.
    assert across.slip_angle_deg == pytest.approx(6.5, abs=2.5)
    assert (down.band, across.band, down.inside, across.inside) == (None,) * 4


def test_a_rover_that_cannot_even_stand_is_measured_on_the_plane() -> None:
    point = measure_slope(setup("firm"), "up", 40.0)
    assert point.stalled
    assert point.slip > 1.0
    assert measure_slope(setup("firm"), "down", 40.0).slip < -0.8


def test_digging_in_is_called_embedding() -> None:
    assert measure_slope(setup("mars_sand", speed=0.1), "up", 20.0).embedded
    assert not measure_slope(setup("mars_sand", speed=0.1), "up", 5.0).embedded
    # It stalls without sinking on.
    assert not measure_slope(setup("firm", speed=0.1), "up", 25.0).embedded


def test_slip_hardly_depends_on_the_time_step() -> None:
    slips = [measure_slope(setup("loose_sand"), "up", 15.0, dt).slip for dt in (1 / 240, 1 / 960)]
    assert slips[0] == pytest.approx(slips[1], abs=0.01)


def test_load_on_the_deck_by_hand() -> None:
    # Deck: 0.1453 + 0.055 = 0.2003 m; chassis 46.034 kg at 0.029 m.
    heavier = loaded(ROVER, 20.0)
    assert heavier.mass_kg == pytest.approx(ROVER.mass_kg + 20.0)
    assert heavier.chassis.centre_of_mass_m == pytest.approx((0.0, 0.0, (46.034 * 0.029 + 20.0 * 0.2003) / 66.034))
    apart = 46.034 * 20.0 / 66.034 * 0.1713**2
    assert heavier.chassis.inertia_kg_m2 == pytest.approx((0.6022 + apart, 1.7386 + apart, 2.0296))
    assert loaded(ROVER, 0.0) is ROVER


def test_plane_rises_toward_its_azimuth() -> None:
    world = plane_world(PRESETS["firm"], 9.81, 45.0, 90.0, 4.0)
    x, y = np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, 1.0])
    assert height_at(world.ground, x, y) == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize("rover", ["husky", "jackal"])
@pytest.mark.parametrize("axis", AXES)
def test_tip_angle_is_the_analytic_one(rover: str, axis: Axis) -> None:
    point = measure_tilt(setup("firm", rover=rover), axis)
    assert point.tip_deg == pytest.approx(point.analytic_deg, abs=0.5)
    assert point.margin_zero_deg is not None
    assert point.tip_deg is not None
    assert point.tip_deg - 1.5 < point.margin_zero_deg <= point.tip_deg  # the alarm comes first


def test_analytic_tip_angle_by_hand() -> None:
    # Centre of mass: 46.034 x 0.029 / 56.582 above the axles, which are 0.1651 m above the ground.
    height = 0.1651 + 46.034 * 0.029 / 56.582
    assert measure_tilt(setup("firm"), "lateral").analytic_deg == pytest.approx(
        degrees(atan(0.2854 / height)), abs=1e-3
    )
    assert measure_tilt(setup("firm"), "uphill").analytic_deg == pytest.approx(degrees(atan(0.256 / height)), abs=1e-3)


@pytest.mark.parametrize(("rover", "low", "high"), [("husky", 1.75, 1.9), ("jackal", 1.4, 1.6)])
def test_track_ratio_on_firm_ground_falls_from_the_spot_to_wide_curves(rover: str, low: float, high: float) -> None:
    points = [measure_turn(setup("firm", rover=rover), radius) for radius in RADII_IN_TRACKS]
    ratios = [point.track_ratio for point in points]
    assert all(ratio is not None and low <= ratio <= high for ratio in ratios)
    assert ratios[0] == max(ratio for ratio in ratios if ratio is not None)
    assert ratios[0] is not None
    assert ratios[-1] is not None
    assert ratios[0] - ratios[-1] > 0.04
    radii = [point.radius_m for point in points]
    assert all(radius is not None for radius in radii)
    # Path radius is the commanded one times the ratio.
    assert radii[-1] == pytest.approx(RADII_IN_TRACKS[-1] * load_rover(rover).track_m * ratios[-1], rel=0.01)


@pytest.mark.parametrize("soil", ["firm", "loose_sand", "mars_sand"])
def test_three_turns_on_the_spot_stay_on_the_spot(soil: str) -> None:
    point = measure_turn(setup(soil), 0.0)
    assert point.drift_m is not None
    assert point.drift_m <= 0.10
    assert point.path_curvature == 0.0


@pytest.mark.parametrize("soil", ["firm", "loose_sand"])
@pytest.mark.parametrize("centre", ["[0.05, 0.0, 0.029]", "[0.0, 0.05, 0.029]"])
def test_an_unbalanced_rover_comes_back_after_three_whole_turns(soil: str, centre: str, tmp_path: Path) -> None:
    text = (Path(rover_file.__file__).parent / "rovers" / "husky.toml").read_text()
    assert "[0.0, 0.0, 0.029]" in text
    path = tmp_path / "lopsided.toml"
    path.write_text(text.replace("[0.0, 0.0, 0.029]", centre, 1))
    point = measure_turn(setup(soil, rover=str(path)), 0.0)
    assert point.drift_m is not None
    assert 1e-4 < point.drift_m <= 0.10  # it turns about a point beside its middle, which is back there once a turn


def test_drawbar_agrees_with_steady_wheels() -> None:
    # The rear wheels run in the ruts of the front ones: on firm ground that is nothing, in sand it helps.
    for soil, slip, more in (("firm", 0.1, 0.0), ("loose_sand", 0.2, 0.02)):
        point = measure_drawbar(setup(soil), slip)
        assert point.slip == pytest.approx(slip, abs=2e-3)
        assert point.pull_per_weight == pytest.approx(point.steady_wheel_per_weight + more, abs=1e-2)
        assert point.pull_N == pytest.approx(point.pull_per_weight * WEIGHT, abs=0.1)


def test_a_wheel_without_slip_has_to_be_pushed_through_sand() -> None:
    assert measure_drawbar(setup("loose_sand"), 0.0).pull_N < -10.0
