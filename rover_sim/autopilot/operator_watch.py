"""Notices when whoever steers by sticks or set points falls silent."""

from __future__ import annotations

from rover_sim.autopilot.alarm import Alarm
from rover_sim.autopilot.modes import Mode, Severity
from rover_sim.autopilot.sticks import StickPilot
from rover_sim.autopilot.targets import TargetFollower


def operator_alarm(time_s: float, mode: Mode, pilot: StickPilot, targets: TargetFollower) -> Alarm | None:
    """The loss that has just happened, if what was lost drives the rover in this mode."""
    sticks, points = pilot.lost(time_s), targets.lost(time_s)  # both are told once
    if sticks and mode is Mode.MANUAL:
        return _alarm("Sticks lost", pilot.on_loss)
    if points and mode is Mode.GUIDED:
        return _alarm("Set points lost", Mode.HOLD if targets.hold_on_loss else None)
    return None


def _alarm(text: str, then: Mode | None) -> Alarm:
    if then is None:
        return Alarm(Severity.WARNING, f"{text}, stopped")
    return Alarm(Severity.CRITICAL, text, (then,))
