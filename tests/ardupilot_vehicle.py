"""Both sides of the doubled ArduPilot in one vehicle: the JSON side asks for steps, the MAVLink side drives by them.

One clock, that of the physics. It imitates and is not ArduPilot: its controller is a simple one that heads for the
next waypoint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, exp, radians, sin, sqrt

import numpy as np

from rover_sim.hil.ardupilot_frame import ArduPilotFrame
from rover_sim.mavlink.transport import Transport
from tests.ardupilot_double import Accepted, ArduPilotDouble, servos
from tests.ardupilot_mavlink_double import ArduRoverDouble
from tests.vehicle_double import Gains, Motion
from worlds.scenario import Origin

LOOP_HZ = 50  # Rover's main loop
# As ArduRover's estimate was measured to be off by 0.03 to 0.11 m in the median and 0.14 to 0.22 at most.
PLACE_SD_M, HEADING_SD_RAD, DRIFT_S = 0.08, radians(1.0), 20.0


class Drift:
    """How far an estimate is off: north, east (m) and heading (rad), each wandering about nothing."""

    def __init__(self, seed: int) -> None:
        self._rng, self._sd = np.random.default_rng([seed, LOOP_HZ]), (PLACE_SD_M, PLACE_SD_M, HEADING_SD_RAD)
        self.now = self._rng.normal(0.0, self._sd)

    def step(self) -> None:
        kept = exp(-1.0 / (LOOP_HZ * DRIFT_S))
        self.now = kept * self.now + sqrt(1.0 - kept * kept) * self._rng.normal(0.0, self._sd)


class JoinedVehicle:
    """One ArduRover with physics outside."""

    def __init__(self, transport: Transport, home: Origin, parameters: Mapping[str, float], seed: int = 0) -> None:
        """``parameters``: those that its controller uses, as the command writes them; ``seed``: of its drift."""
        self._drift = Drift(seed)
        self.rover = ArduRoverDouble(transport, home)
        self.rover.frame = ArduPilotFrame(home, (0.0, 0.0, 0.0))
        full_m_s = parameters["CRUISE_SPEED"] / (0.01 * parameters["CRUISE_THROTTLE"])
        self.rover.gains = Gains(full_m_s, parameters["ATC_STR_RAT_FF"])
        self.rover.speed_m_s, self.rover.radius_m = parameters["WP_SPEED"], parameters["WP_RADIUS"]
        self.json = ArduPilotDouble(self._outputs)
        self._next_s = 0.0
        self._pulses: Sequence[int] = servos(1500, 1500)

    def _outputs(self, time_s: float, state: Accepted | None) -> Sequence[int]:
        if state is not None and time_s >= self._next_s:
            self._next_s += 1.0 / LOOP_HZ
            self._drift.step()
            self._pulses = servos(*self.rover.tick(time_s, believed(state, self._drift)))
        return self._pulses


def believed(state: Accepted, drift: Drift) -> Motion:
    """What its estimator makes of the physics."""
    off_north, off_east, off_heading = drift.now.tolist()
    (north, east, _), (v_north, v_east, _) = state.vector("position"), state.vector("velocity")
    heading = state.vector("attitude")[2] + off_heading
    speed = v_north * cos(heading) + v_east * sin(heading)
    return Motion(north + off_north, east + off_east, heading, speed)
