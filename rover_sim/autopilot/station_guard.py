"""Watches the ground station: whether its heartbeat still comes."""

from __future__ import annotations

from rover_sim.autopilot.alarm import Alarm
from rover_sim.autopilot.modes import Mode, Severity
from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.autopilot.safety_parameters import station_rules


class StationGuard:
    """Begins with the first heartbeat: a rover that never had a ground station has not lost one."""

    def __init__(self, parameters: ParameterTable) -> None:
        self.lost = False
        self._heard_s: float | None = None
        self._parameters = parameters

    def heard(self, time_s: float) -> None:
        """A heartbeat of a ground station that counts."""
        self._heard_s = time_s

    def update(self, time_s: float, mode: Mode) -> Alarm | None:
        """Look at the time; a rover in Hold stays there, and one in Auto goes on where the rules say so."""
        rules = self._parameters.derived(station_rules)
        was = self.lost
        self.lost = rules.on and self._heard_s is not None and time_s - self._heard_s > rules.patience_s
        if self.lost and not was:
            spared = mode is Mode.HOLD or (mode is Mode.AUTO and rules.auto_goes_on)
            response = () if spared else rules.response
            return Alarm(Severity.CRITICAL if response else Severity.WARNING, "Ground station lost", response)
        return Alarm(Severity.NOTICE, "Ground station is back") if was and not self.lost else None
