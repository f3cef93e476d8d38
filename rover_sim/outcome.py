"""How a traverse ends: the reasons, the limits behind them and the judge that applies them to the true state."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Reason(StrEnum):
    """Why a traverse ended; the values are those of ``summary.json``."""

    GOAL = "goal"
    TIMEOUT = "timeout"
    TIPPED = "tipped"
    EMBEDDED = "embedded"
    COLLISION = "collision"
    NO_PATH = "no_path"
    SLIP_STOP = "slip_stop"
    LINK_LOST = "link_lost"
    ABORTED = "aborted"
    ERROR = "error"


@dataclass(frozen=True)
class Limits:
    """Where the judge draws the line."""

    tip_rad: float = 1.05  # 60 degrees: past the static tip-over angle of every shipped rover
    impact_m_s: float = 0.20  # closing speed at which a touch of the body counts as a crash
    pressing_s: float = 1.0  # the body leans on a rock for this long without a break
    embedded_slip: float = 0.90
    embedded_s: float = 5.0  # all wheels spin for this long


@dataclass(frozen=True)
class Strain:
    """How long the rover has leaned on a rock, and how long it has spun without moving."""

    pressing_s: float = 0.0
    spinning_s: float = 0.0


def advance_strain(strain: Strain, limits: Limits, *, touching: bool, mean_slip: float, step_s: float) -> Strain:
    """``strain`` after ``step_s`` more of touching a rock and of slipping by ``mean_slip``."""
    return Strain(
        strain.pressing_s + step_s if touching else 0.0,
        strain.spinning_s + step_s if mean_slip >= limits.embedded_slip else 0.0,
    )


def verdict(strain: Strain, limits: Limits, *, tilt_rad: float, impact_m_s: float) -> Reason | None:
    """The reason to end the traverse now, or None; the gravest comes first."""
    if tilt_rad > limits.tip_rad:
        return Reason.TIPPED
    if impact_m_s > limits.impact_m_s or strain.pressing_s > limits.pressing_s:
        return Reason.COLLISION
    if strain.spinning_s > limits.embedded_s:
        return Reason.EMBEDDED
    return None
