"""What must hold of any stream of states, whatever made them: units, frames and signs that belong together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.ardupilot_double import Accepted
from worlds.types import FloatArray

GRAVITY_M_S2 = 9.80665


def column(states: Sequence[Accepted], key: str) -> FloatArray:
    """(n, 3) of one field."""
    return np.array([state.vector(key) for state in states])


def rotations(states: Sequence[Accepted]) -> FloatArray:
    """(n, 3, 3) body to north-east-down, of the attitudes: yaw, then pitch, then roll."""
    roll, pitch, yaw = column(states, "attitude").T
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def check_start(states: Sequence[Accepted]) -> None:
    """Place and time begin at nothing."""
    assert np.abs(states[0].vector("position")).max() < 1e-3
    assert states[0].time_s < 0.01


def check_rest(states: Sequence[Accepted], spread_m_s2: float = 0.05) -> None:
    """A rover at rest feels standard gravity, upward, and does not move."""
    force = column(states, "imu.accel_body")
    assert np.abs(np.linalg.norm(force, axis=1) - GRAVITY_M_S2).max() < spread_m_s2
    assert (force[:, 2] < 0.0).all()
    assert np.abs(column(states, "velocity")).max() < 1e-3
    assert np.abs(column(states, "imu.gyro")).max() < 1e-3


def check_velocity(states: Sequence[Accepted], spread_m_s: float = 0.01) -> None:
    """The velocity is the rate of change of the place."""
    times = np.array([state.time_s for state in states])
    made = np.diff(column(states, "position"), axis=0) / np.diff(times)[:, None]
    assert np.abs(made - column(states, "velocity")[1:]).max() < spread_m_s


def check_rates(states: Sequence[Accepted], spread_rad_s: float = 0.02) -> None:
    """The gyros tell the rotation from one attitude to the next, in body axes."""
    turned = rotations(states)
    step = np.einsum("nji,njk->nik", turned[:-1], turned[1:])
    half = 0.5 * (step - np.swapaxes(step, 1, 2))
    vector = np.stack([half[:, 2, 1], half[:, 0, 2], half[:, 1, 0]], axis=1)
    times = np.array([state.time_s for state in states])
    made = vector / np.diff(times)[:, None]
    assert np.abs(made - column(states, "imu.gyro")[1:]).max() < spread_rad_s


def check_force(states: Sequence[Accepted], spread_m_s2: float = 0.02) -> None:
    """The accelerometers tell the change of the velocity, and standard gravity, in body axes."""
    times = np.array([state.time_s for state in states])
    gained = np.diff(column(states, "velocity"), axis=0) / np.diff(times)[:, None]
    gained[:, 2] -= GRAVITY_M_S2
    made = np.einsum("nji,nj->ni", rotations(states)[1:], gained)
    assert np.abs(made - column(states, "imu.accel_body")[1:]).max() < spread_m_s2


def check_stream(states: Sequence[Accepted]) -> None:
    """All that holds while it drives, too."""
    check_start(states)
    check_velocity(states)
    check_rates(states)
    check_force(states)
