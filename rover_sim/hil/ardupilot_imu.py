"""What ArduPilot is told of the rover's motion: the truth, but for an inertial unit of the scenario's own.

ArduPilot's simulator makes every sensor's samples from the state it is sent, and has noises of its own
(``SIM_ACC1_RND`` and the like); gyroscope and accelerometer alone are sent as they are to be read.
"""

from __future__ import annotations

from dataclasses import replace

from rover_sim.sim.faults import sensor_lost
from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensed import ImuSample
from rover_sim.sim.sensor_suite import SensorSuite
from worlds.types import World


class ToldMotion:
    """One traverse's inertial unit as ArduPilot hears it: its table's, if there is one; silent, it repeats itself."""

    def __init__(self, world: World) -> None:
        self._suite = None if world.scenario.imu is None else SensorSuite(world)
        self._events = world.scenario.event
        self._last: ImuSample | None = None

    def of(self, truth: NedState) -> NedState:
        """The state to be sent."""
        if self._last is None or not sensor_lost(self._events, "imu", truth.time_s):
            self._last = self._sample(truth) or self._last
        if self._last is None:
            return truth
        return replace(truth, rate_rad_s=self._last.rate_rad_s, specific_force_m_s2=self._last.specific_force_m_s2)

    def _sample(self, truth: NedState) -> ImuSample | None:
        if self._suite is None:
            return ImuSample(truth.rate_rad_s, truth.specific_force_m_s2)
        return self._suite.read(truth).imu
