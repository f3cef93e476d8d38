"""What the autopilot has to tell: events, in the order in which they happened."""

from __future__ import annotations

from dataclasses import dataclass

from rover_sim.autopilot.modes import Severity


@dataclass(frozen=True)
class Text:
    """A sentence for the operator."""

    severity: Severity
    text: str


@dataclass(frozen=True)
class Reached:
    """A mission item is done."""

    index: int


Event = Text | Reached
