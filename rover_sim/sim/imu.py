"""Gyroscope and accelerometer: bias, white noise, shaking of the ground, saturation."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, radians

import numpy as np

from rover_sim.sim import ground_shake
from rover_sim.sim.ground_shake import Ground, Shake
from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from rover_sim.sim.noise import instability_sd, wander, white_sd
from rover_sim.sim.sensed import ImuSample
from worlds.scenario import GroundTexture
from worlds.sensor_tables import Imu
from worlds.types import FloatArray

_MICRO_G = 1e-6 * STANDARD_GRAVITY_M_S2
_HOUR_S = 3600.0
_FIRST_SPAN_S = 1.0 / 240.0  # of the first sample, which has none before it


@dataclass(frozen=True, eq=False)
class ImuModel:
    """Figures of the six channels, rates (rad/s) before forces (m/s2); arrays (6,)."""

    density: FloatArray  # one-sided, per sqrt(Hz)
    turn_on_sd: FloatArray
    instability_sd: FloatArray
    walk: FloatArray  # per sqrt(s)
    limit: FloatArray
    instability_time_s: float
    ground: Ground


@dataclass(frozen=True, eq=False)
class ImuState:
    """What the unit remembers."""

    time_s: float | None  # of the last sample
    turn_on: FloatArray  # (6,)
    in_run: FloatArray  # (6,)
    walked: FloatArray  # (6,)
    shake: Shake

    @property
    def bias(self) -> FloatArray:
        """All of it now (6,)."""
        return self.turn_on + self.in_run + self.walked


def imu_model(table: Imu, texture: GroundTexture) -> ImuModel:
    """The unit of a scenario's table, on a ground of that texture."""

    def channels(gyro: float, accel: float) -> FloatArray:
        return np.array([gyro] * 3 + [accel] * 3)

    degree_h = radians(1.0) / _HOUR_S
    return ImuModel(
        density=channels(radians(table.gyro_noise_deg_s_rthz), _MICRO_G * table.accel_noise_ug_rthz),
        turn_on_sd=channels(radians(table.gyro_bias_deg_s), 1e3 * _MICRO_G * table.accel_bias_mg),
        instability_sd=instability_sd(
            channels(degree_h * table.gyro_instability_deg_h, _MICRO_G * table.accel_instability_ug)
        ),
        walk=channels(degree_h * table.gyro_walk_deg_h_rth, _MICRO_G * table.accel_walk_ug_rth) / _HOUR_S**0.5,
        limit=channels(radians(table.gyro_range_deg_s), STANDARD_GRAVITY_M_S2 * table.accel_range_g),
        instability_time_s=table.instability_time_s,
        ground=ground_shake.ground_of(table, texture),
    )


def begin(model: ImuModel, rng: np.random.Generator) -> ImuState:
    """A unit that has just been turned on."""
    turn_on = model.turn_on_sd * rng.standard_normal(6)
    in_run = model.instability_sd * rng.standard_normal(6)
    return ImuState(None, turn_on, in_run, np.zeros(6), ground_shake.begin(rng))


def read(model: ImuModel, before: ImuState, truth: NedState, rng: np.random.Generator) -> tuple[ImuState, ImuSample]:
    """The next sample; ``truth`` is later than the one before."""
    span_s = _FIRST_SPAN_S if before.time_s is None else truth.time_s - before.time_s
    draws = rng.standard_normal((3, 6))
    speed = hypot(*truth.velocity_m_s)
    shaken, acceleration, rate = ground_shake.shake(before.shake, model.ground, speed, span_s, rng)
    state = ImuState(
        truth.time_s,
        before.turn_on,
        wander(before.in_run, model.instability_sd, model.instability_time_s, span_s, draws[0]),
        before.walked + model.walk * span_s**0.5 * draws[1],
        shaken,
    )
    true = np.array([*truth.rate_rad_s, *truth.specific_force_m_s2])
    felt = true + np.concatenate([rate, acceleration]) + state.bias + white_sd(model.density, span_s) * draws[2]
    p, q, r, x, y, z = np.clip(felt, -model.limit, model.limit).tolist()
    return state, ImuSample((p, q, r), (x, y, z))
