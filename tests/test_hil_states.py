"""Motion as autopilots want it told, against cases worked by hand."""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.states import STANDARD_GRAVITY_M_S2, NedSampler, NedState, ned_state
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import make_world, slope
from worlds.geometry import quaternion_from_euler
from worlds.types import FloatArray, Vector3

G = STANDARD_GRAVITY_M_S2
STILL = np.zeros(3)


def told(
    pitch_deg: float = 0.0,
    yaw_deg: float = 0.0,
    place: Vector3 = (0.0, 0.0, 0.0),
    velocity: Vector3 = (0.0, 0.0, 0.0),
    rate: Vector3 = (0.0, 0.0, 0.0),
    acceleration: FloatArray = STILL,
) -> NedState:
    """A motion in east-north-up with a body forward-left-up; pitch positive nose down, yaw from east to north."""
    attitude = quaternion_from_euler(0.0, radians(pitch_deg), radians(yaw_deg))
    return ned_state(1.0, np.array([*place, *attitude, *velocity, *rate]), STILL, acceleration)


def test_level_and_still_it_feels_to_be_held_up() -> None:
    assert told().specific_force_m_s2 == pytest.approx((0.0, 0.0, -G))


def test_facing_east_is_a_quarter_turn_clockwise_from_north() -> None:
    assert told().quaternion == pytest.approx((cos(pi / 4), 0.0, 0.0, sin(pi / 4)))


def test_facing_north_is_no_turn() -> None:
    assert np.abs(told(yaw_deg=90.0).quaternion) == pytest.approx((1.0, 0.0, 0.0, 0.0))


def test_places_and_speeds_are_north_east_down() -> None:
    state = told(place=(1.0, 2.0, 3.0), velocity=(4.0, 5.0, 6.0))
    assert state.position_m == (2.0, 1.0, -3.0)
    assert state.velocity_m_s == (5.0, 4.0, -6.0)


def test_nose_up_leans_the_weight_to_the_rear() -> None:
    """Held up, the body feels a push forward by the slope: + g sin(20 deg) along x."""
    state = told(pitch_deg=-20.0)
    slope = radians(20.0)
    assert state.specific_force_m_s2 == pytest.approx((G * sin(slope), 0.0, -G * cos(slope)))


def test_a_left_turn_at_constant_speed_pulls_to_the_left() -> None:
    """Facing north at 2 m/s, 0.5 rad/s to the left: 1 m/s^2 to the west, seen as yaw rate -0.5 and y -1."""
    state = told(yaw_deg=90.0, velocity=(0.0, 2.0, 0.0), rate=(0.0, 0.0, 0.5), acceleration=np.array([-1.0, 0.0, 0.0]))
    assert state.rate_rad_s == pytest.approx((0.0, 0.0, -0.5))
    assert state.specific_force_m_s2 == pytest.approx((0.0, -1.0, -G))


def test_a_running_rover_is_told_consistently() -> None:
    """Velocity is the change of place, and specific force the change of velocity."""
    rover = load_rover("husky")
    driver = OutputDriver(rover.footprint())
    driver.set(0.3, 0.6)
    with Simulation(make_world(slope(0.0, 12.0)), rover, np.random.default_rng(1)) as simulation:
        sampler = NedSampler(simulation)
        states = [sampler.sample()]
        for _ in range(240):
            simulation.step(driver.wheel_speed_rad_s)
            states.append(sampler.sample())
    assert states[0].position_m == (0.0, 0.0, 0.0)
    places, speeds = (np.array([getattr(state, name) for state in states]) for name in ("position_m", "velocity_m_s"))
    assert np.diff(places, axis=0) * 240 == pytest.approx(speeds[1:], abs=2e-4)
    assert np.hypot(*places[-1, :2]) > 0.1
    felt = np.array([state.specific_force_m_s2 for state in states])
    assert felt[:, 2].mean() == pytest.approx(-G, abs=0.05)
