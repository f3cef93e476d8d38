"""Steering by hand: where the sticks are, until when they count, and when the rover may follow them."""

from __future__ import annotations

from dataclasses import dataclass

from planner.mobility import Command
from rover_sim.autopilot.modes import Mode
from worlds.types import Footprint

DEADBAND = 0.05  # of full deflection: nearer to the middle is the middle


@dataclass(frozen=True)
class Sticks:
    """Deflections: throttle from -1 (back) to 1 (forward), steering from -1 (left) to 1 (right)."""

    throttle: float = 0.0
    steer: float = 0.0

    @property
    def centred(self) -> bool:
        """Whether both are in the middle."""
        return abs(self.throttle) <= DEADBAND and abs(self.steer) <= DEADBAND


class StickPilot:
    """The sticks of whoever steers; one instance lives as long as its autopilot.

    Sticks move the rover only once they were seen centred since it was armed, since mode Manual was entered and since
    they were lost: a stick that rests half way, as one of QGroundControl may, never sets off a rover by itself.
    """

    def __init__(self) -> None:
        self.sticks: Sticks | None = None  # None: nobody steers
        self.on_loss: Mode | None = None  # mode after sticks are lost; None: stay in Manual
        self._until_s = 0.0
        self._trusted = False

    def move(self, sticks: Sticks, until_s: float, on_loss: Mode | None) -> None:
        """Sticks as they are now; without news until ``until_s`` they are lost."""
        self.sticks, self._until_s, self.on_loss = sticks, until_s, on_loss
        self._trusted = self._trusted or sticks.centred

    def release(self) -> None:
        """Nobody steers any more, on purpose."""
        self.sticks = None
        self._trusted = False

    def lost(self, time_s: float) -> bool:
        """Whether the sticks have just been lost; they are then released."""
        late = self.sticks is not None and not time_s < self._until_s
        if late:
            self.release()
        return late

    def distrust(self) -> bool:
        """Follow the sticks only after they were centred; True if they are not centred now."""
        self._trusted = self.sticks is not None and self.sticks.centred
        return self.sticks is not None and not self._trusted

    def unfit(self) -> str | None:
        """Why the rover must not be armed with the sticks as they are; None if it may."""
        if self.sticks is None or self.sticks.centred:
            return None
        return f"sticks not centred: throttle {100 * self.sticks.throttle:.0f} %, steer {100 * self.sticks.steer:.0f} %"

    def wanted(self, footprint: Footprint) -> Command | None:
        """Motion that the sticks ask for, full deflection being the rover's fastest; None where it is to stop."""
        sticks = self.sticks
        if sticks is None or not self._trusted or sticks.centred:
            return None
        return Command(
            _outside_deadband(sticks.throttle) * footprint.max_speed_m_s,
            -_outside_deadband(sticks.steer) * footprint.max_yaw_rate_rad_s,
        )


def _outside_deadband(deflection: float) -> float:
    """0 at the edge of the dead band, 1 at full deflection."""
    size = min(max((abs(deflection) - DEADBAND) / (1.0 - DEADBAND), 0.0), 1.0)
    return size if deflection > 0.0 else -size
