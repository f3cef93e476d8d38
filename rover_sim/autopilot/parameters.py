"""The autopilot's parameters: a small typed table with limits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

Derived = TypeVar("Derived")


@dataclass(frozen=True)
class Parameter:
    """One named number; ``integer`` ones are rounded when set."""

    name: str  # at most 16 characters, MAVLink's limit
    default: float
    low: float
    high: float
    meaning: str  # with its unit
    integer: bool = False


TABLE: tuple[Parameter, ...] = (
    Parameter("ACCEL_MAX", 0.5, 0.05, 5.0, "acceleration on a mission, m/s2"),
    Parameter("CRUISE_SPEED", 0.6, 0.05, 2.0, "speed on a mission, m/s"),
    Parameter("FS_POSE_M", 5.0, 0.1, 1000.0, "pose fail-safe: one sigma of the position, m"),
    Parameter("FS_POSE_S", 1.0, 0.1, 60.0, "pose fail-safe: age of the estimate, s"),
    Parameter("FS_SLIP_ENABLE", 1, 0, 1, "slip fail-safe: 0 off, 1 hold", integer=True),
    Parameter("FS_SLIP_PCT", 40.0, 5.0, 100.0, "slip fail-safe: slip held for a wheel revolution, percent"),
    Parameter("FS_STUCK_ENABLE", 1, 0, 1, "stuck fail-safe: 0 off, 1 hold", integer=True),
    Parameter("FS_STUCK_S", 6.0, 1.0, 600.0, "stuck fail-safe: how long without progress, s"),
    Parameter("FS_TILT_DEG", 35.0, 5.0, 80.0, "tilt fail-safe: angle between body and gravity, deg"),
    Parameter("FS_TILT_ENABLE", 1, 0, 1, "tilt fail-safe: 0 off, 1 hold", integer=True),
    Parameter("FS_TILT_S", 0.5, 0.0, 10.0, "tilt fail-safe: how long the tilt must last, s"),
    Parameter("TURN_RATE", 25.0, 2.0, 180.0, "yaw rate when turning on the spot, deg/s"),
    Parameter("WP_RADIUS", 0.25, 0.05, 10.0, "distance at which a waypoint is reached, m"),
)


class ParameterTable:
    """Current values of a table of parameters, kept inside their limits."""

    def __init__(self, table: Sequence[Parameter] = TABLE) -> None:
        self._table = {parameter.name: parameter for parameter in table}
        self._values = {parameter.name: float(parameter.default) for parameter in table}
        self.changes = 0  # so far
        self._derived: dict[Callable[[ParameterTable], Any], Any] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """All names, in the table's order."""
        return tuple(self._table)

    def __contains__(self, name: str) -> bool:
        return name in self._table

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def get(self, name: str, default: float) -> float:
        """The value, or a default where there is no such parameter."""
        return self._values.get(name, default)

    def derived(self, rule: Callable[[ParameterTable], Derived]) -> Derived:
        """What ``rule`` makes of the values, kept until one changes: rules are asked for at every control step."""
        if rule not in self._derived:
            self._derived[rule] = rule(self)
        value: Derived = self._derived[rule]
        return value

    def extend(self, table: Sequence[Parameter]) -> None:
        """Add parameters, such as those that only one kind of ground station reads; names that are there stay."""
        for parameter in table:
            if parameter.name not in self._table:
                self._table[parameter.name] = parameter
                self._values[parameter.name] = float(parameter.default)
        self._derived.clear()

    def remove(self, names: Iterable[str]) -> None:
        """Take parameters out, such as those that another kind of autopilot calls differently."""
        for name in names:
            del self._table[name], self._values[name]
        self._derived.clear()

    def takes(self, name: str, value: float) -> bool:
        """Whether a known parameter may have this value: NaN never, others within the limits."""
        return self._table[name].low <= value <= self._table[name].high

    def describe(self, name: str) -> Parameter:
        """The table's entry; KeyError for an unknown name."""
        return self._table[name]

    def set(self, name: str, value: float) -> bool:
        """Set a known parameter; False, and no change, for NaN or a value outside its limits."""
        if not self.takes(name, value):
            return False
        self._values[name] = float(round(value)) if self._table[name].integer else float(value)
        self.changes += 1
        self._derived.clear()
        return True
