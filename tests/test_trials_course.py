"""Obstacle-course worlds driven whole, by the scanner and by the camera; and eyes that fall silent."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from rover_sim.outcome import Judge, Limits, Reason
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.traverse import RunOptions, open_traverse
from rover_sim.trials.course import Course, course_scenario
from rover_sim.trials.drive import drive
from rover_sim.trials.suites import trials_of
from rover_sim.trials.trial import Row, Trial
from rover_sim.true_obstacles import check_start
from tests.data import data_path
from worlds.build import build_world
from worlds.errors import ScenarioError
from worlds.scenario import Camera, Goal, Obstacle, Rocks, Scenario, Sensors, SoilChoice, Terrain


def _row(tmp_path: Path, sensors: str, world: float) -> Row:
    trials = trials_of("obstacle-course", {"sensors": (sensors,), "world": (world,)}, range(1), data_path("worlds"))
    return drive(trials[0], tmp_path, "none")


def test_a_course_is_driven_by_the_scanner(tmp_path: Path) -> None:
    row = _row(tmp_path, "laser", 12.0)
    assert (row.success, row.reason) == (True, "goal")
    assert row.metrics["frames"] == 0
    assert row.metrics["violations"] == []
    assert row.metrics["score"] > 0.35
    assert row.metrics["spl"] > 0.7


def test_a_course_is_driven_by_the_camera_alone(tmp_path: Path) -> None:
    row = _row(tmp_path, "camera", 12.0)
    assert row.reason != "collision"
    assert row.metrics["frames"] > 10


@pytest.mark.slow
def test_course_cell_by_the_scanner(tmp_path: Path) -> None:
    """Small cell of the recorded run: odd worlds, which nothing was tuned on."""
    rows = [_row(tmp_path, "laser", float(number)) for number in range(1, 41, 8)]
    assert sum(row.success for row in rows) >= 4
    assert sum(row.metrics["score"] for row in rows) / len(rows) >= 0.40


def test_a_touch_of_a_pillar_by_a_wheel_alone_is_noticed() -> None:
    """The hull is 0.155 m wide to the left, the wheel reaches from 0.168 to 0.208 m."""
    course = Course(0, np.array([[-2.25 - 0.255, 4.0]]), np.array([[-2.25, 3.0], [-2.25, 13.0]]))
    world = build_world(course_scenario(course, laser=True), 0)
    with Simulation(world, load_rover("jackal"), np.random.default_rng(0)) as simulation:
        touched = False
        for _ in range(480):
            simulation.step([8.0] * 4)
            touched = touched or simulation.take_wheel_touch()
        assert touched
        judge = Judge(Limits(touch_ends=True))
        assert judge.look(simulation.state, (), 0.04, digging=False) is None
        assert judge.look(simulation.state, (), 0.04, digging=False, wheel_touched=True) is Reason.COLLISION


def _blind(sensors: Sensors, camera: Camera) -> Scenario:
    return Scenario(
        name="blind",
        terrain=Terrain(kind="flat", size_m=(14.0, 10.0), resolution_m=0.1),
        rocks=Rocks(cfa=0.0),
        soil=SoilChoice(preset="firm"),
        goal=Goal(position_m=(8.0, 0.0), time_limit_s=60.0),
        sensors=sensors,
        camera=camera,
    )


@pytest.mark.parametrize(
    ("sensors", "camera", "name"),
    [
        (Sensors(laser=True, laser_fails_s=2.0), Camera(rate_hz=0.0), "laser"),
        (Sensors(camera_fails_s=2.0), Camera(), "camera"),
    ],
)
def test_an_eye_that_falls_silent_ends_the_run_with_its_name(
    tmp_path: Path, sensors: Sensors, camera: Camera, name: str
) -> None:
    row = drive(Trial("x", {}, 0, _blind(sensors, camera)), tmp_path, "none")
    assert (row.success, row.reason) == (False, "sensor_lost")
    assert row.metrics["detail"].startswith(f"the {name} has been silent for")
    assert row.metrics["sim_time_s"] < 4.5


def test_a_start_on_a_rock_is_refused_by_its_place() -> None:
    scenario = Scenario(
        name="x",
        terrain=Terrain(kind="flat", size_m=(14.0, 10.0), resolution_m=0.1),
        rocks=Rocks(cfa=0.0),
        obstacle=(Obstacle(kind="rock", position_m=(0.55, 0.1), radius_m=0.2, height_m=0.3),),
        goal=Goal(position_m=(8.0, 0.0)),
    )
    husky = load_rover("husky")
    with pytest.raises(ScenarioError, match=r"rover.start_m = .* would stand on the obstacle at \[0\.5"):
        open_traverse(build_world(scenario, 0), husky, RunOptions())
    low = (msgspec.structs.replace(scenario.obstacle[0], height_m=0.1),)
    check_start(build_world(msgspec.structs.replace(scenario, obstacle=low), 0), husky.footprint())
