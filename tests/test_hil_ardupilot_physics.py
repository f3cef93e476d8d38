"""Our physics behind the link, as the autopilot sees it: frames, signs and figures that belong together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import degrees, radians
from typing import Any, cast

import numpy as np
import pytest

from rover_sim.hil.ardupilot import ArduPilotSession
from rover_sim.hil.lockstep import Lockstep
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.session import Driven
from rover_sim.outcome import Reason
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.traverse import Stepped, Traverse
from tests import sim_factory
from tests.ardupilot_checks import GRAVITY_M_S2, check_rest, check_stream, column
from tests.ardupilot_double import Accepted, ArduPilotDouble, mix, servos
from tests.ardupilot_rig import MemoryPort
from worlds.types import World

PER_S = 240


class Drive:
    """A simulation in the place of a traverse: no planner, no judge."""

    def __init__(self, world: World, seconds: float) -> None:
        rover = load_rover("husky")
        self.world = world
        self.simulation = Simulation(world, rover, np.random.default_rng(0))
        self.outputs = OutputDriver(rover.footprint())
        self._steps = round(seconds * PER_S)

    def step(self, on_sight: object) -> Stepped:
        del on_sight
        self.simulation.step(self.outputs.wheel_speed_rad_s)
        self._steps -= 1
        return Stepped(False, None if self._steps else (Reason.GOAL, ""))

    def summary(self, *_: object, **__: object) -> dict[str, Any]:
        return {}

    def close(self) -> None:
        self.simulation.close()


def told(world: World, seconds: float, pwm: Callable[[float, Accepted | None], Sequence[int]]) -> list[Accepted]:
    """The states that the autopilot accepts; strict."""
    drive = Drive(world, seconds)
    port = MemoryPort(ArduPilotDouble(pwm))
    lockstep = Lockstep(loopback_only=True)
    with ArduPilotSession(
        port, lockstep, lambda: Driven(cast(Traverse, drive), drive.outputs), port.clockwork()
    ) as session:
        session.run()
    port.take()
    return port.double.states


def steady(throttle: float, steering: float, begin_s: float = 0.5) -> Callable[[float, Accepted | None], Sequence[int]]:
    """Still at first, then constant outputs."""
    return lambda time_s, _state: servos(*mix(throttle, steering)) if time_s >= begin_s else servos(1500, 1500)


def flat(heading_deg: float = 0.0, gravity: float = 9.81) -> World:
    return sim_factory.make_world(sim_factory.slope(0.0, 16.0), gravity=gravity, heading_deg=heading_deg)


def yaw_deg(state: Accepted) -> float:
    return degrees(state.vector("attitude")[2]) % 360.0


@pytest.mark.parametrize("gravity", [9.81, 3.71, 1.62])
def test_at_rest_it_feels_standard_gravity_on_any_world(gravity: float) -> None:
    states = told(flat(gravity=gravity), 1.0, steady(0.0, 0.0))
    check_stream(states)
    check_rest(states)


@pytest.mark.parametrize(("heading_deg", "compass_deg"), [(0.0, 90.0), (90.0, 0.0), (-90.0, 180.0)])
def test_the_yaw_is_a_compass_heading_and_ahead_is_that_way(heading_deg: float, compass_deg: float) -> None:
    states = told(flat(heading_deg), 3.0, steady(0.5, 0.0))
    check_stream(states)
    assert abs((yaw_deg(states[0]) - compass_deg + 180.0) % 360.0 - 180.0) < 1.0
    north, east, _ = states[-1].vector("position")
    ahead = north * np.cos(radians(compass_deg)) + east * np.sin(radians(compass_deg))
    assert ahead == pytest.approx(np.hypot(north, east), rel=1e-3)
    assert 0.8 < ahead < 1.4  # about half a metre a second for 2.5 s


def test_positive_steering_turns_clockwise() -> None:
    states = told(flat(90.0), 3.0, steady(0.0, 0.4))
    check_stream(states)
    assert column(states, "imu.gyro")[-240:, 2].mean() > 0.3
    assert 40.0 < yaw_deg(states[-1]) < 180.0


def test_a_right_hand_circle_is_felt_as_a_force_to_the_right() -> None:
    """v w to the right of the rover while it circles steadily; 0.45 m/s and 0.4 rad/s make 0.18 m/s2."""
    states = told(flat(90.0), 6.0, steady(0.45, 0.2))
    check_stream(states)
    last = states[-2 * PER_S :]
    speed = np.linalg.norm(column(last, "velocity")[:, :2], axis=1).mean()
    rate = column(last, "imu.gyro")[:, 2].mean()
    assert rate > 0.2
    assert column(last, "imu.accel_body")[:, 1].mean() == pytest.approx(speed * rate, rel=0.1)


def test_a_raised_nose_is_a_positive_pitch_and_gravity_leans_back() -> None:
    """North is uphill: the ground rises 10 degrees; at rest the rover feels g sin 10 ahead of it."""
    world = sim_factory.make_world(sim_factory.slope(10.0, 16.0, azimuth_deg=90.0), heading_deg=90.0)
    states = told(world, 1.0, steady(0.0, 0.0))
    check_stream(states)
    assert degrees(states[-1].vector("attitude")[1]) == pytest.approx(10.0, abs=0.5)
    assert states[-1].vector("imu.accel_body")[0] == pytest.approx(GRAVITY_M_S2 * np.sin(radians(10.0)), abs=0.1)


def test_a_lean_to_the_right_is_a_positive_roll() -> None:
    """It heads north on ground that rises to the west."""
    world = sim_factory.make_world(sim_factory.slope(10.0, 16.0, azimuth_deg=180.0), heading_deg=90.0)
    states = told(world, 0.5, steady(0.0, 0.0))
    assert degrees(states[-1].vector("attitude")[0]) == pytest.approx(10.0, abs=0.5)
    assert states[-1].vector("imu.accel_body")[1] < -1.0  # the ground pushes it to its left


def test_downhill_is_down() -> None:
    world = sim_factory.make_world(sim_factory.slope(10.0, 16.0, azimuth_deg=180.0), heading_deg=0.0)
    states = told(world, 3.0, steady(0.5, 0.0))
    check_stream(states)
    north, east, down = states[-1].vector("position")
    assert abs(north) < 0.1
    assert down == pytest.approx(east * np.tan(radians(10.0)), rel=0.05)
    assert states[-1].vector("velocity")[2] > 0.0
