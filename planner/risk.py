"""The risk of a way before it is driven: how likely the rover goes over, gets stuck or strays from it.

A few hundred rollouts of a reduced rover (`planner.risk_kernels`), each over another draw of soil, map and bumps
(`planner.risk_prior`), after Golda, Iagnemma and Dubowsky, ICRA 2004.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from scipy.special import betaincinv

from planner import risk_kernels as kernels
from planner.denoise import nearest_known
from planner.mobility import MOST_DRIFT_RAD, Limits
from planner.monitor import MonitorLimits
from planner.risk_prior import MapError, SoilPrior, check_map_error, draw_error, draw_soils
from planner.risk_soil import Traction, traction
from worlds.errors import InputError
from worlds.heightfield import grid_points, height_at
from worlds.types import FloatArray, Footprint, HeightField, IntArray, Vector3
from worlds.wong_reece import WheelShape

ROLLOUTS = 200
PLACE_SD_M = 0.05  # of where the rover believes to be
TILT_LIMIT_DEG, TILT_S, STUCK_S = 35.0, 0.5, 6.0  # the autopilot's fail-safes
COVERAGE = 0.95  # of the intervals
AROUND_M = 3.0  # of ground beside a way, and twice what map errors reach
FINE_M = 0.25  # half a wheelbase: between heights where relief below the map's cells is drawn
_SLOWEST_SHARE = 0.3  # of the cruise speed, that bounds the time of a rollout


@dataclass(frozen=True)
class Vehicle:
    """The rover as the forecast sees it: rigid, on four wheels."""

    footprint: Footprint
    wheel: WheelShape
    mass_kg: float
    centre_of_mass_m: Vector3  # body axes, from the middle of the axles at their height
    stiffness_N_m: float  # of a wheel and the ground under it
    cruise_m_s: float = 0.6


@dataclass(frozen=True)
class Chance:
    """A probability, with the interval that a count of rollouts leaves (Jeffreys: Beta of count + 1/2)."""

    probability: float
    low: float
    high: float

    @staticmethod
    def of(count: int, total: int) -> Chance:
        """From ``count`` of ``total`` rollouts."""
        a, b, tail = count + 0.5, total - count + 0.5, 0.5 * (1.0 - COVERAGE)
        low = 0.0 if count == 0 else float(betaincinv(a, b, tail))
        high = 1.0 if count == total else float(betaincinv(a, b, 1.0 - tail))
        return Chance(count / total, low, high)


@dataclass(frozen=True, eq=False)
class Forecast:
    """What is to be expected of a way."""

    rollover: Chance
    immobilised: Chance  # stopped short of the end: slip, no progress, tilt
    fails: Chance  # either of the two
    lateral_mean_m: float  # of the largest distance from the way
    lateral_sd_m: float
    lateral_p95_m: float
    ends: IntArray  # (rollouts,) `risk_kernels.ARRIVED` and so on
    arcs_m: FloatArray  # (rollouts,) how far along the way each came
    lateral_m: FloatArray  # (rollouts,)


def forecast(
    way_w: FloatArray,
    ground: HeightField,
    error: MapError,
    prior: SoilPrior,
    vehicle: Vehicle,
    gravity_m_s2: float,
    rng: np.random.Generator,
    rollouts: int = ROLLOUTS,
) -> Forecast:
    """The forecast of a way (N, 2), N >= 2, over a believed map without gaps.

    Raises InputError for a prior or an error of the map that cannot be, and for too short a way.
    """
    return forecasts([way_w], ground, error, prior, vehicle, gravity_m_s2, rng, rollouts)[0]


def forecasts(
    ways_w: Sequence[FloatArray],
    ground: HeightField,
    error: MapError,
    prior: SoilPrior,
    vehicle: Vehicle,
    gravity_m_s2: float,
    rng: np.random.Generator,
    rollouts: int = ROLLOUTS,
) -> tuple[Forecast, ...]:
    """The forecast of each of some ways; rollouts of one number drive in the same soil on all of them.

    Each way (N, 2), N >= 2, begins at rest. The ground may have gaps (NaN) beside the ways, where the nearest height
    goes on. Raises InputError as `forecast` does.
    """
    check_map_error(error)
    for way in ways_w:
        if rollouts < 1 or len(way) < 2:
            raise InputError(f"risk forecast: {rollouts} rollouts over {len(way)} points; at least 1 over 2 are wanted")
    load_N = 0.25 * vehicle.mass_kg * gravity_m_s2
    soils = traction(draw_soils(prior, rollouts, rng), vehicle.wheel, load_N, gravity_m_s2)
    car, around_m = constants(vehicle, gravity_m_s2), AROUND_M + 2.0 * error.correlation_m
    cut = [clipped(ground, way, around_m) for way in ways_w]
    if error.relief_m > 0.0:
        cut = [finer(part, FINE_M) for part in cut]
    return tuple(
        summarise(_rolled(way, part, error, soils, car, rng, rollouts)) for way, part in zip(ways_w, cut, strict=True)
    )


def joined(legs: Sequence[Forecast]) -> Forecast:
    """The forecast of legs (one at least) driven one after the other, that were forecast together.

    A rollout ends at the first leg on whose end it does not come.
    """
    ends = np.array([leg.ends for leg in legs])
    last = np.where((ends != kernels.ARRIVED).any(axis=0), (ends != kernels.ARRIVED).argmax(axis=0), len(legs) - 1)
    driven = np.arange(len(legs))[:, None] <= last
    results = np.zeros((ends.shape[1], kernels.RESULTS))
    results[:, kernels.END] = np.take_along_axis(ends, last[None, :], axis=0)[0]
    results[:, kernels.ARC] = (driven * [leg.arcs_m for leg in legs]).sum(axis=0)
    results[:, kernels.LATERAL] = (driven * [leg.lateral_m for leg in legs]).max(axis=0)
    return summarise(results)


def clipped(ground: HeightField, way_w: FloatArray, around_m: float) -> HeightField:
    """The part of a field that lies within a distance of a way's box, at least 2 x 2, gaps filled by the nearest."""
    cell, shape = ground.resolution_m, np.array(ground.heights_m.shape[::-1])
    low = np.floor((way_w.min(axis=0) - around_m - np.asarray(ground.origin_m)) / cell).astype(int)
    high = np.ceil((way_w.max(axis=0) + around_m - np.asarray(ground.origin_m)) / cell).astype(int) + 1
    low, high = np.clip(low, 0, shape - 2), np.clip(high, 2, shape)
    heights = ground.heights_m[low[1] : high[1], low[0] : high[0]]
    if not np.isfinite(heights).all():
        heights = nearest_known(heights, np.isfinite(heights))
    corner = ground.origin_m[0] + cell * float(low[0]), ground.origin_m[1] + cell * float(low[1])
    return HeightField(np.ascontiguousarray(heights), cell, corner)


def finer(ground: HeightField, cell_m: float) -> HeightField:
    """The same bilinear surface by heights no more than ``cell_m`` apart."""
    parts = ceil(ground.resolution_m / cell_m - 1e-9)
    (x, y), cell = grid_points(ground), ground.resolution_m / parts
    across, down = (axis[0] + cell * np.arange((len(axis) - 1) * parts + 1) for axis in (x, y))
    return HeightField(height_at(ground, across[None, :], down[:, None]), cell, ground.origin_m)


def _rolled(
    way_w: FloatArray,
    ground: HeightField,
    error: MapError,
    soils: Traction,
    car: FloatArray,
    rng: np.random.Generator,
    rollouts: int,
) -> FloatArray:
    """Results (rollouts, RESULTS) of driving a way, each in its soil and over its own draw of the map."""
    way = np.ascontiguousarray(way_w, dtype=np.float64)
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    steps = ceil(length / (_SLOWEST_SHARE * car[kernels.CRUISE]) / kernels.STEP_S) + 200
    grid = (*ground.origin_m, 1.0 / ground.resolution_m)
    results = np.zeros((rollouts, kernels.RESULTS))
    for i, result in enumerate(results):
        drawn = ground.heights_m + draw_error(ground, error, rng)
        bumps, place = rng.normal(size=(steps, 4)), PLACE_SD_M * rng.normal(size=2)
        soil = soils.curves[i], soils.load_exponent[i]
        kernels.roll_out(drawn, grid, way, *soil, car, place, error.roughness_m, bumps, result)
    return results


def summarise(results: FloatArray) -> Forecast:
    """The forecast of rollouts (N, RESULTS)."""
    ends, lateral, total = results[:, kernels.END].astype(np.int32), results[:, kernels.LATERAL], len(results)
    over, stuck = (int(np.count_nonzero(ends == end)) for end in (kernels.ROLLOVER, kernels.IMMOBILISED))
    return Forecast(
        rollover=Chance.of(over, total),
        immobilised=Chance.of(stuck, total),
        fails=Chance.of(over + stuck, total),
        lateral_mean_m=float(lateral.mean()),
        lateral_sd_m=float(lateral.std()),
        lateral_p95_m=float(np.quantile(lateral, 0.95)),
        ends=ends,
        arcs_m=results[:, kernels.ARC],
        lateral_m=lateral,
    )


def constants(vehicle: Vehicle, gravity_m_s2: float) -> FloatArray:
    """The vector (CONSTANTS,) of a vehicle that is driven by the built-in autopilot, tuned to its gravity."""
    body, limits, monitor = vehicle.footprint, Limits(), MonitorLimits()
    half_track = 0.5 * body.effective_track_ratio * body.track_m
    ahead, left, up = vehicle.centre_of_mass_m
    car = np.zeros(kernels.CONSTANTS)
    car[kernels.TRACK], car[kernels.WHEELBASE], car[kernels.RADIUS] = (
        body.track_m,
        body.wheelbase_m,
        body.wheel_radius_m,
    )
    car[kernels.COM_AHEAD], car[kernels.COM_LEFT], car[kernels.COM_UP] = ahead, left, vehicle.wheel.radius_m + up
    car[kernels.HALF_TRACK], car[kernels.GRAVITY] = half_track, gravity_m_s2
    car[kernels.CRUISE], car[kernels.CREEP] = vehicle.cruise_m_s, limits.creep_speed_m_s
    car[kernels.ACCELERATION] = limits.acceleration_m_s2 * gravity_m_s2 / 3.71
    car[kernels.LOOKAHEAD], car[kernels.LOOKAHEAD_S] = 0.5 * body.length_m, limits.lookahead_time_s
    car[kernels.SLOW_RADIUS], car[kernels.SLOW_DISTANCE] = 1.2 * body.length_m, limits.slow_distance_m
    car[kernels.ARRIVAL] = limits.arrival_radius_m
    car[kernels.TIGHTEST] = (1.0 - limits.inner_share) / half_track
    car[kernels.MOST_DRIFT] = MOST_DRIFT_RAD
    car[kernels.SLIP_LIMIT], car[kernels.SMOOTHING] = monitor.slip, monitor.smoothing_m
    car[kernels.SLIPPING] = monitor.slip_revolutions * 2.0 * pi * body.wheel_radius_m
    car[kernels.GIVE] = 0.25 * vehicle.mass_kg * gravity_m_s2 / vehicle.stiffness_N_m
    car[kernels.TILT_LIMIT], car[kernels.TILT_S], car[kernels.STUCK_S] = np.deg2rad(TILT_LIMIT_DEG), TILT_S, STUCK_S
    return car
