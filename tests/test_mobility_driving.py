"""Mobility events where they are provoked in the real simulation."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.tip_alarm import NEEDED_S, run
from rover_sim.sim.mobility_events import Kind, MobilityLog
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import box_mesh, field, make_world, slope
from worlds.types import World

LOOK_STEPS = 10


def drive(world: World, wheel_speed: float, seconds: float, rover: str = "husky") -> MobilityLog:
    model = load_rover(rover)
    log = MobilityLog(model, world.scenario.gravity_m_s2)
    with Simulation(world, model, np.random.default_rng(0)) as simulation:
        for step in range(round(240 * seconds)):
            simulation.step([wheel_speed] * len(model.wheel.positions_m))
            if step % LOOK_STEPS == 0:
                log.look(simulation.state, LOOK_STEPS / 240.0)
    return log


def kinds(log: MobilityLog) -> set[Kind]:
    return {event.kind for event in log.events}


@pytest.mark.parametrize("rover", ["husky", "jackal", "rocker_bogie"])
def test_an_easy_slope_is_climbed_without_events(rover: str) -> None:
    assert kinds(drive(make_world(slope(8.0), "firm", start=(-2.0, 0.0)), 2.0, 3.0, rover)) == set()


def test_a_rover_that_cannot_climb_loses_traction_and_is_not_embedded_where_it_does_not_sink() -> None:
    log = drive(make_world(slope(25.0), "loose_sand"), 2.0, 3.0)
    assert [event.wheel for event in log.events if event.kind is Kind.TRACTION_LOSS] == [0, 1, 2, 3]
    assert Kind.EMBEDDING not in kinds(log)


def test_slip_sinkage_embeds() -> None:
    log = drive(make_world(slope(25.0), "mars_sand", 3.71), 2.0, 3.0)
    assert {event.wheel for event in log.events if event.kind is Kind.EMBEDDING} == {0, 1, 2, 3}


def test_a_ridge_between_the_axles_high_centres() -> None:
    heights = np.zeros((101, 101))
    heights[:, 49:52] = 0.25
    log = drive(make_world(field(heights), "firm"), 0.0, 1.0)
    assert Kind.HIGH_CENTRED in kinds(log)
    assert Kind.SUPPORT_LOSS in kinds(log)


def test_a_rock_under_the_belly_high_centres() -> None:
    log = drive(make_world(slope(0.0), "firm", mesh=box_mesh((-0.1, -0.1, -0.1), (0.1, 0.1, 0.2))), 0.0, 1.0)
    assert Kind.HIGH_CENTRED in kinds(log)


def test_wheels_in_trenches_across_the_way_are_trapped() -> None:
    """Both axles stand in trenches of 28 cm width and 12 cm depth: on sand no wheel of 33 cm climbs out of them."""
    heights = np.zeros((201, 201))
    for column in (107, 94):  # 4 cm cells at +-0.256 m
        heights[:, column - 3 : column + 4] = -0.12
    log = drive(make_world(field(heights, 0.04), "dry_sand"), 2.0, 4.0)
    assert {event.wheel for event in log.events if event.kind is Kind.WHEEL_TRAP} == {0, 1, 2, 3}


def test_the_alarm_comes_before_the_tip() -> None:
    """Some runs of the benchmark of the alarm; most of them tip."""
    outcomes = [run(seed) for seed in (9, 16, 22, 35, 43, 54)]
    leads = [outcome.lead_s for outcome in outcomes if outcome.tipped]
    assert len(leads) >= 3
    assert all(lead is not None and lead >= NEEDED_S for lead in leads)
