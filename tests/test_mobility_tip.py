from __future__ import annotations

from math import atan2, degrees, radians

import numpy as np
import pytest

from rover_sim.sim import truth
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.sim.stability import tip_angles
from tests.sim_factory import make_world, slope
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion
from worlds.types import FloatArray

ROVER = load_rover("husky")
BALANCE = truth.balance_of(ROVER, 3.71)
FEET = np.array(ROVER.wheel.positions_m)[BALANCE.outline] - [0.0, 0.0, ROVER.wheel.radius_m]
CENTRE = np.array(ROVER.centre_of_mass_b)
DOWN = np.array([0.0, 0.0, -1.0])
SIDES = 0.5 * (FEET + np.roll(FEET, -1, axis=0))  # middles of the axes
FRONT, REAR = int(np.argmax(SIDES[:, 0])), int(np.argmin(SIDES[:, 0]))
LEFT, RIGHT = int(np.argmax(SIDES[:, 1])), int(np.argmin(SIDES[:, 1]))
HEIGHT = CENTRE[2] + ROVER.wheel.radius_m
LATERAL, LENGTHWISE = atan2(ROVER.track_m / 2, HEIGHT), atan2(ROVER.wheelbase_m / 2, HEIGHT)


def fall(turn: FloatArray, rate: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[FloatArray, FloatArray]:
    """Angles left and rates over the four axes of the rover turned by ``turn`` (3, 3)."""
    angles, rates = np.empty(4), np.empty(4)
    tip_angles(FEET @ turn.T, turn @ CENTRE, DOWN, np.array(rate), angles, rates)
    return angles, rates


@pytest.mark.parametrize(
    ("axis", "expected"), [(FRONT, LENGTHWISE), (RIGHT, LATERAL), (REAR, LENGTHWISE), (LEFT, LATERAL)]
)
def test_on_level_ground_the_angle_left_is_the_static_tip_angle(axis: int, expected: float) -> None:
    assert fall(np.eye(3))[0][axis] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("axis", "rate"),
    [(FRONT, (0.0, 0.3, 0.0)), (RIGHT, (0.3, 0.0, 0.0)), (REAR, (0.0, -0.3, 0.0)), (LEFT, (-0.3, 0.0, 0.0))],
)
def test_the_rate_is_positive_toward_the_side_that_goes_down(axis: int, rate: tuple[float, float, float]) -> None:
    turn = rotation_from_quaternion(quaternion_from_euler(rate[0], rate[1], 0.0))
    (before, rates), (after, _) = fall(np.eye(3), rate), fall(turn)
    assert rates[axis] == pytest.approx(0.3)
    assert after[axis] - before[axis] == pytest.approx(-0.3, abs=1e-9)


def test_the_inertia_counts_the_wheels() -> None:
    """Roll: chassis 0.602, wheels as points 4 x 2.637 x 0.2854^2 = 0.859, their own 0.083, the offsets 0.007."""
    inertia = BALANCE.inertia_kg_m2
    assert inertia[0, 0] == pytest.approx(0.6022 + 4 * 2.637 * 0.2854**2 + 0.0906, abs=1e-3)
    assert np.allclose(inertia, inertia.T)
    assert inertia[0, 1] == pytest.approx(0.0, abs=1e-12)


def test_the_margin_of_a_parked_rover_falls_to_zero_at_the_tip_angle() -> None:
    """Across slopes of 10 and 20 degrees; the angle left is what the slope has not yet taken."""
    margins = []
    for slope_deg in (0.0, 10.0, 20.0):
        with Simulation(make_world(slope(slope_deg, azimuth_deg=90.0)), ROVER, np.random.default_rng(0)) as simulation:
            state = simulation.state
        margins.append(state.stability_margin)
        left = np.degrees(state.tip_angle_rad)
        lateral = degrees(LATERAL)
        assert left[[RIGHT, LEFT]] == pytest.approx([lateral - slope_deg, lateral + slope_deg], abs=0.5)
    assert margins == sorted(margins, reverse=True)


def test_a_push_counts_as_a_force_on_the_rover() -> None:
    """Sideways by a third of the weight at the height of the chassis' centre: the net force leans by atan(1/3)."""
    with Simulation(make_world(slope(0.0)), ROVER, np.random.default_rng(0)) as simulation:
        weight = ROVER.mass_kg * 9.81
        for _ in range(24):
            simulation.push((0.0, weight / 3, 0.0))
            simulation.step([0.0] * 4)
        pushed = simulation.state
        for _ in range(120):
            simulation.step([0.0] * 4)
        released = simulation.state
    assert pushed.stability_margin < 0.75
    assert released.stability_margin == pytest.approx(1.0, abs=0.02)
    assert abs(pushed.tilt_rad) < radians(3.0)
