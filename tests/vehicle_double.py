"""What the doubles of foreign autopilots share: one link, frames, streams, and a rover that goes where its wheels say.

They imitate and are not the autopilots: nothing that is driven with them is a run with ArduPilot or PX4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from rover_sim.mavlink.dialect import Message, Packer, Parser, mavlink
from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from rover_sim.mavlink.transport import Transport
from worlds.scenario import Origin

SYSTEM, COMPONENT = 1, 1
HOME = Origin(latitude_deg=-35.363261, longitude_deg=149.165230, altitude_m=584.0)
NEUTRAL = 1500
Wheels = tuple[int, int]  # pulses of the left and the right side, microseconds


@dataclass(frozen=True)
class Motion:
    """Where the rover is: metres from home, clockwise heading in radians, speed ahead."""

    north_m: float = 0.0
    east_m: float = 0.0
    heading_rad: float = 0.0
    speed_m_s: float = 0.0

    def place(self, frame: LocalFrame) -> GeoPoint:
        return frame.to_geo((self.east_m, self.north_m, 0.0))


class KinematicRover:
    """A skid-steer rover without slip: 1.5 m/s at full output, 0.8 m track, 0.15 s lag."""

    FASTEST_M_S, TRACK_M, LAG_S = 1.5, 0.8, 0.15

    def __init__(self) -> None:
        self.motion = Motion()
        self._left = self._right = 0.0

    def step(self, wheels: Wheels, step_s: float) -> None:
        share = min(step_s / self.LAG_S, 1.0)
        left, right = (self.FASTEST_M_S * (pulse - NEUTRAL) / 500.0 for pulse in wheels)
        self._left += share * (left - self._left)
        self._right += share * (right - self._right)
        speed = 0.5 * (self._left + self._right)
        heading = self.motion.heading_rad + step_s * (self._left - self._right) / self.TRACK_M
        north = self.motion.north_m + step_s * speed * math.cos(heading)
        east = self.motion.east_m + step_s * speed * math.sin(heading)
        self.motion = Motion(north, east, math.remainder(heading, math.tau), speed)


def to_wheels(throttle: float, steering: float) -> Wheels:
    """Pulses of a skid-steer mixer: positive steering is clockwise; the sides share what is too much."""
    scale = max(1.0, abs(throttle) + abs(steering))
    left, right = (throttle + steering) / scale, (throttle - steering) / scale
    return round(NEUTRAL + 500.0 * left), round(NEUTRAL + 500.0 * right)


@dataclass(frozen=True)
class Gains:
    """What the controllers know of their rover."""

    full_m_s: float = KinematicRover.FASTEST_M_S  # at full throttle
    feed_forward_s: float = KinematicRover.TRACK_M / (2.0 * KinematicRover.FASTEST_M_S)  # steering for 1 rad/s


KINEMATIC = Gains()


def steer_towards(
    motion: Motion, north_m: float, east_m: float, speed_m_s: float, gains: Gains = KINEMATIC
) -> tuple[float, float]:
    """Throttle and steering towards a place; backwards with a negative speed."""
    bearing = math.atan2(east_m - motion.east_m, north_m - motion.north_m)
    if speed_m_s < 0.0:
        bearing += math.pi
    return steer_heading(motion, bearing, speed_m_s, gains)


def steer_heading(
    motion: Motion, heading_rad: float, speed_m_s: float, gains: Gains = KINEMATIC
) -> tuple[float, float]:
    """Throttle and steering along a heading; it turns on the spot where the heading is far off."""
    error = math.remainder(heading_rad - motion.heading_rad, math.tau)
    rate = max(-1.0, min(1.0, 2.0 * error))
    ahead = speed_m_s if abs(error) < math.radians(30.0) else 0.0
    return ahead / gains.full_m_s, rate * gains.feed_forward_s


class VehicleDouble:
    """The MAVLink side of an autopilot on one link; time and motion are passed in."""

    autopilot = 0
    kind = int(mavlink.MAV_TYPE_GROUND_ROVER)

    def __init__(self, transport: Transport, home: Origin = HOME) -> None:
        self.home, self.frame = home, LocalFrame(home)
        self.time_s = 0.0
        self.motion = Motion()
        self.armed = False
        self.custom_mode = 0
        self.gains = KINEMATIC
        self.commands: list[int] = []  # heard
        self.said: list[str] = []
        self._transport, self._packer, self._parser = transport, Packer(SYSTEM, COMPONENT), Parser()
        self._interval_s: dict[int, float] = {}
        self._next_s: dict[int, float] = {}
        self._beat_s = -1.0
        self._handlers: dict[str, Callable[[Message], None]] = {}

    def tick(self, time_s: float, motion: Motion) -> Wheels:
        """Hear, answer, stream, drive; the pulses for both sides."""
        self.time_s, self.motion = time_s, motion
        for _, data in self._transport.receive(time_s):
            for message in self._parser.datagram(data):
                handler = self._handlers.get(message.get_type())
                if handler is not None and getattr(message, "target_system", 0) in (0, SYSTEM):
                    handler(message)
        self.live()
        if time_s - self._beat_s >= 1.0:
            self._beat_s = time_s
            self.beat()
        for message_id, at_s in list(self._next_s.items()):
            if time_s >= at_s:
                self._next_s[message_id] = time_s + self._interval_s[message_id]
                message = self.streamed(message_id)
                if message is not None:
                    self.send(message)
        return self.drive() if self.armed else (NEUTRAL, NEUTRAL)

    def live(self) -> None:
        """What happens by itself."""

    def drive(self) -> Wheels:
        return NEUTRAL, NEUTRAL

    def beat(self) -> None:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        state = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        self.send(mavlink.MAVLink_heartbeat_message(self.kind, self.autopilot, base, self.custom_mode, state, 3))

    def streamed(self, message_id: int) -> Message | None:
        """A message of a stream; None for one that is not known."""
        boot_ms = int(self.time_s * 1e3)
        if message_id == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT:
            place = self.motion.place(self.frame)
            heading = round(math.degrees(self.motion.heading_rad) % 360.0 * 100.0) % 36000
            north = round(100.0 * self.motion.speed_m_s * math.cos(self.motion.heading_rad))
            east = round(100.0 * self.motion.speed_m_s * math.sin(self.motion.heading_rad))
            return mavlink.MAVLink_global_position_int_message(
                boot_ms, place.latitude_e7, place.longitude_e7, place.altitude_mm, 0, north, east, 0, heading
            )
        if message_id == mavlink.MAVLINK_MSG_ID_ATTITUDE:
            return mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, self.motion.heading_rad, 0.0, 0.0, 0.0)
        return None

    def set_interval(self, message_id: int, interval_us: float) -> None:
        if interval_us > 0:
            self._interval_s[message_id], self._next_s[message_id] = interval_us / 1e6, self.time_s
        else:
            self._next_s.pop(message_id, None)

    def send(self, message: Message) -> None:
        frame = self._packer.pack(message)
        for peer in self._transport.peers(self.time_s):
            self._transport.send(frame, peer, self.time_s)

    def say(self, severity: int, text: str) -> None:
        self.said.append(text)
        self.send(mavlink.MAVLink_statustext_message(severity, text.encode()[:50]))

    def metres(self, x_e7: int, y_e7: int) -> tuple[float, float]:
        """North and east of home of a place in 1e-7 degrees."""
        east, north, _ = self.frame.to_world(GeoPoint(x_e7 / 1e7, y_e7 / 1e7, self.home.altitude_m))
        return north, east
