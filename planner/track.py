"""Where the rover has driven, as a stack of poses: what it drove over once it can back out over."""

from __future__ import annotations

import numpy as np

from worlds.types import FloatArray

STEP_M = 0.1
MOST = 300  # poses: 30 m
NEAR_M = 3.0  # of the last stretch, that backing may have undone
NO_TRACK = np.zeros((0, 3))


def note(track: FloatArray, pose: tuple[float, float, float]) -> FloatArray:
    """The track (N, 3) of x, y, heading after being at ``pose``: longer by a step, or shorter by what was undone.

    A pose beside an earlier one of the last metres, nearer to it than to those after it, undoes what came between.
    """
    if not len(track):
        return np.array([pose])
    recent = track[-round(NEAR_M / STEP_M) :]
    apart = np.hypot(recent[:, 0] - pose[0], recent[:, 1] - pose[1])
    back = len(recent) - 1 - int(np.argmin(apart))
    facing = np.cos(recent[:, 2] - pose[2])
    if back > 0 and apart.min() < STEP_M and facing[-1 - back] > 0.7:
        return track[: len(track) - back]
    if apart[-1] < STEP_M:
        return np.vstack([track[:-1], [*track[-1, :2], pose[2]]])
    return np.vstack([track, pose])[-MOST:]


def way_back(track: FloatArray, here: tuple[float, float], most_m: float) -> FloatArray:
    """The poses (N, 3) from the one nearest to ``here`` backwards, as far as ``most_m`` of way from ``here``.

    A rover that slid back downhill while it turned stands beside an earlier pose than the last.
    """
    poses = track[::-1]
    apart = np.hypot(*(poses[: round(NEAR_M / STEP_M), :2] - here).T)
    poses = poses[int(np.argmin(apart)) if len(apart) else 0 :]
    steps = np.diff(np.vstack([here, poses[:, :2]]), axis=0)
    return poses[np.cumsum(np.hypot(steps[:, 0], steps[:, 1])) <= most_m]
