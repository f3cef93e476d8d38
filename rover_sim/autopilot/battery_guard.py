"""Watches the battery: how much is left, and what is done when it is little."""

from __future__ import annotations

from rover_sim.autopilot.alarm import Alarm
from rover_sim.autopilot.modes import Severity
from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.autopilot.safety_parameters import BatteryLevel, battery_levels, battery_patience_s
from worlds.types import BatteryReading


class BatteryGuard:
    """A level that was reached stays reached: a voltage that recovers at rest does not refill a battery."""

    def __init__(self, parameters: ParameterTable) -> None:
        self.reading: BatteryReading | None = None  # the last one
        self.level = 0  # 0 good, 1 low, 2 critical, 3 emergency
        self._below_s: dict[int, float] = {}  # since when the voltage is below that of a level
        self._parameters = parameters

    def unfit(self) -> str | None:
        """Why the rover must not be armed; None if it may, or if it has no battery."""
        if self.level >= 2:
            return "battery critical"
        if self.reading is not None and self.reading.left_mah < self._parameters.get("BATT_ARM_MAH", 0.0):
            return f"battery has {self.reading.left_mah:.0f} mAh left"
        return None

    def update(self, time_s: float, reading: BatteryReading | None) -> Alarm | None:
        """Look at a reading; None where there is no battery."""
        if reading is None:
            return None
        self.reading = reading
        levels = self._parameters.derived(battery_levels)
        below = [number for number, level in enumerate(levels, 1) if self._is_below(time_s, number, level, reading)]
        reached = max(below, default=0)
        if reached <= self.level:
            return None
        self.level = reached
        return _alarm(levels[reached - 1], reading)

    def _is_below(self, time_s: float, number: int, level: BatteryLevel, reading: BatteryReading) -> bool:
        if reading.voltage_v < level.voltage_v:
            since_s = self._below_s.setdefault(number, time_s)
            if time_s - since_s >= self._parameters.derived(battery_patience_s):
                return True
        else:
            self._below_s.pop(number, None)
        return reading.left_mah < level.left_mah or reading.left_share < level.left_share


def _alarm(level: BatteryLevel, reading: BatteryReading) -> Alarm:
    text = f"Battery {level.name}: {100.0 * reading.left_share:.0f} %, {reading.voltage_v:.1f} V"
    severe = level.response or level.name != "low"
    return Alarm(Severity.CRITICAL if severe else Severity.WARNING, text, level.response)
