"""What the vehicle's microservices share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Protocol

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.mavlink.dialect import Message
from rover_sim.mavlink.endpoint import Client, Endpoint
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.persona import Persona
from worlds.types import GnssReading, PoseEstimate, SensorReadings

Handler = Callable[[Client, Message], None]


@dataclass(eq=False)
class Context:
    """The autopilot that the vehicle speaks for and how, the world's place on Earth, and this tick's belief."""

    autopilot: Autopilot
    persona: Persona
    frame: LocalFrame
    endpoint: Endpoint
    time_s: float = 0.0
    estimate: PoseEstimate | None = None
    readings: SensorReadings | None = None
    gnss: GnssReading | None = None  # the last fix
    channels: dict[int, int] = field(default_factory=dict)  # RC channels that a ground station holds, microseconds
    plans: tuple[Plan, ...] = ()  # mission, fence and rally points

    def look(self, time_s: float, estimate: PoseEstimate | None, readings: SensorReadings | None) -> None:
        """Take over this tick's belief; a pose that is not finite is none."""
        self.time_s = time_s
        self.estimate = estimate if estimate is not None and _finite(estimate) else None
        self.readings = readings
        if readings is not None and readings.gnss is not None:
            self.gnss = readings.gnss

    @property
    def boot_ms(self) -> int:
        """Time since start as MAVLink's wrapping counter."""
        return int(self.time_s * 1e3) & 0xFFFFFFFF


class Plan(Protocol):
    """A stored list, as far as telemetry tells of it."""

    opaque_id: int  # 0 if it is empty


class Service(Protocol):
    """One microservice: which messages it takes, and what it does by itself."""

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """Handlers by message name; a name belongs to one service only."""
        ...

    def tick(self) -> None:
        """Called once a tick, after the messages."""
        ...


def _finite(estimate: PoseEstimate) -> bool:
    pose = estimate.pose
    vectors = (*pose.position_w.tolist(), *pose.quaternion_w.tolist(), *estimate.velocity_w.tolist())
    return all(map(isfinite, vectors)) and isfinite(estimate.yaw_rate_rad_s)
