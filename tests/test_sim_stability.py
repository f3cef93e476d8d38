from __future__ import annotations

from math import atan, degrees, radians

import numpy as np
import pytest

from rover_sim.sim.stability import force_angle
from worlds.geometry import quaternion_from_euler, rotation_from_quaternion

TRACK, BASE, HEIGHT = 0.5708, 0.512, 0.25
FEET = np.array(
    [[BASE / 2, TRACK / 2, 0], [BASE / 2, -TRACK / 2, 0], [-BASE / 2, -TRACK / 2, 0], [-BASE / 2, TRACK / 2, 0]]
)


def _measure(roll_deg: float, pitch_deg: float) -> float:
    turn = rotation_from_quaternion(quaternion_from_euler(radians(roll_deg), radians(pitch_deg), 0.0))
    gravity = np.array([0.0, 0.0, -9.81])
    return force_angle(FEET @ turn.T, turn @ [0.0, 0.0, HEIGHT], gravity, np.zeros(3))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_sign_changes_at_the_analytic_tip_angles(sign: float) -> None:
    lateral = degrees(atan(TRACK / 2 / HEIGHT))
    along = degrees(atan(BASE / 2 / HEIGHT))
    assert _measure(sign * (lateral - 0.1), 0.0) > 0.0 > _measure(sign * (lateral + 0.1), 0.0)
    assert _measure(0.0, sign * (along - 0.1)) > 0.0 > _measure(0.0, sign * (along + 0.1))


def test_margin_falls_with_tilt_and_with_a_moment_that_tips() -> None:
    margins = [_measure(roll, 0.0) for roll in (0.0, 10.0, 20.0, 40.0)]
    assert margins == sorted(margins, reverse=True)
    centre, gravity = np.array([0.0, 0.0, HEIGHT]), np.array([0.0, 0.0, -9.81])
    rolled = force_angle(FEET, centre, gravity, np.array([9.81 * TRACK, 0.0, 0.0]))
    assert rolled < 0.0
