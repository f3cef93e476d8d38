"""The planner's side of the link: an onboard computer that uploads missions and follows their progress."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.commander import Commander, CommandState, PendingCommand
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Endpoint, Link
from rover_sim.mavlink.geodesy import heading_deg
from rover_sim.mavlink.status import status_texts
from rover_sim.mavlink.uploader import Upload, Uploader, UploadState
from rover_sim.mavlink.vehicle_control import Trouble
from rover_sim.mavlink.vehicle_watch import VehicleStatus, VehicleWatch
from rover_sim.mavlink.wire import WireItem

COMPONENT = int(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
_LAST_UPLOADS = 8
_START_AGAIN_S = 2.0  # after a refusal


@dataclass
class StartWish:
    """A mission that is to be started."""

    command: PendingCommand
    mode: int | None  # of the vehicle when it was asked
    refused_s: float | None = None


class Companion:
    """One vehicle's companion: same system number, component 191."""

    def __init__(self, link: Link, system: int = 1, target_component: int = 1) -> None:
        self.endpoint = Endpoint(system, COMPONENT, [link])
        self._vehicle = system, target_component
        self._uploader = Uploader(self._send, system, target_component)
        self._commander = Commander(self._send, system, target_component)
        self._watch = VehicleWatch()
        self._time_s = 0.0
        self._texts = 0
        self._beat_s: float | None = None
        self._to_drive: Upload | None = None
        self._start_wish: StartWish | None = None
        self._uploads: deque[Upload] = deque(maxlen=_LAST_UPLOADS)
        self._handlers: Mapping[str, Callable[[Message], None]] = {
            **self._watch.handlers,
            "MISSION_REQUEST_INT": lambda message: self._uploader.requested(message, self._time_s),
            "MISSION_REQUEST": lambda message: self._uploader.requested(message, self._time_s),
            "MISSION_ACK": lambda message: self._uploader.acknowledged(message, self._time_s),
            "COMMAND_ACK": lambda message: self._commander.acknowledged(message, self._time_s),
        }

    @property
    def status(self) -> VehicleStatus:
        """What is known of the vehicle now."""
        return self._watch.status

    @property
    def linked(self) -> bool:
        """Whether the vehicle has been heard lately."""
        return self._watch.linked

    @property
    def trouble(self) -> Trouble | None:
        """None: our own vehicle is there and ready, and its refusals are the planner's to answer."""
        return None

    @property
    def waits_for(self) -> str:
        """Nothing: our own vehicle is ready from the start."""
        return ""

    @property
    def reverses(self) -> bool:
        """Our own vehicle backs up."""
        return True

    @property
    def owns_mission(self) -> bool | None:
        """Whether the vehicle's mission was uploaded here; None without a mission, or where ids are not told."""
        held = self.status.mission_id
        return None if held == 0 else any(upload.opaque_id == held for upload in reversed(self._uploads))

    def upload(self, items: Sequence[WireItem], time_s: float) -> Upload:
        """Send a mission; while another is on its way it waits, and only the newest waits."""
        self._to_drive = self._start_wish = None
        self._watch.forget_progress()
        self._uploads.append(self._uploader.upload(items, time_s))
        return self._uploads[-1]

    def drive(self, items: Sequence[WireItem], time_s: float) -> Upload:
        """Send a mission and, once the vehicle has it whole, arm and start where that is not so already."""
        upload = self.upload(items, time_s)
        self._to_drive = upload
        return upload

    def command(self, command: int, *parameters: float) -> PendingCommand:
        """Send a command (COMMAND_LONG), after those that are still unanswered."""
        return self._commander.command(command, *parameters)

    def arm(self, *, on: bool = True) -> PendingCommand:
        """Arm or disarm."""
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0 if on else 0.0)

    def set_mode(self, number: int) -> PendingCommand:
        """Change the mode."""
        self._start_wish = None
        custom = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, custom, float(number))

    def start_mission(self) -> PendingCommand:
        """Start the mission, or go on with it."""
        return self.command(mavlink.MAV_CMD_MISSION_START)

    def change_speed(self, speed_m_s: float) -> PendingCommand:
        """Cruise at another speed on what is being driven."""
        return self.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0)

    def turn_to(self, yaw_rad: float) -> PendingCommand:
        """Turn on the spot to a heading in the world, in mode Guided."""
        self._start_wish = None
        return self.command(mavlink.MAV_CMD_CONDITION_YAW, heading_deg(yaw_rad))

    def say(self, severity: int, text: str) -> None:
        """Tell people a text (STATUSTEXT), by way of the vehicle; ``severity`` as in MAV_SEVERITY."""
        self._texts = self._texts % 60000 + 1
        for message in status_texts(severity, text, self._texts):
            self._send(message)

    def tick(self, time_s: float) -> None:
        """Hear, answer, repeat, and show that we are here."""
        self._time_s = time_s
        self._watch.look(time_s)
        for client, message in self.endpoint.poll(time_s):
            handler = self._handlers.get(message.get_type())
            if handler is not None and (client.system, client.component) == self._vehicle:
                handler(message)
        self._uploader.tick(time_s)
        if self._to_drive is not None and self._to_drive.state is not UploadState.SENDING:
            self._start(self._to_drive)
        self._insist(time_s)
        self._commander.tick(time_s)
        if self._beat_s is None or time_s - self._beat_s >= 1.0:
            self._beat_s = time_s
            kind, no_autopilot = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
            self._send(mavlink.MAVLink_heartbeat_message(kind, no_autopilot, 0, 0, mavlink.MAV_STATE_ACTIVE, 3))

    def close(self) -> None:
        """Close the link."""
        self.endpoint.close()

    def _start(self, upload: Upload) -> None:
        """A start before the end of the upload would start the mission before."""
        self._to_drive = None
        if upload.state is UploadState.DONE:
            if not self.status.armed:
                self.arm()
            if self.status.mode != Mode.AUTO:
                self._start_wish = StartWish(self.start_mission(), self.status.mode)

    def _insist(self, time_s: float) -> None:
        """Ask again for a start that was refused, as what was in its way may be over; not if somebody took over."""
        wish = self._start_wish
        if wish is None or wish.command.state is CommandState.SENDING:
            return
        if wish.command.state is CommandState.DONE or self.status.mode != wish.mode or not self.owns_mission:
            self._start_wish = None
        elif wish.refused_s is None:
            wish.refused_s = time_s
        elif time_s - wish.refused_s >= _START_AGAIN_S:
            self._start_wish = StartWish(self.start_mission(), wish.mode)

    def _send(self, message: Message) -> None:
        self.endpoint.broadcast(message)
