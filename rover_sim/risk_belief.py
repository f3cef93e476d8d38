"""What is believed of a route's ground and of the rover before the drive, as forecasts of its risk want it."""

from __future__ import annotations

from planner.denoise import error_left
from planner.fine_relief import map_error
from planner.risk import Vehicle
from planner.risk_prior import SoilPrior
from planner.route_ground import ElevationMap
from planner.route_risk import RiskModel
from rover_sim.errors import InputError
from rover_sim.sim.rover import RoverModel
from worlds.risk_table import RiskTable
from worlds.scenario import Scenario
from worlds.soil_file import load_soil

STREAM = 107  # of the seed


def risk_vehicle(rover: RoverModel, scenario: Scenario) -> Vehicle | None:
    """The rover as a forecast sees it; None for one that is not rigid on four wheels.

    Raises InputError where a limit is asked for of such a rover.
    """
    footprint, risk = rover.footprint(), scenario.risk
    if footprint.body is not None:
        return Vehicle(footprint, rover.wheel_shape(), rover.mass_kg, rover.centre_of_mass_b, rover.wheel.stiffness_N_m)
    if risk is not None and risk.limit is not None:
        raise InputError(
            f"{scenario.name}: risk.limit = {risk.limit:g}: there is no forecast for rover.model = "
            f'"{scenario.rover.model}"; allowed are rigid rovers on four wheels'
        )
    return None


def risk_model(scenario: Scenario, measured: ElevationMap, vehicle: Vehicle, seed: int) -> RiskModel:
    """The model of a scenario: its table ``[risk]`` or the defaults, and the error that the filtered map still has."""
    table = scenario.risk or RiskTable()
    names = table.soils or (scenario.soil.preset,)
    prior = SoilPrior(tuple(load_soil(name) for name in names), table.weights or (1.0,) * len(names))
    error = map_error(measured) if table.roughness_m is None else error_left(measured, table.roughness_m)
    return RiskModel(error, prior, vehicle, scenario.gravity_m_s2, (seed, STREAM), table.limit)
