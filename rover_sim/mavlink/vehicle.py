"""The vehicle: the component that ground stations and the companion talk to. Its services meet here only."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.events import Reached, Text
from rover_sim.mavlink.camera_messages import CAMERA, CameraPort
from rover_sim.mavlink.camera_service import CameraService
from rover_sim.mavlink.clock_service import ClockService
from rover_sim.mavlink.command_server import CommandServer
from rover_sim.mavlink.context import Context, Handler, Service
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client, Endpoint, Link
from rover_sim.mavlink.fence_store import FenceStore, RallyStore
from rover_sim.mavlink.ftp_files import Files
from rover_sim.mavlink.ftp_server import FileServer
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.heartbeat import COMPONENT, SYSTEM
from rover_sim.mavlink.item_store import ItemStore
from rover_sim.mavlink.mission_file import write_plan, write_waypoints
from rover_sim.mavlink.mission_reader import MissionReader
from rover_sim.mavlink.mission_server import MissionServer
from rover_sim.mavlink.mission_store import MissionStore
from rover_sim.mavlink.parameter_server import ParameterServer
from rover_sim.mavlink.persona import ARDUPILOT, Persona
from rover_sim.mavlink.plan_loading import load_plan
from rover_sim.mavlink.signing import Signing
from rover_sim.mavlink.signing_service import SigningService
from rover_sim.mavlink.station_service import StationService
from rover_sim.mavlink.status import status_texts
from rover_sim.mavlink.stick_service import StickService
from rover_sim.mavlink.target_service import TargetService
from rover_sim.mavlink.telemetry import Telemetry
from worlds.types import PoseEstimate, SensorReadings

_FIRST_TEXT = 16  # numbers below are taken by the services' own long texts


class Vehicle:
    """Speaks for an autopilot on any number of links, as system 1, component 1."""

    def __init__(
        self,
        autopilot: Autopilot,
        frame: LocalFrame,
        links: Iterable[Link],
        log: Link | None = None,
        persona: Persona = ARDUPILOT,
        folder: Path | None = None,
        camera: CameraPort | None = None,
        signing: Signing | None = None,
    ) -> None:
        """``folder``: whose files may be read over the links; ``camera``: speaks as a component of its own.

        ``signing``: of all links; without it none can be set up either.
        """
        others = () if camera is None else (CAMERA,)
        self.endpoint = Endpoint(SYSTEM, COMPONENT, links, log, others, signing)
        autopilot.parameters.remove(parameter.name for parameter in persona.replaced)
        autopilot.parameters.extend(persona.parameters)
        self._context = Context(autopilot, persona, frame, self.endpoint)
        self.store = MissionStore(self._context)
        self.fence, self.rally = FenceStore(self._context), RallyStore(self._context)
        stores: tuple[ItemStore, ...] = (self.store, self.fence, self.rally)
        self._context.plans = stores
        telemetry = Telemetry(self._context)
        self._file_server = FileServer(self._context, Files(folder, autopilot.parameters))
        missions = MissionServer(self._context, stores)
        services: tuple[Service, ...] = (
            telemetry,
            CommandServer(self._context, telemetry),
            missions,
            MissionReader(self._context, stores, missions),
            ParameterServer(self._context),
            StationService(self._context),
            StickService(self._context),
            TargetService(self._context),
            ClockService(self._context),
            self._file_server,
            *(() if signing is None else (SigningService(self._context, signing),)),
        )
        self._services = services
        self._camera = None if camera is None else CameraService(self._context, camera)
        self._handlers: dict[str, Handler] = {
            name: handler for service in services for name, handler in service.handlers.items()
        }
        self._handlers["STATUSTEXT"] = self._pass_on
        self._texts = 0

    def tick(self, time_s: float, estimate: PoseEstimate | None, readings: SensorReadings | None) -> None:
        """Take over what the rover believes now, then `answer`."""
        self._context.look(time_s, estimate, readings)
        self.answer(time_s)

    def answer(self, time_s: float) -> None:
        """Answer what has arrived, tell what has happened, stream what is due."""
        self._context.time_s = time_s
        for client, message in self.endpoint.poll(time_s):
            handler = self._handlers.get(message.get_type())
            if self._camera is not None and self._camera.takes(message):
                self._camera.handle(client, message)
            elif handler is not None:
                handler(client, message)
        self._tell()
        for service in self._services:
            service.tick()
        if self._camera is not None:
            self._camera.tick()

    def load_plan(self, path: Path) -> None:
        """Take over mission, fence and rally points of a plan file; raises InputError."""
        stores = (self.store, self.fence, self.rally)
        load_plan(path, stores, home_first=self._context.persona.home_first)

    def save_plans(self, waypoints: Path, plan: Path) -> None:
        """Write the mission in both of the ground stations' formats; the plan has fence and rally points too."""
        items, speed_m_s = self.store.for_files, self._context.autopilot.parameters["CRUISE_SPEED"]
        write_waypoints(waypoints, items)
        write_plan(plan, items, speed_m_s, self.fence.items, self.rally.items)

    def close(self) -> None:
        """Close all links and files."""
        self._file_server.close()
        self.endpoint.close()

    def _pass_on(self, client: Client, text: Message) -> None:
        """Stations hear the companion, which is on no link of theirs."""
        if client.system == SYSTEM and client.component != COMPONENT:
            self.endpoint.forward(client, text)

    def _tell(self) -> None:
        for event in self._context.autopilot.take_events():
            if isinstance(event, Reached):
                self.endpoint.broadcast(mavlink.MAVLink_mission_item_reached_message(event.index))
            elif isinstance(event, Text):
                self._texts += 1
                number = _FIRST_TEXT + self._texts % 60000
                for message in status_texts(int(event.severity), event.text, number):
                    self.endpoint.broadcast(message)
