"""Turning test: effective track ratio over the path radius on level ground, and the drift of turns on the spot."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from rover_sim.sim.rover import RoverModel
from rover_sim.sim.simulation import Simulation
from rover_sim.slope.rig import Setup, Stretch, drive, plane_world
from worlds.geometry import euler_from_quaternion
from worlds.soil_file import load_soil

RADII_IN_TRACKS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # commanded; 0 turns on the spot
TURNS = 3

_RUN_IN_WAY = 1.0  # wheelbases of rim travel before measuring
_MEASURED_WAY = 1.5
_GIVE_UP_WAY = 6.0  # times the rim travel that three turns would take without slip
_SIZE_M = 12.0


@dataclass(frozen=True)
class TurnPoint:
    """One steady turn to the left; drift only for turns on the spot."""

    soil: str
    gravity_m_s2: float
    rover: str
    command_radius_m: float  # of a rover that does not slip
    radius_m: float | None  # of the path; None where it does not turn
    track_ratio: float | None  # (V_right - V_left) / (track x yaw rate)
    path_curvature: float  # lambda = (V_right + V_left) / (V_right - V_left)
    yaw_rate_rad_s: float
    power_W: float
    sinkage_m: float
    drift_m: float | None  # of the body origin after three turns


def measure_turn(setup: Setup, radius_in_tracks: float) -> TurnPoint:
    """Turn with the rims of the faster side at the speed of the setup."""
    rover = setup.model()
    track = rover.track_m
    radius = radius_in_tracks * track
    scale = setup.speed_m_s / (radius + 0.5 * track)
    left, right = scale * (radius - 0.5 * track), scale * (radius + 0.5 * track)
    size = max(_SIZE_M, 12.0 * rover.wheelbase_m)
    world = plane_world(load_soil(setup.soil), setup.gravity_m_s2, 0.0, 0.0, size)
    wheelbase_s = rover.wheelbase_m / setup.speed_m_s
    with Simulation(world, rover, np.random.default_rng(0)) as simulation:
        speeds = _wheel_speeds(rover, left, right)
        drift = _drift(simulation, speeds, setup) if radius == 0.0 else None
        drive(simulation, speeds, _RUN_IN_WAY * wheelbase_s)
        stretch = drive(simulation, speeds, _MEASURED_WAY * wheelbase_s)
    turned = turned_rad(stretch)
    yaw_rate = turned / stretch.time_s
    turning = yaw_rate > 0.01 * (right - left) / track
    return TurnPoint(
        soil=setup.soil,
        gravity_m_s2=setup.gravity_m_s2,
        rover=setup.rover,
        command_radius_m=round(radius, 4),
        radius_m=round(_path_m(stretch) / turned, 4) if turning else None,
        track_ratio=round((right - left) / (track * yaw_rate), 4) if turning else None,
        path_curvature=round((right + left) / (right - left), 4),
        yaw_rate_rad_s=round(yaw_rate, 6),
        power_W=round(stretch.power_W, 3),
        sinkage_m=round(float(stretch.mean("sinkage_m").mean()), 6),
        drift_m=None if drift is None else round(drift, 5),
    )


def _wheel_speeds(rover: RoverModel, left: float, right: float) -> list[float]:
    """Rates (rad/s) of the wheels for rim speeds (m/s) of both sides."""
    radius = rover.wheel_shape().shear_radius_m
    return [(left if place[1] > 0.0 else right) / radius for place in rover.wheel.positions_m]


def _drift(simulation: Simulation, speeds: list[float], setup: Setup) -> float | None:
    """How far the body origin is from where it stood after three turns on the spot; None if it never gets round."""
    begin = simulation.state.pose.position_w[:2]
    seconds = _GIVE_UP_WAY * TURNS * pi * simulation.rover.track_m / setup.speed_m_s
    turned = 0.0
    while turned < TURNS * 2.0 * pi:
        if simulation.time_s > seconds:
            return None
        turned += turned_rad(drive(simulation, speeds, 0.0))
    return float(np.linalg.norm(simulation.state.pose.position_w[:2] - begin))


def turned_rad(stretch: Stretch) -> float:
    """Yaw (rad) from the first to the last sample, whole turns counted."""
    yaws = [euler_from_quaternion(state.pose.quaternion_w)[2] for state in stretch.states]
    unwrapped = np.unwrap(yaws)
    return float(unwrapped[-1] - unwrapped[0])


def _path_m(stretch: Stretch) -> float:
    """Length of the path of the body origin."""
    places = np.array([state.pose.position_w[:2] for state in stretch.states])
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
