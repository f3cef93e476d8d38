from __future__ import annotations

from math import degrees

import pytest

from rover_sim.hil.ardupilot_parameters import parameter_text, parameters
from rover_sim.hil.handling import CRUISE_SHARE, Handling, measure_handling
from rover_sim.sim.rover import load_rover
from worlds.soil_file import load_soil

HUSKY = load_rover("husky")


def test_the_gains_follow_from_the_handling() -> None:
    """By hand: 2 rad/s is 114.6 deg/s; the motors reach 6 rad/s in a second; half of 6 rad/s2 on 0.1651 m."""
    values = parameters(HUSKY, Handling(turn_rate_rad_s=2.0, cruise_m_s=0.55, full_m_s=0.9), goal_radius_m=0.5)
    assert values["ATC_STR_RAT_FF"] == 0.5
    assert values["ATC_STR_RAT_MAX"] == pytest.approx(0.8 * 114.5916)
    assert values["ATC_STR_ACC_MAX"] == pytest.approx(114.5916)
    assert values["WP_PIVOT_RATE"] == pytest.approx(57.2958)
    assert values["ATC_ACCEL_MAX"] == pytest.approx(0.4953)
    assert (values["CRUISE_SPEED"], values["CRUISE_THROTTLE"]) == (0.55, 60.0)
    assert values["WP_SPEED"] == 0.6
    assert values["WP_RADIUS"] == 0.25


def test_both_sides_are_outputs_of_a_tank() -> None:
    values = parameters(HUSKY, Handling(2.0, 0.55, 0.9), 0.5)
    assert (values["SERVO1_FUNCTION"], values["SERVO3_FUNCTION"]) == (73, 74)
    for channel in ("SERVO1", "SERVO3", "RC1", "RC3"):
        assert [values[f"{channel}_{end}"] for end in ("MIN", "TRIM", "MAX")] == [1000, 1500, 2000]


def test_a_slow_rover_is_asked_for_less_and_a_small_goal_for_more_care() -> None:
    values = parameters(HUSKY, Handling(0.5, 0.2, 0.3), goal_radius_m=0.2)
    assert values["WP_SPEED"] == pytest.approx(0.24)
    assert values["WP_RADIUS"] == pytest.approx(0.1)
    assert values["WP_PIVOT_RATE"] == pytest.approx(degrees(0.25))


def test_the_file_has_a_line_for_each_parameter() -> None:
    assert parameter_text({"SERVO1_FUNCTION": 73, "ATC_STR_RAT_FF": 0.59168}, "husky") == (
        "# husky\nSERVO1_FUNCTION 73\nATC_STR_RAT_FF 0.5917\n"
    )


def test_names_fit_the_autopilot() -> None:
    assert all(len(name) <= 16 for name in parameters(HUSKY, Handling(2.0, 0.55, 0.9), 0.5))


def test_firm_ground_gives_what_the_wheels_promise() -> None:
    """Husky: 1.02 m/s at the rims; the effective track on firm ground is 1.88 times the real one on the spot."""
    found = measure_handling(HUSKY, load_soil("firm"), 9.81)
    rim = HUSKY.footprint().max_speed_m_s
    assert found.full_m_s == pytest.approx(rim, rel=0.02)
    assert found.cruise_m_s == pytest.approx(CRUISE_SHARE * rim, rel=0.02)
    assert found.turn_rate_rad_s == pytest.approx(2.0 * rim / (1.88 * HUSKY.track_m), rel=0.05)


def test_sand_takes_some_of_both() -> None:
    firm, sand = (measure_handling(HUSKY, load_soil(name), g) for name, g in (("firm", 9.81), ("mars_sand", 3.71)))
    assert 0.0 < sand.turn_rate_rad_s < firm.turn_rate_rad_s
    assert 0.0 < sand.cruise_m_s < firm.cruise_m_s
