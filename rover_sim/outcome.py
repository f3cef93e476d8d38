"""How a traverse ends: the reasons, the limits behind them and the judge that applies them to the true state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from math import hypot

import numpy as np

from rover_sim.sim.vehicle_state import BodyContact, VehicleState
from worlds.geometry import euler_from_quaternion, wrap_angle
from worlds.types import Pose


class Reason(StrEnum):
    """Why a traverse ended; the values are those of ``summary.json``."""

    GOAL = "goal"
    TIMEOUT = "timeout"
    TIPPED = "tipped"
    EMBEDDED = "embedded"
    COLLISION = "collision"
    NO_PATH = "no_path"
    GOAL_MISSED = "goal_missed"  # the rover believed it had arrived and had not
    LOST = "lost"  # the rover does not know where it is, and says so
    SLIP_STOP = "slip_stop"
    LINK_LOST = "link_lost"
    SENSOR_LOST = "sensor_lost"  # camera or scanner fell silent
    ABORTED = "aborted"
    ERROR = "error"


@dataclass(frozen=True)
class Limits:
    """Where the judge draws the line."""

    tip_rad: float = 1.05  # 60 degrees: past the static tip-over angle of every shipped rover
    impact_m_s: float = 0.20  # closing speed at which a touch of the body counts as a crash
    pressing_s: float = 1.0  # the body leans on a rock for this long without a break
    touch_gap_s: float = 0.5  # a touch of the same rock after such a pause is a new collision
    touch_ends: bool = False  # the first touch of an obstacle, by hull or wheel, is a crash
    # At least half of the wheels turn for so long while they are embedding, and the rover gets nowhere: its own monitor
    # needs 6 s to see that, and is to have the time to try another way.
    embedded_s: float = 15.0
    gets_on_m: float = 0.10
    gets_on_rad: float = 0.10


@dataclass(frozen=True)
class Strain:
    """How long the rover has leaned on a rock, and how long it has dug itself in on the spot."""

    pressing_s: float = 0.0
    digging_s: float = 0.0


def advance_strain(strain: Strain, *, touching: bool, digging: bool, step_s: float) -> Strain:
    """``strain`` after ``step_s`` more of touching a rock or not, and of digging in or not."""
    return Strain(
        strain.pressing_s + step_s if touching else 0.0,
        strain.digging_s + step_s if digging else 0.0,
    )


def verdict(strain: Strain, limits: Limits, *, tilt_rad: float, impact_m_s: float) -> Reason | None:
    """The reason to end the traverse now, or None; the gravest comes first."""
    if tilt_rad > limits.tip_rad:
        return Reason.TIPPED
    if impact_m_s > limits.impact_m_s or strain.pressing_s > limits.pressing_s:
        return Reason.COLLISION
    if strain.digging_s > limits.embedded_s:
        return Reason.EMBEDDED
    return None


@dataclass
class Judge:
    """Watches the true state of one traverse: counts collisions and says when it is over."""

    limits: Limits = Limits()
    strain: Strain = Strain()
    collisions: int = 0
    _touched_s: dict[int, float] = field(default_factory=dict)
    _anchor: tuple[float, float, float] = (np.inf, np.inf, 0.0)  # place and heading where the rover last got on

    def look(
        self,
        state: VehicleState,
        contacts: Sequence[BodyContact],
        step_s: float,
        *,
        digging: bool,
        wheel_touched: bool = False,
    ) -> Reason | None:
        """The reason to end now, or None, from the state and the contacts of the hull in the last ``step_s``.

        ``digging``: see `mobility_events.MobilityLog.digging`; ``wheel_touched``: a wheel met an obstacle since.
        """
        for contact in contacts:
            last_s = self._touched_s.get(contact.obstacle_id, -np.inf)
            self.collisions += contact.time_s - last_s > self.limits.touch_gap_s
            self._touched_s[contact.obstacle_id] = contact.time_s
        digging = digging and not self._gets_on(state.pose)
        self.strain = advance_strain(self.strain, touching=bool(contacts), digging=digging, step_s=step_s)
        impact = max((contact.impact_speed_m_s for contact in contacts), default=0.0)
        if self.limits.touch_ends and (contacts or wheel_touched):
            return Reason.COLLISION
        return verdict(self.strain, self.limits, tilt_rad=state.tilt_rad, impact_m_s=impact)

    def _gets_on(self, pose: Pose) -> bool:
        """Whether the rover has moved or turned since it last did."""
        x, y = pose.position_w[:2].tolist()
        heading = euler_from_quaternion(pose.quaternion_w)[2]
        moved = hypot(x - self._anchor[0], y - self._anchor[1])
        turned = abs(wrap_angle(heading - self._anchor[2]))
        if moved < self.limits.gets_on_m and turned < self.limits.gets_on_rad:
            return False
        self._anchor = (x, y, heading)
        return True
