"""The autopilot with the real physics and sensors on a slope of soft sand under Mars gravity."""

from __future__ import annotations

import numpy as np
import pytest

from planner import localization
from rover_sim.autopilot.mission import DriveTo, Mission
from rover_sim.autopilot.modes import MissionState
from rover_sim.autopilot.tuning import tuned_autopilot
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import box_mesh, make_world, slope
from worlds.types import FloatArray, World

ROVER = load_rover("husky")
PHYSICS_STEPS = 5


def drive(world: World, places: list[tuple[float, float]], limit_s: float) -> tuple[FloatArray, bool]:
    """Drive a mission: the true track (T, 2) and whether it was completed in time."""
    footprint, model, track = ROVER.footprint(), localization.SensorModel(), []
    autopilot = tuned_autopilot(footprint, (0.0, 0.0, 0.0), world.scenario.gravity_m_s2)
    with Simulation(world, ROVER, np.random.default_rng(0)) as simulation:
        x, y, z = simulation.state.pose.position_w
        located = localization.start(simulation.read_sensors(), (x, y, z), model=model)
        autopilot.update(simulation.time_s, localization.estimate(located), simulation.read_sensors())
        autopilot.set_mission(Mission(tuple(DriveTo((*place, 0.0)) for place in places)))
        assert autopilot.arm() is None
        assert autopilot.start_mission() is None
        while simulation.time_s < limit_s and autopilot.auto.state is not MissionState.COMPLETE:
            readings = simulation.read_sensors()
            located = localization.localize(located, readings, footprint, model)
            wheels = autopilot.update(simulation.time_s, localization.estimate(located), readings)
            for _ in range(PHYSICS_STEPS):
                simulation.step(wheels)
            track.append(simulation.state.pose.position_w[:2].copy())
    return np.array(track), autopilot.auto.state is MissionState.COMPLETE


def test_a_way_across_a_slope_is_kept() -> None:
    track, done = drive(make_world(slope(10.0, 10.0, 90.0), "mars_sand", 3.71), [(3.0, 0.0)], 15.0)
    assert done
    assert abs(track[:, 1]).max() < 0.10  # of which it slides 0.03 while it is set down
    assert abs(track[len(track) // 2 :, 1]).mean() < 0.05  # 0.12 where the slide is not known


@pytest.mark.parametrize(("x", "y", "height"), [(0.45, 0.28, 0.05), (0.6, 0.28, 0.05), (0.75, 0.23, 0.05)])
def test_a_low_rock_at_the_outer_wheels_of_a_bend_uphill_is_got_over(x: float, y: float, height: float) -> None:
    top = x * np.tan(np.deg2rad(11.0)) + height
    world = make_world(
        slope(11.0, 10.0), "mars_sand", 3.71, mesh=box_mesh((x - 0.06, y - 0.07, -0.2), (x + 0.06, y + 0.07, top))
    )
    _, done = drive(world, [(0.35, -0.12), (0.8, -0.7), (0.9, -1.6)], 20.0)
    assert done  # else a slip stop ends it
