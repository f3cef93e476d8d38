"""Force-angle measure of tip-over stability (Papadopoulos and Rey, Vehicle System Dynamics 33(1), 29-48, 2000)."""

from __future__ import annotations

import numpy as np

from worlds.types import FloatArray


def force_angle(contacts: FloatArray, centre: FloatArray, force: FloatArray, moment: FloatArray) -> float:
    """Smallest of angle x lever x force over the tip-over axes, N m; negative while the rover tips.

    ``contacts`` (m, 3) clockwise seen from above; ``centre`` (3,) of mass; ``force`` and ``moment`` (3,) on the
    vehicle without the ground's reactions (gravity minus mass times acceleration).
    """
    margins = []
    for start, end in zip(contacts, np.roll(contacts, -1, axis=0), strict=True):
        axis = (end - start) / np.linalg.norm(end - start)
        lever = end - centre
        lever = lever - axis * (axis @ lever)
        distance = np.linalg.norm(lever)
        unit = lever / distance
        across = force - axis * (axis @ force)
        total = across + np.cross(unit, axis * (axis @ moment)) / distance
        size = np.linalg.norm(total)
        if size < 1e-9:
            return 0.0
        direction = total / size
        arm = -lever + (lever @ direction) * direction
        angle = np.arccos(np.clip(direction @ unit, -1.0, 1.0))
        sign = 1.0 if np.cross(direction, unit) @ axis > 0 else -1.0
        margins.append(sign * angle * np.linalg.norm(arm) * size)
    return float(min(margins))
