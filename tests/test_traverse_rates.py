"""A traverse whose physics runs at the rate that an autopilot from outside asks for."""

from __future__ import annotations

import numpy as np
import pytest

from rover_sim.autopilot.tuning import tuned_autopilot
from rover_sim.driven_rover import home
from rover_sim.mavlink.stack import MavlinkStack
from rover_sim.onboard import Sight
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, Traverse
from worlds.build import build_world
from worlds.scenario import Goal, Rocks, Scenario, Terrain

SCENARIO = Scenario(
    name="short",
    terrain=Terrain(kind="flat", size_m=(12.0, 8.0)),
    rocks=Rocks(cfa=0.0),
    goal=Goal(position_m=(4.0, 0.0)),
)


@pytest.mark.parametrize("steps_per_s", [240, 250])
def test_camera_control_and_trace_go_with_the_steps(steps_per_s: int) -> None:
    world, rover = build_world(SCENARIO, 1), load_rover("husky")
    autopilot = tuned_autopilot(rover.footprint(), home(world), SCENARIO.gravity_m_s2)
    sights: list[Sight] = []
    with Traverse(
        world, rover, autopilot, MavlinkStack(world.origin, autopilot), RunOptions(), steps_per_s
    ) as traverse:
        for _ in range(4 * steps_per_s):
            stepped = traverse.step(sights.append)
            assert stepped.end is None
        assert traverse.simulation.time_s == pytest.approx(4.0)
        rows = traverse.recorder.arrays()
    assert [sight.frame.time_s for sight in sights] == pytest.approx(np.arange(8) / 2.0)
    assert np.diff(rows["time_s"]) == pytest.approx(10.0 / steps_per_s)
    assert rows["position_w"][-1, 0] == pytest.approx(1.3, abs=0.5)
