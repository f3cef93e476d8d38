"""From the commands for the wheels to the speeds that their motors are to hold: clipping, dead band, gain, lag."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, exp

from worlds.sensor_tables import Actuator


def answer(command: float, gain: float, table: Actuator) -> float:
    """What a command, -1 to 1, leads to in the end; beyond the dead band full command is full answer."""
    size = min(abs(command), table.limit)
    if size <= table.dead_band:
        return 0.0
    return copysign(gain * (size - table.dead_band) / (1.0 - table.dead_band), command)


class Actuators:
    """The actuators of one rover, between the speeds commanded (rad/s) and those that its motors are told."""

    def __init__(self, table: Actuator, wheels: int, fastest_rad_s: float) -> None:
        """``wheels``: left side first; ``fastest_rad_s``: speed of a command of 1."""
        half = wheels // 2
        self._table, self._fastest = table, fastest_rad_s
        self._gains = (table.left_gain,) * half + (table.right_gain,) * half
        self._now = [0.0] * wheels

    def step(self, speeds_rad_s: Sequence[float], step_s: float) -> list[float]:
        """The speeds now, a step later."""
        fresh = 1.0 if self._table.lag_s == 0.0 else 1.0 - exp(-step_s / self._table.lag_s)
        wishes = [
            self._fastest * answer(speed / self._fastest, gain, self._table)
            for speed, gain in zip(speeds_rad_s, self._gains, strict=True)
        ]
        self._now = [now + fresh * (wish - now) for now, wish in zip(self._now, wishes, strict=True)]
        return list(self._now)
