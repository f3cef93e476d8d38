"""Barometer: the standard atmosphere at the rover's height, with bias, drift and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rover_sim.sim.atmosphere import ZERO_CELSIUS_K, air, pressure_altitude_m
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.noise import wander
from rover_sim.sim.sensed import PressureSample
from worlds.sensor_tables import Barometer


@dataclass(frozen=True)
class BarometerState:
    """What the barometer remembers."""

    time_s: float
    bias_Pa: float
    drift_Pa: float


def begin(table: Barometer, time_s: float, rng: np.random.Generator) -> BarometerState:
    """A barometer that has just been turned on."""
    bias, drift = (rng.standard_normal(2) * [table.bias_Pa, table.drift_Pa]).tolist()
    return BarometerState(time_s, bias, drift)


def read(
    table: Barometer, before: BarometerState, truth: NedState, altitude_m: float, rng: np.random.Generator
) -> tuple[BarometerState, PressureSample]:
    """The next sample; ``altitude_m`` is that of the start over sea level."""
    slow, fast = rng.standard_normal(2).tolist()
    drift = wander(before.drift_Pa, table.drift_Pa, table.drift_time_s, truth.time_s - before.time_s, slow)
    pressure, temperature = air(altitude_m - truth.position_m[2])
    measured = pressure + before.bias_Pa + drift + table.noise_Pa * fast
    sample = PressureSample(measured, pressure_altitude_m(measured), temperature - ZERO_CELSIUS_K)
    return BarometerState(truth.time_s, before.bias_Pa, drift), sample
