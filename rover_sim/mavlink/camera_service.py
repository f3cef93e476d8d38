"""The camera, a component of its own beside the vehicle: tells what it is, takes pictures into the run's folder."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from rover_sim.mavlink import camera_messages as say
from rover_sim.mavlink.camera_messages import CAMERA, PICTURES, CameraPort, CameraState
from rover_sim.mavlink.commands import ACCEPTED, DENIED, FAILED, UNSUPPORTED, Request
from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client

LEAST_INTERVAL_S = 0.5
_REPEAT_S = 5.0  # a capture command with the same number within this is the same command, sent again
_UNNUMBERED_REPEAT_S = 0.6  # the same without a number, as MAVSDK's first one is; it repeats after 0.5 s
_REMEMBERED = 1000  # pictures that can be told of again
_COMMANDS = ("COMMAND_LONG", "COMMAND_INT")


class CameraService:
    """Handles what is addressed to the camera; every command is answered at once."""

    def __init__(self, context: Context, port: CameraPort) -> None:
        self._context = context
        self._port = port
        self._state = CameraState()
        self._left = math.inf  # pictures still to be taken at the interval
        self._due_s = 0.0
        self._beat_s = 0.0
        self._number = _last_number(port)  # of the last picture's file
        self._captured: dict[int, Message] = {}
        self._last: dict[Client, tuple[float, float]] = {}  # number of the last capture command, and when
        self._tell: Mapping[int, Callable[[], Message]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: say.heartbeat,
            mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION: lambda: say.information(context, port),
            mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS: lambda: say.settings(context),
            mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION: lambda: say.storage(context, port),
            mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS: lambda: say.capture_status(context, port, self._state),
        }
        self._actions: Mapping[int, Callable[[Request], int]] = {
            mavlink.MAV_CMD_IMAGE_START_CAPTURE: self._start,
            mavlink.MAV_CMD_IMAGE_STOP_CAPTURE: self._stop,
            mavlink.MAV_CMD_SET_CAMERA_MODE: _set_mode,
            mavlink.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE: lambda request: self._tell_captured(request, request.p1),
            # the older requests, one for each message
            mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION: self._older(mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION),
            mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS: self._older(mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS),
            mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION: self._older(mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION),
            mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: self._older(mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS),
        }

    def takes(self, message: Message) -> bool:
        """Whether a message is the camera's: addressed to it, or to all components and of its own kind."""
        target = getattr(message, "target_component", 0)
        if target != 0 or message.get_type() not in _COMMANDS:
            return bool(target == CAMERA)
        if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            wanted = message.param1
            own = wanted in self._tell or wanted == mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
            return bool(own and wanted != mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        return bool(message.command in self._actions)

    def handle(self, client: Client, message: Message) -> None:
        """Do a command and acknowledge it; other messages are none of the camera's business."""
        if message.get_type() not in _COMMANDS:
            return
        request = Request.of(client, message)
        if request.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            result = self._request_message(request)
        else:
            action = self._actions.get(request.command)
            result = UNSUPPORTED if action is None else action(request)
        answer = mavlink.MAVLink_command_ack_message(
            request.command, result, target_system=client.system, target_component=client.component
        )
        self._context.endpoint.reply(client, answer, CAMERA)

    def tick(self) -> None:
        """Show that the camera is there, and take the pictures that are due."""
        now = self._context.time_s
        if now >= self._beat_s:
            self._beat_s = now + 1.0
            self._context.endpoint.broadcast(say.heartbeat(), CAMERA)
            channels = self._context.endpoint.channels
            self._last = {client: last for client, last in self._last.items() if client.channel in channels}
        if self._state.interval_s and now >= self._due_s:
            self._due_s = now + self._state.interval_s
            self._left -= 1
            if self._left <= 0:
                self._state = replace(self._state, interval_s=0.0)
            self._capture()

    def _start(self, request: Request) -> int:
        """IMAGE_START_CAPTURE: one picture, or one every so many seconds (a count of 0: until told to stop)."""
        interval, count = request.p2, request.p3
        if count == 1.0:
            return self._single(request)
        endless = count == 0.0
        if not (LEAST_INTERVAL_S <= interval < math.inf and (endless or (count.is_integer() and count > 1.0))):
            return DENIED
        if self._state.interval_s:
            return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
        self._left = math.inf if endless else count
        self._due_s = self._context.time_s
        self._state = replace(self._state, interval_s=interval)
        return ACCEPTED

    def _single(self, request: Request) -> int:
        now = self._context.time_s
        number, at_s = self._last.get(request.client, (-1.0, -math.inf))
        if request.p4 == number and now - at_s < (_REPEAT_S if number >= 1.0 else _UNNUMBERED_REPEAT_S):
            return ACCEPTED  # the acknowledgement was lost, not the picture
        if not self._capture():
            return FAILED
        self._last[request.client] = request.p4, now
        return ACCEPTED

    def _stop(self, _request: Request) -> int:
        self._state = replace(self._state, interval_s=0.0)
        self._context.endpoint.broadcast(say.capture_status(self._context, self._port, self._state), CAMERA)
        return ACCEPTED

    def _capture(self) -> bool:
        """Take a picture and tell everyone; a camera or a disk that fails is told too."""
        index = self._state.pictures
        name = f"picture-{self._number + 1:05}.png"
        good = self._take(name)
        message = say.captured(self._context, self._port, index, name, good=good)
        if good:
            self._number += 1
            self._state = replace(self._state, pictures=index + 1)
            self._captured[index] = message
            self._captured.pop(index - _REMEMBERED, None)
        endpoint = self._context.endpoint
        endpoint.broadcast(message, CAMERA)
        endpoint.broadcast(say.capture_status(self._context, self._port, self._state), CAMERA)
        return good

    def _take(self, name: str) -> bool:
        folder = self._port.folder / PICTURES
        try:
            folder.mkdir(exist_ok=True)
            return self._port.take(folder / name)
        except OSError:  # the disk is full or not ours: the sender is told
            return False

    def _request_message(self, request: Request) -> int:
        if request.p1 == mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED:
            return self._tell_captured(request, request.p2)
        build = self._tell.get(request.p1)  # type: ignore[call-overload]  # a number that is none is no key
        if build is None:
            return UNSUPPORTED
        self._context.endpoint.reply(request.client, build(), CAMERA)
        return ACCEPTED

    def _tell_captured(self, request: Request, index: float) -> int:
        message = self._captured.get(index)  # type: ignore[call-overload]  # as above
        if message is None:
            return DENIED
        self._context.endpoint.reply(request.client, message, CAMERA)
        return ACCEPTED

    def _older(self, message_id: int) -> Callable[[Request], int]:
        def send(request: Request) -> int:
            self._context.endpoint.reply(request.client, self._tell[message_id](), CAMERA)
            return ACCEPTED

        return send


def _set_mode(request: Request) -> int:
    return ACCEPTED if request.p2 == mavlink.CAMERA_MODE_IMAGE else DENIED


def _last_number(port: CameraPort) -> int:
    """The highest number among pictures of earlier runs in the folder: none is overwritten."""
    names = (path.stem.removeprefix("picture-") for path in (port.folder / PICTURES).glob("picture-*.png"))
    return max((int(name) for name in names if name.isascii() and name.isdigit()), default=0)
