"""The first plan in a scenario: one look from where the rover stands at the start, as ``run`` would begin."""

from __future__ import annotations

import math

import numpy as np

from rover_sim.driven_rover import home
from rover_sim.errors import InputError
from rover_sim.handover_plans import HandoverPlan, Spot, placed
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.plan_items import risky_speed, way_items
from rover_sim.onboard import Sight
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, open_traverse
from worlds.types import World


def plan_of_scenario(world: World, spot: Spot | None, speed_m_s: float | None) -> HandoverPlan:
    """What the planner wants to drive after its first picture; ``spot``: where the start truly is.

    Raises InputError where there is no camera, or no way from the start.
    """
    scenario = world.scenario
    sight = _first_sight(world)
    decision = sight.decision
    if decision.kind != "drive":
        raise InputError(f"{scenario.name}: no way from the start: {decision.reason or decision.kind}")
    speed = speed_m_s or (risky_speed(decision.risk) if decision.speed_m_s is None else decision.speed_m_s)
    way = np.asarray(decision.waypoints_w, dtype=float)
    source = f"{scenario.name}, seed {world.seed}"
    if spot is not None:
        yaw = math.radians(scenario.rover.heading_deg)
        ahead = way[1:] - np.asarray(scenario.rover.start_m)
        cos, sin = math.cos(yaw), math.sin(yaw)
        return placed(ahead @ np.array([[cos, -sin], [sin, cos]]), spot, speed, source)
    home_w = home(world)
    items = way_items(way[1:], home_w[2], LocalFrame(world.origin), home_w, speed)
    return HandoverPlan(tuple(items), source)


def _first_sight(world: World) -> Sight:
    scenario = world.scenario
    if scenario.camera.rate_hz <= 0.0:
        raise InputError(f"{scenario.name}: camera.rate_hz is 0; allowed: a scenario whose rover has a camera")
    sights: list[Sight] = []
    with open_traverse(world, load_rover(scenario.rover.model), RunOptions()) as traverse:
        while not sights:
            traverse.step(sights.append)
    return sights[0]
