"""Who is on the link: the first autopilot that sends a heartbeat."""

from __future__ import annotations

from dataclasses import dataclass

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.foreign_rules import AutopilotRules, rules_of

_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_WHEELED = (mavlink.MAV_TYPE_GROUND_ROVER,)


@dataclass(frozen=True)
class Found:
    """An autopilot and its rules."""

    system: int
    component: int
    kind: int  # MAV_TYPE
    rules: AutopilotRules

    @property
    def is_rover(self) -> bool:
        """Whether it drives on the ground."""
        return self.kind in _WHEELED

    @property
    def name(self) -> str:
        """What it is, in words."""
        entry = mavlink.enums["MAV_TYPE"].get(self.kind)
        kind = f"vehicle of type {self.kind}" if entry is None else _words(entry.name)
        return f"{kind} ({self.rules.title}, system {self.system})"


def find(message: Message) -> Found | None:
    """The autopilot that speaks in this message; None for ground stations, cameras and whoever else is there."""
    if message.get_type() != "HEARTBEAT" or message.get_srcComponent() != _AUTOPILOT:
        return None
    if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID or message.get_srcSystem() == 0:
        return None
    return Found(message.get_srcSystem(), _AUTOPILOT, message.type, rules_of(message.autopilot))


def _words(name: str) -> str:
    return str(name).removeprefix("MAV_TYPE_").lower().replace("_", " ")
