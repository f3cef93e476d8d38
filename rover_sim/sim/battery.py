"""The rover's battery: six lithium-ion cells in a row, drained by what motors and electronics take.

The voltage at rest falls with the charge as that of a common NMC cell does (0.2 C discharge curves of makers' data
sheets, rounded); under load it sags over an ohmic resistance. Temperature and age are left out.
"""

from __future__ import annotations

import math
from bisect import bisect_right

from rover_sim.sim.rover import RoverModel
from worlds.types import BatteryReading

CELLS = 6
_CHARGE = (0.0, 0.05, 0.1, 0.2, 0.5, 0.8, 0.9, 1.0)
_CELL_V = (2.9, 3.3, 3.45, 3.55, 3.68, 3.95, 4.05, 4.18)


class Battery:
    """Keeps count of its own charge, as a battery with a management system does."""

    def __init__(self, rover: RoverModel, charge: float = 1.0) -> None:
        """``charge``: share of the capacity at the start, 0 to 1."""
        self._battery, self._idle_W = rover.battery, rover.motor.idle_power_W
        self._used_Ah = (1.0 - charge) * self._battery.capacity_Ah
        self._used_J = self._time_s = self._work_J = 0.0
        self._current_A, self._voltage_V = self._loaded(self._idle_W)

    @property
    def empty(self) -> bool:
        """Whether nothing is left to drive with."""
        return self._used_Ah >= self._battery.capacity_Ah

    def read(self, time_s: float, energy_J: float) -> BatteryReading:
        """The means since the last reading; ``energy_J`` is the work of motors and electronics since the start."""
        span_s = time_s - self._time_s
        if span_s > 0.0:
            power_W = (energy_J - self._work_J) / span_s
            motors_W = max(power_W - self._idle_W, 0.0) / self._battery.efficiency
            self._current_A, self._voltage_V = self._loaded(self._idle_W + motors_W)
            self._used_Ah = min(self._used_Ah + self._current_A * span_s / 3600.0, self._battery.capacity_Ah)
            self._used_J += self._current_A * self._voltage_V * span_s
            self._time_s, self._work_J = time_s, energy_J
        used_mAh, capacity_mAh = 1000.0 * self._used_Ah, 1000.0 * self._battery.capacity_Ah
        return BatteryReading(self._voltage_V, self._current_A, used_mAh, self._used_J, capacity_mAh)

    def _loaded(self, power_W: float) -> tuple[float, float]:
        """Current and voltage at a load; a load beyond what the battery can give gets the most that it can."""
        left = 1.0 - self._used_Ah / self._battery.capacity_Ah
        rest_V, resistance = CELLS * _cell_V(left), self._battery.resistance_ohm
        root = math.sqrt(max(rest_V**2 - 4.0 * resistance * power_W, 0.0))
        current_A = 2.0 * power_W / (rest_V + root) if root > 0.0 else rest_V / (2.0 * resistance)
        return current_A, rest_V - resistance * current_A


def _cell_V(charge: float) -> float:
    """Voltage of a cell at rest, on the straight lines of the table; NumPy takes microseconds for a single number."""
    i = min(bisect_right(_CHARGE, charge, 1), len(_CHARGE) - 1) - 1
    slope = (_CELL_V[i + 1] - _CELL_V[i]) / (_CHARGE[i + 1] - _CHARGE[i])
    return slope * (min(max(charge, 0.0), 1.0) - _CHARGE[i]) + _CELL_V[i]
