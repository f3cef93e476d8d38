"""What a scenario's fault events do at an instant; the events themselves are `worlds.fault_events`."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto

from worlds.errors import ScenarioError
from worlds.fault_events import Event, LosableSensor
from worlds.types import Vector3


class WheelState(Enum):
    """How a wheel's motor is."""

    SOUND = auto()
    HELD = auto()  # blocked
    FREE = auto()  # turns without its motor
    UNPOWERED = auto()  # drags its gear


def sensor_lost(events: Sequence[Event], sensor: LosableSensor, time_s: float) -> bool:
    """Whether a sensor is silent."""
    return any(event.sensor == sensor and event.active(time_s) for event in events)


def gnss_offset_w(events: Sequence[Event], time_s: float) -> Vector3:
    """What a satellite fix is off by: east, north, up."""
    jumps = [event.offset_m for event in events if event.offset_m is not None and event.active(time_s)]
    x, y, z = (sum(jump[axis] for jump in jumps) for axis in range(3))
    return float(x), float(y), float(z)


def wheel_states(events: Sequence[Event], wheels: int, time_s: float) -> tuple[WheelState, ...]:
    """State of every wheel; a wheel's own fault comes before that of the power."""
    active = [event for event in events if event.active(time_s)]
    powered = all(event.kind != "power_loss" for event in active)
    states = [WheelState.SOUND if powered else WheelState.UNPOWERED] * wheels
    for event in active:
        if event.wheel is not None:
            states[event.wheel] = WheelState.HELD if event.stuck == "held" else WheelState.FREE
    return tuple(states)


def stall_s(events: Sequence[Event], before_s: float, now_s: float) -> float:
    """Wall seconds by which the answer for ``now_s`` is to come late; the answer before was for ``before_s``."""
    due = [event.stall_s for event in events if event.stall_s is not None and before_s < event.time_s <= now_s]
    return float(sum(due))


def check_wheels(events: Sequence[Event], rover: str, wheels: int, source: str) -> None:
    """Raise a `ScenarioError` for an event of a wheel that the rover does not have."""
    for number, event in enumerate(events):
        if event.wheel is not None and event.wheel >= wheels:
            raise ScenarioError(
                f"{source}: event[{number}].wheel = {event.wheel}: {rover} has the wheels 0 to {wheels - 1}"
            )
