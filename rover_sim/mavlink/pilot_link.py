"""A pilot's end of a link: sticks and commands to one vehicle, and what is known of vehicle and link."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from rover_sim.autopilot.modes import Mode
from rover_sim.autopilot.sticks import Sticks
from rover_sim.mavlink.dialect import Message, Packer, Parser, Signer, mavlink
from rover_sim.mavlink.persona import GENERIC, PERSONAS, Persona
from rover_sim.mavlink.transport import Transport

COMPONENT = int(mavlink.MAV_COMP_ID_USER2)
STICK_HZ, HEARTBEAT_HZ, CLOCK_HZ = 20.0, 1.0, 2.0
SILENT_S = 3.0  # without a heartbeat the vehicle is gone
_FULL = 1000
_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_LOSS_FRAMES = 500  # over which loss is counted
_ROUND_TRIPS = 5
_RESULTS: Mapping[int, str] = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "not now",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "not supported",
    mavlink.MAV_RESULT_FAILED: "failed",
}
_COMMANDS = {mavlink.MAV_CMD_COMPONENT_ARM_DISARM: "arm or disarm", mavlink.MAV_CMD_DO_SET_MODE: "mode"}


@dataclass
class Gaps:
    """Frames that were lost, by the gaps in one component's sequence numbers."""

    last: int | None = None
    recent: deque[int] = field(default_factory=lambda: deque(maxlen=_LOSS_FRAMES))  # lost before each frame

    def note(self, sequence: int) -> None:
        """A frame came in; one that is older than the last was overtaken and is not counted."""
        ahead = 1 if self.last is None else (sequence - self.last) % 256
        if 0 < ahead < 128:
            self.recent.append(ahead - 1)
            self.last = sequence

    @property
    def share(self) -> float:
        """Lost frames out of all that were sent, 0 to 1."""
        lost = sum(self.recent)
        return lost / (lost + len(self.recent)) if self.recent else 0.0


@dataclass
class VehicleView:
    """The vehicle as its messages tell; None: not told yet."""

    system: int | None = None
    persona: Persona = GENERIC
    mode: str = "?"
    armed: bool = False
    battery_pct: int | None = None
    round_trip_s: float | None = None
    heard_s: float = 0.0


def thrust(throttle: float, persona: Persona) -> int:
    """Z of MANUAL_CONTROL for a throttle between -1 and 1."""
    rules = persona.steering
    reach = _FULL - rules.neutral_thrust if throttle > 0.0 else rules.neutral_thrust - rules.least_thrust
    return round(rules.neutral_thrust + throttle * reach)


class PilotLink:
    """Steers the first vehicle that is heard; every time is passed in."""

    def __init__(self, transport: Transport, system: int = 255, signer: Signer | None = None) -> None:
        """``signer``: signs what is sent; what it does not believe is not heard."""
        self.view = VehicleView()
        self.gaps = Gaps()
        self.texts: list[str] = []  # of the vehicle and about commands, to be taken away by who shows them
        self._transport = transport
        self._packer, self._signer = Packer(system, COMPONENT, signer), signer
        self._parsers: dict[str, Parser] = {}
        self._round_trips: deque[float] = deque(maxlen=_ROUND_TRIPS)
        self._due_s = dict.fromkeys(("sticks", "heartbeat", "clock"), 0.0)

    def connected(self, time_s: float) -> bool:
        """Whether the vehicle is there."""
        return self.view.system is not None and time_s - self.view.heard_s < SILENT_S

    def tick(self, time_s: float, sticks: Sticks) -> None:
        """Read what has come, and send what is due: sticks 20 times a second, heartbeat and clock."""
        self._read(time_s)
        if self._due("heartbeat", HEARTBEAT_HZ, time_s):
            kind, none = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
            self._send(mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, mavlink.MAV_STATE_ACTIVE, 3), time_s)
        if self.view.system is None:
            return
        if self._due("sticks", STICK_HZ, time_s):
            self.steer(time_s, sticks)
        if self._due("clock", CLOCK_HZ, time_s):
            self._send(mavlink.MAVLink_timesync_message(0, round(time_s * 1e9)), time_s)

    def steer(self, time_s: float, sticks: Sticks) -> None:
        """Send sticks now, whether or not it is their turn."""
        if self.view.system is not None:
            z, y = thrust(sticks.throttle, self.view.persona), round(_FULL * sticks.steer)
            self._send(mavlink.MAVLink_manual_control_message(self.view.system, 0, y, z, 0, 0), time_s)

    def arm(self, time_s: float, *, on: bool) -> None:
        """Ask the vehicle to arm or to disarm; refusals become texts."""
        self._command(time_s, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, float(on))

    def set_mode(self, time_s: float, mode: Mode) -> None:
        """Ask for a mode; a refusal becomes a text."""
        number = self.view.persona.numbers[mode]
        custom = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        if self.view.persona.px4_modes:
            self._command(time_s, mavlink.MAV_CMD_DO_SET_MODE, custom, number >> 16 & 255, number >> 24)
        else:
            self._command(time_s, mavlink.MAV_CMD_DO_SET_MODE, custom, number)

    def take_texts(self) -> list[str]:
        """Texts since the last call."""
        texts, self.texts = self.texts, []
        return texts

    def _command(self, time_s: float, number: int, *parameters: float) -> None:
        if self.view.system is None:
            self.texts.append("no vehicle yet")
            return
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        self._send(mavlink.MAVLink_command_long_message(self.view.system, _AUTOPILOT, number, 0, *padded), time_s)

    def _due(self, what: str, rate_hz: float, time_s: float) -> bool:
        if time_s < self._due_s[what]:
            return False
        after = self._due_s[what] + 1.0 / rate_hz
        self._due_s[what] = after if after > time_s else time_s + 1.0 / rate_hz
        return True

    def _send(self, message: Message, time_s: float) -> None:
        frame = self._packer.pack(message)
        for peer in self._transport.peers(time_s):
            self._transport.send(frame, peer, time_s)

    def _read(self, time_s: float) -> None:
        for peer, data in self._transport.receive(time_s):
            parser = self._parsers.setdefault(peer, Parser(self._signer))
            for message in (parser.stream if self._transport.is_stream else parser.datagram)(data):
                if message.get_srcComponent() == _AUTOPILOT and self._is_ours(message):
                    self._take(message, time_s)

    def _is_ours(self, message: Message) -> bool:
        """The first vehicle that sends a heartbeat is the one."""
        if self.view.system is None and message.get_type() == "HEARTBEAT":
            self.view.system = message.get_srcSystem()
            found = (persona for persona in PERSONAS.values() if persona.autopilot == message.autopilot)
            self.view.persona = next(found, GENERIC)
        return bool(message.get_srcSystem() == self.view.system)

    def _take(self, message: Message, time_s: float) -> None:
        self.gaps.note(message.get_seq())
        view = self.view
        match message.get_type():
            case "HEARTBEAT":
                mode = view.persona.mode(message.custom_mode)
                view.mode = f"mode {message.custom_mode}" if mode is None else mode.name.title()
                view.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                view.heard_s = time_s
            case "BATTERY_STATUS" | "SYS_STATUS":
                view.battery_pct = message.battery_remaining if message.battery_remaining >= 0 else None
            case "TIMESYNC" if message.tc1 != 0:
                self._round_trips.append(time_s - message.ts1 / 1e9)
                view.round_trip_s = statistics.median(self._round_trips)
            case "STATUSTEXT":
                self.texts.append(message.text)
            case "COMMAND_ACK" if message.result in _RESULTS and message.command in _COMMANDS:
                self.texts.append(f"{_COMMANDS[message.command]}: {_RESULTS[message.result]}")
