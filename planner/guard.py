"""What keeps the body off rocks that path following would run it onto: in sand a rover errs by a hand from its way."""

from __future__ import annotations

import numpy as np

from planner.obstacle_map import Frame2, in_frame, near
from worlds.types import FloatArray, Footprint

BODY_SHARE = 0.9  # of the half width: what lies farther out is met by a wheel, not by the belly
WARNED_M = 0.35  # before the body: what it drives from one look to the next, and to stop
CLEAR_M = 0.9  # so far a heading must be free to be turned to
STEP_RAD, MOST_RAD = float(np.deg2rad(5.0)), float(np.deg2rad(60.0))


def runs_onto(
    hard_w: FloatArray, position_w: FloatArray, heading_rad: float, footprint: Footprint, ahead_m: float = WARNED_M
) -> bool:
    """Whether a body that goes straight on meets one of the hard obstacles (N, 7) with its belly within ``ahead_m``.

    What lies beside or under it already does not count. For a body that backs up give the heading of its rear.
    """
    close = near(hard_w, position_w, footprint.length_m + ahead_m + 1.0)
    local = in_frame(close, Frame2((float(position_w[0]), float(position_w[1])), heading_rad))
    first, half = footprint.length_m / 2.0, BODY_SHARE * footprint.width_m / 2.0
    for share in (0.0, 0.5, 1.0):
        points = (1.0 - share) * local[:, 0:2] + share * local[:, 2:4]
        beyond = np.abs(points[:, 1]) - half
        reach = np.sqrt(np.maximum(local[:, 4] ** 2 - np.maximum(beyond, 0.0) ** 2, 0.0))
        met = (beyond < local[:, 4]) & (points[:, 0] > first) & (points[:, 0] - reach < first + ahead_m)
        if met.any():
            return True
    return False


def free_turn(
    hard_w: FloatArray,
    position_w: FloatArray,
    heading_rad: float,
    wanted_rad: float,
    room_rad: tuple[float, float],
    footprint: Footprint,
) -> float | None:
    """The least turn on the spot, left positive, after which nothing lies before the body; None without room for one.

    The side of ``wanted_rad`` comes first.
    """
    side = 1.0 if wanted_rad >= 0.0 else -1.0
    for turn in np.concatenate([sign * np.arange(STEP_RAD, MOST_RAD, STEP_RAD) for sign in (side, -side)]):
        inside = room_rad[0] <= turn <= room_rad[1]
        if inside and not runs_onto(hard_w, position_w, heading_rad + turn, footprint, CLEAR_M):
            return float(turn)
    return None
