"""MAVSDK steers each persona, by sticks and by set points, as far as MAVSDK itself lets it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from planner.mobility import STOP
from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.persona import PERSONAS
from tests.mavlink_live import LiveRover, connected_pair, place

STICK_PERIOD_S = 0.04


@pytest.fixture(scope="module", params=PERSONAS)
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[LiveRover, Any, str]]:
    """A live rover of each persona, and MAVSDK's view of it."""
    with connected_pair(PERSONAS[request.param]) as (live, system):
        yield live, system, request.param


def stick(live: LiveRover, manual: Any, steer: float, thrust: float, done: Callable[[], bool]) -> None:
    """Repeat the sticks, as MAVSDK does not, until ``done``."""
    end = time.perf_counter() + 8.0
    while not live.locked(done):
        assert time.perf_counter() < end, "time limit"
        manual.set_manual_control_input(0.0, steer, thrust, 0.0)
        live.wait(STICK_PERIOD_S)


def test_sticks(pair: tuple[LiveRover, Any, str]) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.manual_control import ManualControl, ManualControlError
    from mavsdk.plugins.param import Param

    live, system, persona = pair
    action, manual, param = Action(system), ManualControl(system), Param(system)
    centre = 0.5 if persona == "px4" else 0.0  # MAVSDK's own range is 0 to 1
    if persona == "ardupilot":
        param.set_param_int("MAV_GCS_SYSID", 245)  # ArduPilot takes sticks of one system, 255 unless told otherwise
    autopilot = live.autopilot
    live.locked(lambda: autopilot.set_mode(Mode.HOLD))
    stick(live, manual, 0.0, centre, lambda: autopilot.pilot.sticks is not None)
    action.arm()
    stick(live, manual, 0.0, centre, lambda: autopilot.armed)
    if persona == "ardupilot":
        with pytest.raises(ManualControlError):
            manual.start_position_control()  # refused inside MAVSDK
        live.locked(lambda: autopilot.set_mode(Mode.MANUAL))
    else:
        manual.start_position_control()
        manual.start_altitude_control()
    assert autopilot.mode is Mode.MANUAL
    stick(live, manual, 0.0, centre, lambda: autopilot.pilot.sticks is not None)
    stick(live, manual, 0.0, 1.0, lambda: autopilot.motion.linear_m_s > 0.2)
    stick(live, manual, 0.5, centre, lambda: autopilot.motion.yaw_rate_rad_s < -0.2)
    if persona == "px4":
        stick(live, manual, 0.0, 0.0, lambda: autopilot.motion.linear_m_s < -0.2)
    stick(live, manual, 0.0, centre, lambda: autopilot.motion == STOP)
    action.disarm()
    for plugin in (param, manual, action):
        plugin.destroy()


def test_offboard(pair: tuple[LiveRover, Any, str]) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.offboard import Offboard, OffboardError, PositionNedYaw, VelocityBodyYawspeed, VelocityNedYaw

    live, system, _ = pair
    action, offboard, autopilot = Action(system), Offboard(system), live.autopilot
    action.arm()
    with pytest.raises(OffboardError):
        offboard.start()  # MAVSDK wants a set point first
    offboard.set_velocity_body(VelocityBodyYawspeed(0.5, 0.0, 0.0, 10.0))
    offboard.start()
    live.until(lambda: autopilot.mode is Mode.GUIDED)
    live.until(lambda: autopilot.motion.linear_m_s == pytest.approx(0.5))
    assert autopilot.motion.yaw_rate_rad_s == pytest.approx(-math.radians(10.0), rel=1e-3)
    offboard.set_velocity_ned(VelocityNedYaw(0.0, -0.5, 0.0, 270.0))  # west
    live.until(lambda: abs(math.sin(live.rover.yaw_rad)) < 0.05 and math.cos(live.rover.yaw_rad) < 0.0)
    live.until(lambda: autopilot.motion.linear_m_s > 0.45)
    goal = (live.rover.x_m - 0.5, live.rover.y_m - 0.6)
    offboard.set_position_ned(PositionNedYaw(goal[1], goal[0], 0.0, 0.0))
    live.until(lambda: math.hypot(live.rover.x_m - goal[0], live.rover.y_m - goal[1]) < 0.4)
    offboard.stop()
    live.until(lambda: autopilot.mode is Mode.HOLD and autopilot.motion == STOP)
    action.disarm()
    offboard.destroy()
    action.destroy()


def test_offboard_to_a_place_on_earth(pair: tuple[LiveRover, Any, str]) -> None:
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.offboard import Offboard, PositionGlobalYaw

    live, system, _ = pair
    action, offboard, autopilot = Action(system), Offboard(system), live.autopilot
    action.arm()
    goal = (live.rover.x_m + 0.8, live.rover.y_m)
    point = place(live, *goal)
    kind = PositionGlobalYaw.AltitudeType.AMSL
    offboard.set_position_global(PositionGlobalYaw(point.latitude_deg, point.longitude_deg, 0.0, 0.0, kind))
    offboard.start()
    live.until(lambda: math.hypot(live.rover.x_m - goal[0], live.rover.y_m - goal[1]) < 0.4)
    offboard.stop()
    live.until(lambda: autopilot.mode is Mode.HOLD)
    action.disarm()
    offboard.destroy()
    action.destroy()
