"""What a watch over the rover has to say, and what it wants done."""

from __future__ import annotations

from dataclasses import dataclass

from rover_sim.autopilot.modes import Mode, Severity

Response = tuple[Mode, ...]
"""Modes to change to, the first that is possible; empty: only say so."""


@dataclass(frozen=True)
class Alarm:
    """Something that a person must know of, once."""

    severity: Severity
    text: str
    response: Response = ()
