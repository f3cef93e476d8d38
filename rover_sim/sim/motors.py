"""The motors of one rover: speeds commanded pass the actuators, set points follow them, faults stop wheels."""

from __future__ import annotations

from collections.abc import Sequence

from rover_sim.sim import world as physics
from rover_sim.sim.actuator import Actuators
from rover_sim.sim.faults import WheelState, wheel_states
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.world import RoverBody
from worlds.scenario import Scenario

# Torque against a wheel's turning, over what its motor can give: a blocked wheel, and a gear that is turned from
# outside; ours.
_TORQUE = {WheelState.HELD: 50.0, WheelState.FREE: 0.0, WheelState.UNPOWERED: 0.1}


class Motors:
    """Sound, and at rest, until `start`."""

    def __init__(self, client: int, body: RoverBody, rover: RoverModel, scenario: Scenario) -> None:
        wheels = len(body.wheels)
        self._client, self._body, self._motor = client, body, rover.motor
        self._events, self._running = scenario.event, False
        table = scenario.actuator
        self._actuators = None if table is None else Actuators(table, wheels, rover.motor.max_speed_rad_s)
        self._targets = [0.0] * wheels
        self._sound = self._states = (WheelState.SOUND,) * wheels
        self._steady: tuple[float, ...] | None = None  # a command that the set points have reached
        self._tell()

    def start(self) -> None:
        """From now on events happen."""
        self._running = True

    def command(self, speeds_rad_s: Sequence[float], time_s: float, step_s: float) -> None:
        """Move the set points toward the command, within the motors' acceleration and speed."""
        if self._actuators is not None:
            speeds_rad_s = self._actuators.step(speeds_rad_s, step_s)
        if self._running and self._events:
            self._fail(wheel_states(self._events, len(self._targets), time_s))
        if tuple(speeds_rad_s) == self._steady:
            return
        change, fastest = self._motor.max_acceleration_rad_s2 * step_s, self._motor.max_speed_rad_s
        targets = [
            now + min(max(min(max(wish, -fastest), fastest) - now, -change), change)
            if state is WheelState.SOUND
            else 0.0
            for now, wish, state in zip(self._targets, speeds_rad_s, self._states, strict=True)
        ]
        if targets != self._targets:
            self._targets, self._steady = targets, None
            self._tell()
        else:
            self._steady = tuple(speeds_rad_s)

    def torques_Nm(self, read_Nm: list[float]) -> list[float]:
        """What the motors give, from what PyBullet says: of one that is switched off it repeats its last torque."""
        if WheelState.FREE not in self._states:
            return read_Nm
        free = [state is WheelState.FREE for state in self._states]
        return [0.0 if off else torque for torque, off in zip(read_Nm, free, strict=True)]

    def _fail(self, states: tuple[WheelState, ...]) -> None:
        if states != self._states:
            self._states, self._steady = states, None
            self._targets = [
                now if state is WheelState.SOUND else 0.0 for now, state in zip(self._targets, states, strict=True)
            ]
            self._tell()

    def _tell(self) -> None:
        torques = [self._motor.max_torque_Nm * _TORQUE.get(state, 1.0) for state in self._states]
        physics.drive_wheels(self._client, self._body, self._targets, torques)
