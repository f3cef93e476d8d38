"""Both sides of the doubled ArduPilot in one vehicle: the JSON side asks for steps, the MAVLink side drives by them.

One clock, that of the physics. It imitates and is not ArduPilot: its controller is a simple one that heads for the
next waypoint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, sin

from rover_sim.hil.ardupilot_frame import ArduPilotFrame
from rover_sim.mavlink.transport import Transport
from tests.ardupilot_double import Accepted, ArduPilotDouble, servos
from tests.ardupilot_mavlink_double import ArduRoverDouble
from tests.vehicle_double import Gains, Motion
from worlds.scenario import Origin

LOOP_HZ = 50  # Rover's main loop


class JoinedVehicle:
    """One ArduRover with physics outside."""

    def __init__(self, transport: Transport, home: Origin, parameters: Mapping[str, float]) -> None:
        """``parameters``: those of which its controller makes use, as the command writes them."""
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
            self._pulses = servos(*self.rover.tick(time_s, motion(state)))
        return self._pulses


def motion(state: Accepted) -> Motion:
    """What its estimator, a perfect one, makes of the physics."""
    (north, east, _), (v_north, v_east, _) = state.vector("position"), state.vector("velocity")
    heading = state.vector("attitude")[2]
    return Motion(north, east, heading, v_north * cos(heading) + v_east * sin(heading))
