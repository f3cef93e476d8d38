"""A rover without physics for tests of the autopilot and of MAVLink: it goes where its wheels say."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planner.mobility import body_motion
from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.mavlink.camera_messages import CameraPort
from rover_sim.mavlink.dialect import Message, Packer, Parser
from rover_sim.mavlink.endpoint import Link
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.persona import ARDUPILOT, Persona
from rover_sim.mavlink.signing import Signing
from rover_sim.mavlink.streams import GROUND_STATION_RATES
from rover_sim.mavlink.vehicle import Vehicle
from worlds.geometry import quaternion_from_euler
from worlds.scenario import Origin
from worlds.types import Footprint, GnssReading, ImuReading, Pose, PoseEstimate, SensorReadings

FOOTPRINT = Footprint(
    length_m=0.99,
    width_m=0.67,
    wheel_radius_m=0.165,
    track_m=0.55,
    wheelbase_m=0.51,
    clearance_m=0.13,
    max_speed_m_s=1.0,
    max_yaw_rate_rad_s=1.0,
)


class KinematicRover:
    """Truth and belief are the same here; ``slip`` and ``roll_rad`` may be set by a test."""

    def __init__(self) -> None:
        self.time_s = 0.0
        self.x_m = self.y_m = self.yaw_rad = 0.0
        self.roll_rad = 0.0
        self.slip = 0.0
        self.position_sd_m = 0.05
        self.wheels: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def move(self, wheels: tuple[float, ...], step_s: float) -> None:
        self.wheels = wheels
        motion = body_motion(wheels, FOOTPRINT)
        speed = motion.linear_m_s * (1.0 - self.slip)
        self.yaw_rad += motion.yaw_rate_rad_s * step_s
        self.x_m += speed * float(np.cos(self.yaw_rad)) * step_s
        self.y_m += speed * float(np.sin(self.yaw_rad)) * step_s
        self.time_s += step_s

    def estimate(self) -> PoseEstimate:
        motion = body_motion(self.wheels, FOOTPRINT)
        speed = motion.linear_m_s * (1.0 - self.slip)
        return PoseEstimate(
            time_s=self.time_s,
            pose=Pose(np.array([self.x_m, self.y_m, 0.0]), quaternion_from_euler(self.roll_rad, 0.0, self.yaw_rad)),
            velocity_w=np.array([speed * np.cos(self.yaw_rad), speed * np.sin(self.yaw_rad), 0.0]),
            yaw_rate_rad_s=motion.yaw_rate_rad_s,
            position_sd_m=self.position_sd_m,
            yaw_sd_rad=0.02,
        )

    def readings(self) -> SensorReadings:
        return SensorReadings(
            time_s=self.time_s,
            imu=ImuReading((0.0, 0.0, 3.71), (0.0, 0.0, 0.0), self.yaw_rad),
            wheel_speed_rad_s=self.wheels,
            gnss=GnssReading((self.x_m, self.y_m, 0.0), (0.0, 0.0, 0.0), 0.5),
        )


class Station:
    """A scripted ground station on its own memory link."""

    def __init__(self, system: int = 255, component: int = 190, faults: Faults | None = None, seed: int = 1) -> None:
        ours, theirs = memory_link(faults, np.random.default_rng(seed))
        self.link = Link(theirs, GROUND_STATION_RATES)
        self.end = ours
        self._parser = Parser()
        self.packer = Packer(system, component)
        self.system = system
        self.component = component
        self.heard: list[Message] = []

    def send(self, message: Message, time_s: float) -> None:
        self.end.send(self.packer.pack(message), "memory", time_s)

    def send_bytes(self, data: bytes, time_s: float) -> None:
        self.end.send(data, "memory", time_s)

    def cut(self) -> None:
        """Nothing passes any more, what was on its way included."""
        self.end.close()

    def listen(self, time_s: float) -> None:
        for _, data in self.end.receive(time_s):
            self.heard += self._parser.datagram(data)

    def take(self, *names: str) -> list[Message]:
        """What was heard of these messages since the last call, everything else kept."""
        taken = [message for message in self.heard if message.get_type() in names]
        self.heard = [message for message in self.heard if message.get_type() not in names]
        return taken


class Yard:
    """A vehicle on its rover, any number of stations, and a clock that only the test moves."""

    def __init__(
        self,
        *stations: Station,
        log: Link | None = None,
        persona: Persona = ARDUPILOT,
        folder: Path | None = None,
        camera: CameraPort | None = None,
        signing: Signing | None = None,
    ) -> None:
        self.rover = KinematicRover()
        self.autopilot = Autopilot(FOOTPRINT, (0.0, 0.0, 0.0))
        self.frame = LocalFrame(Origin())
        self.stations = stations
        links = [station.link for station in stations]
        self.vehicle = Vehicle(self.autopilot, self.frame, links, log, persona, folder, camera, signing)
        self.step()

    @property
    def time_s(self) -> float:
        return self.rover.time_s

    def step(self, seconds: float = 0.0) -> None:
        """At least one tick of 1/48 s; more until the time has passed."""
        end = self.time_s + seconds
        while True:
            estimate, readings = self.rover.estimate(), self.rover.readings()
            wheels = self.autopilot.update(self.time_s, estimate, readings)
            self.vehicle.tick(self.time_s, estimate, readings)
            for station in self.stations:
                station.listen(self.time_s)
            self.rover.move(wheels, 1.0 / 48.0)
            if self.time_s >= end - 1e-9:
                return

    def ask(self, station: Station, message: Message, *names: str) -> list[Message]:
        """Send, tick once, and return what came back of these kinds."""
        station.take(*names)
        station.send(message, self.time_s)
        self.step()
        return station.take(*names)
