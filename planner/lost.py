"""What a rover does that no longer knows where it is: it looks around for landmarks, and then says that it is lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.navigator_state import Decision, NavigatorState
from planner.obstacle_map import obstacles
from planner.room import turn_range
from worlds.geometry import euler_from_quaternion, wrap_angle
from worlds.types import PoseEstimate

TURN_RAD = float(np.deg2rad(60.0))
MOST_LOOKS = 7  # once round, and what got in the way
THERE_RAD = float(np.deg2rad(12.0))
PATIENCE_S = 12.0  # for a turn
STAY_S = 1.5  # pictures from where it has turned to


@dataclass(frozen=True)
class Search:
    """A look around that is under way."""

    why: str
    looks: int
    heading_rad: float
    start_s: float
    there_s: float | None = None  # since when the rover has looked there

    @property
    def decision(self) -> Decision:
        """Turn to where to look, or the end of it."""
        if self.looks > MOST_LOOKS:
            return Decision("lost", f"lost: {self.why}; looked around in vain")
        return Decision("look", f"lost: {self.why}", heading_rad=self.heading_rad)


def search(before: Search | None, why: str, plan: NavigatorState, estimate: PoseEstimate, time_s: float) -> Search:
    """The look around after one more picture in which the rover knew no better where it is, because of ``why``."""
    heading = euler_from_quaternion(estimate.pose.quaternion_w)[2]
    if before is None:
        return _next(0, why, plan, estimate, heading, time_s)
    since = before.there_s
    if since is None and abs(wrap_angle(before.heading_rad - heading)) < THERE_RAD:
        since = time_s
    if time_s - before.start_s < PATIENCE_S and (since is None or time_s - since < STAY_S):
        return Search(before.why, before.looks, before.heading_rad, before.start_s, since)
    return _next(before.looks, why, plan, estimate, heading, time_s)


def _next(
    looks: int, why: str, plan: NavigatorState, estimate: PoseEstimate, heading_rad: float, time_s: float
) -> Search:
    """A further turn to the left, or to the right where there is no room."""
    body, place = plan.models.footprint, estimate.pose.position_w[:2]
    table = obstacles(
        plan.memory.rocks, plan.models.drive, body.climb_height_m, wheel_width_m=body.wheel_width_m, place_w=place
    )
    right, left = turn_range(table, None, place, heading_rad, body, plan.downhill_w)
    turn = min(TURN_RAD, left) if left >= -right or left >= TURN_RAD else max(-TURN_RAD, right)
    return Search(why, looks + 1, wrap_angle(heading_rad + turn), time_s)
