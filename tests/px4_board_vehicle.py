"""A board that drives missions: HIL messages and the MAVLink of a PX4 rover on one line, by the board's own clock."""

from __future__ import annotations

from collections import deque

from rover_sim.hil.px4_parameters import Parameters
from rover_sim.mavlink.dialect import mavlink
from tests.px4_board import BOOTED_S, CONTROLS_S, HIL, Px4Board
from tests.px4_checks import Checks
from tests.px4_double import Outputs
from tests.px4_mavlink_double import Px4RoverDouble
from tests.px4_vehicle import Estimator
from tests.vehicle_double import NEUTRAL, Gains
from worlds.scenario import Origin

PEER = "line"


class LineQueue:
    """The rover's side of the line, as its MAVLink double wants it."""

    is_stream = False

    def __init__(self) -> None:
        self.heard: deque[bytes] = deque()
        self.said: deque[bytes] = deque()

    def peers(self, time_s: float) -> tuple[str, ...]:
        del time_s
        return (PEER,)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:
        del peer, time_s
        self.said.append(frame)

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        del time_s
        chunks = [(PEER, frame) for frame in self.heard]
        self.heard.clear()
        return chunks

    def handles(self) -> tuple[int, ...]:
        return ()

    def close(self) -> None:
        """Nothing to release."""


class HilRover(Px4RoverDouble):
    """Its heartbeat tells HIL mode."""

    def beat(self) -> None:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | HIL
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        state = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        self.send(mavlink.MAVLink_heartbeat_message(self.kind, self.autopilot, base, self.custom_mode, state, 3))


class DrivingBoard(Px4Board):
    """Estimates by each sample that arrives, and steers 200 times a second of its own clock."""

    def __init__(self, home: Origin, values: Parameters) -> None:
        super().__init__(self._drive)
        self.queue = LineQueue()
        self.rover, self.estimator = HilRover(self.queue, home), Estimator(home)
        full_m_s = values["RO_MAX_THR_SPEED"]
        self.rover.gains = Gains(full_m_s, values["RD_WHEEL_TRACK"] / (2.0 * full_m_s))
        self.rover.speed_m_s, self.rover.radius_m = values["RO_SPEED_LIM"], values["NAV_ACC_RAD"]
        self._ticks = 0

    def sampled(self) -> None:
        self.estimator.update(self.checks.believed)

    def heartbeat(self) -> bytes:
        """The rover's own comes with its streams."""
        return b""

    def controls(self, now_s: float) -> bytes:
        controls = super().controls(now_s)
        said = b"".join(self.queue.said)
        self.queue.said.clear()
        return controls + said

    def _drive(self, checks: Checks) -> Outputs:
        del checks
        for message in self.others:
            self.queue.heard.append(bytes(message.get_msgbuf()))
        self.others.clear()
        self._ticks += 1
        left, right = self.rover.tick(BOOTED_S + self._ticks * CONTROLS_S, self.estimator.motion)
        return Outputs(self.rover.armed, (right - NEUTRAL) / 500.0, (left - NEUTRAL) / 500.0)
