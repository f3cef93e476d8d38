"""Sticks: MANUAL_CONTROL and RC_CHANNELS_OVERRIDE, of one operator at a time.

Both are datagrams that nobody answers and that carry no time. So what is overtaken on its way is told by the frame's
sequence number, and what nobody refreshes counts as lost. Axes and neutral points: ArduPilot
``Rover/GCS_MAVLink_Rover.cpp``, PX4 ``mavlink_receiver.cpp``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rover_sim.autopilot.sticks import Sticks
from rover_sim.mavlink.context import Context, Handler
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Client
from rover_sim.mavlink.heartbeat import SYSTEM
from rover_sim.mavlink.persona import SteeringRules

STEER, THROTTLE = 1, 3  # RC channels, as RCMAP_ROLL and RCMAP_THROTTLE (or RC_MAP_...) say
CHANNELS = 18
_FULL = 1000
_RELEASED_AXIS = 32767
_RELEASED = math.inf  # as a deflection: let go
_PULSE_US = (800, 2200)  # what a receiver can mean
_DEFAULT_PULSES = {"MIN": 1000.0, "TRIM": 1500.0, "MAX": 2000.0}
_NEWER = 128  # half of the sequence numbers: beyond it a frame is older than the last one
_ORDER_S = 0.5  # a sender that paused for so long may have begun to count anew


@dataclass(frozen=True)
class _Held:
    """A deflection, and when it was last said."""

    deflection: float
    at_s: float


class StickService:
    """Turns both messages into deflections, and tells whose they are."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._operator: Client | None = None
        self._sequence = 0
        self._heard_s = 0.0
        self._held: dict[int, _Held] = {}  # by channel

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """Both kinds of sticks."""
        return {"MANUAL_CONTROL": self._manual, "RC_CHANNELS_OVERRIDE": self._override}

    def tick(self) -> None:
        """Once the sticks are lost, anybody may take over."""
        if self._operator is not None and self._context.autopilot.pilot.sticks is None:
            self._drop()

    def _manual(self, client: Client, message: Message) -> None:
        rules = self._context.persona.steering
        if message.target not in (0, SYSTEM) or not self._takes(client, message):
            return
        self._hold(THROTTLE, _thrust(message, rules))
        self._hold(STEER, _steering(message, rules))
        for channel in (STEER, THROTTLE):
            self._show(channel)
        self._steer()

    def _override(self, client: Client, message: Message) -> None:
        """Channels 1 to 8: 65535 leaves one as it is, 0 releases it; 9 to 18: 0 and 65535, and 65534."""
        if not self._takes(client, message):
            return
        for channel in range(1, CHANNELS + 1):
            pulse = int(getattr(message, f"chan{channel}_raw"))
            if pulse == (0 if channel <= 8 else 65534):
                self._hold(channel, _RELEASED)
                self._context.channels.pop(channel, None)
            elif _PULSE_US[0] <= pulse <= _PULSE_US[1]:
                self._hold(channel, self._deflection(channel, pulse))
                self._context.channels[channel] = pulse
        self._steer()

    def _takes(self, client: Client, message: Message) -> bool:
        """Whether this client may steer and its frame is no older than the last."""
        context, name = self._context, self._context.persona.steering.operator
        if name is not None and context.autopilot.parameters[name] not in (0.0, float(client.system)):
            return False
        if self._operator not in (None, client):
            return False  # as long as somebody steers, nobody else does
        sequence, now = message.get_seq(), context.time_s
        if self._operator == client and now - self._heard_s < _ORDER_S and (sequence - self._sequence) % 256 >= _NEWER:
            return False
        self._operator, self._sequence, self._heard_s = client, sequence, now
        return True

    def _hold(self, channel: int, deflection: float | None) -> None:
        """Take a deflection, release the channel, or leave it as it is."""
        if deflection is None:
            return
        if deflection == _RELEASED:
            self._held.pop(channel, None)
        else:
            self._held[channel] = _Held(deflection, self._context.time_s)

    def _steer(self) -> None:
        pilot, rules = self._context.autopilot.pilot, self._context.persona.steering
        parameters = self._context.autopilot.parameters
        lasts_s = parameters[rules.stick_time]
        # Each channel by itself is lost: one that only others are sent beside must not stay deflected.
        fresh = {channel: held for channel, held in self._held.items() if self._context.time_s - held.at_s < lasts_s}
        self._held = fresh
        steering = [fresh[channel] for channel in (THROTTLE, STEER) if channel in fresh]
        if not steering:
            pilot.release()
            return
        sticks = Sticks(*(fresh[channel].deflection if channel in fresh else 0.0 for channel in (THROTTLE, STEER)))
        until_s = max(held.at_s for held in steering) + lasts_s
        pilot.move(sticks, until_s, rules.loss_modes[int(parameters[rules.loss_action])])

    def _drop(self) -> None:
        self._operator = None
        self._held.clear()
        self._context.channels.clear()

    def _show(self, channel: int) -> None:
        """MANUAL_CONTROL as a receiver would have it, for RC_CHANNELS."""
        if channel in self._held:
            deflection = self._held[channel].deflection
            low, trim, high = self._pulses(channel)
            reach = high - trim if deflection > 0.0 else trim - low
            self._context.channels[channel] = round(trim + deflection * reach)
        else:
            self._context.channels.pop(channel, None)

    def _deflection(self, channel: int, pulse: float) -> float:
        low, trim, high = self._pulses(channel)
        reach = high - trim if pulse > trim else trim - low
        return min(max((pulse - trim) / reach, -1.0), 1.0) if reach > 0.0 else 0.0

    def _pulses(self, channel: int) -> tuple[float, float, float]:
        """Shortest, middle and longest pulse of a channel, microseconds."""
        table = self._context.autopilot.parameters
        low, trim, high = (
            table[name] if (name := f"RC{channel}_{suffix}") in table else default
            for suffix, default in _DEFAULT_PULSES.items()
        )
        return low, trim, high


def _thrust(message: Message, rules: SteeringRules) -> float | None:
    """Deflection of z; None if it is out of range."""
    if message.z == _RELEASED_AXIS:
        return _RELEASED
    thrust, neutral = int(message.z), rules.neutral_thrust
    return (thrust - neutral) / (_FULL - neutral) if rules.least_thrust <= thrust <= _FULL else None


def _steering(message: Message, rules: SteeringRules) -> float | None:
    """Deflection of y, or of r if that steers too and is the larger; None if it is out of range."""
    axes = (message.y, message.r) if rules.twist_steers else (message.y,)
    valid = [int(axis) for axis in axes if abs(axis) <= _FULL]
    if valid:
        return max(valid, key=abs) / _FULL
    return _RELEASED if message.y == _RELEASED_AXIS else None


def rc_channels(context: Context) -> Message | None:
    """RC_CHANNELS: what is overridden now; None while nothing is."""
    if not context.channels:
        return None
    pulses = [context.channels.get(channel, 65535) for channel in range(1, CHANNELS + 1)]
    return mavlink.MAVLink_rc_channels_message(context.boot_ms, max(context.channels), *pulses, 255)
