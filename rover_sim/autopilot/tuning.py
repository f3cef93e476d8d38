"""The autopilot fitted to the rover and the gravity of a scenario."""

from __future__ import annotations

import numpy as np

from rover_sim.autopilot.autopilot import Autopilot
from worlds.types import Footprint, Vector3

_TURN_SHARE = 0.8  # of the rover's fastest turn, for turns on the spot
_MARS_M_S2 = 3.71  # the autopilot's own limits are meant for it


def tuned_autopilot(footprint: Footprint, home_w: Vector3, gravity_m_s2: float) -> Autopilot:
    """The autopilot, quicker where more weight presses the wheels to the ground."""
    autopilot = Autopilot(footprint, home_w)
    weight, parameters = gravity_m_s2 / _MARS_M_S2, autopilot.parameters
    turn_deg_s = min(weight * parameters["TURN_RATE"], _TURN_SHARE * float(np.rad2deg(footprint.max_yaw_rate_rad_s)))
    parameters.set("TURN_RATE", turn_deg_s)
    parameters.set("ACCEL_MAX", weight * parameters["ACCEL_MAX"])
    return autopilot
