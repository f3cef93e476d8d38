"""Satellite receiver: white and slow errors, reports that come late, outages."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from rover_sim.sim.ned_state import NedState
from rover_sim.sim.noise import wander
from rover_sim.sim.sensed import FixType, GnssSample
from worlds.sensor_tables import Gnss, Window
from worlds.types import FloatArray, Vector3

FIX_TYPES = {"3d": FixType.FIX_3D, "dgps": FixType.DGPS, "rtk_float": FixType.RTK_FLOAT, "rtk_fixed": FixType.RTK_FIXED}
_NO_OFFSET: Vector3 = (0.0, 0.0, 0.0)
_WANDER_AXES = np.array([1.0, 1.0, 1.5])


@dataclass(frozen=True, eq=False)
class GnssState:
    """What the receiver remembers."""

    time_s: float  # of the last measurement
    wander_m: FloatArray  # (3,)
    pending: tuple[GnssSample, ...] = ()  # measured and not yet reported, oldest first
    fixed: tuple[Vector3, Vector3] = (_NO_OFFSET, _NO_OFFSET)  # place and velocity of the last fix


def begin(table: Gnss, time_s: float, rng: np.random.Generator) -> GnssState:
    """A receiver that has long been running."""
    return GnssState(time_s, table.wander_m * _WANDER_AXES * rng.standard_normal(3))


def measure(
    table: Gnss, before: GnssState, truth: NedState, rng: np.random.Generator, offset_m: Vector3 = _NO_OFFSET
) -> GnssState:
    """A measurement now; ``offset_m`` (north, east, down) is that of a jump, if there is one."""
    draws = rng.standard_normal((3, 3))
    span_s = truth.time_s - before.time_s
    slow = wander(before.wander_m, table.wander_m * _WANDER_AXES, table.wander_time_s, span_s, draws[0])
    if in_window(table.outages_s, truth.time_s):
        sample = _sample(table, truth.time_s, FixType.NONE, *before.fixed)
        return GnssState(truth.time_s, slow, (*before.pending, sample), before.fixed)
    white = draws[1] * [table.horizontal_m, table.horizontal_m, table.vertical_m]
    place = np.array(truth.position_m) + slow + white + offset_m
    velocity = np.array(truth.velocity_m_s) + table.velocity_m_s * draws[2]
    fixed = _triple(place), _triple(velocity)
    sample = _sample(table, truth.time_s, FIX_TYPES[table.fix], *fixed)
    return GnssState(truth.time_s, slow, (*before.pending, sample), fixed)


def report(table: Gnss, state: GnssState, time_s: float) -> tuple[GnssState, GnssSample | None]:
    """What the receiver reports by now: the oldest measurement that has had its delay."""
    if not state.pending or time_s + 1e-9 < state.pending[0].time_s + table.delay_s:
        return state, None
    return replace(state, pending=state.pending[1:]), state.pending[0]


def in_window(windows: tuple[Window, ...], time_s: float) -> bool:
    """Whether a time lies in one of the windows, begin included, end not."""
    return any(begin_s - 1e-9 <= time_s < end_s - 1e-9 for begin_s, end_s in windows)


def _sample(table: Gnss, time_s: float, fix: FixType, place: Vector3, velocity: Vector3) -> GnssSample:
    satellites = 0 if fix is FixType.NONE else table.satellites
    sigma = hypot(table.horizontal_m, table.wander_m), hypot(table.vertical_m, 1.5 * table.wander_m)
    return GnssSample(time_s, fix, satellites, place, velocity, *sigma, table.velocity_m_s)


def _triple(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return x, y, z
