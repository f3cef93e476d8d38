"""AVAILABLE_MODES and CURRENT_MODE: the persona's modes by name, for ground stations that ask."""

from __future__ import annotations

from collections.abc import Mapping

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import Message, mavlink

# QGroundControl's own names: it finds the modes of its buttons by them.
_ARDUPILOT_NAMES: Mapping[Mode, str] = {
    Mode.MANUAL: "Manual",
    Mode.HOLD: "Hold",
    Mode.AUTO: "Auto",
    Mode.RETURN: "RTL",
    Mode.SMART_RETURN: "Smart RTL",
    Mode.GUIDED: "Guided",
}
_PX4_NAMES = {**_ARDUPILOT_NAMES, Mode.AUTO: "Mission", Mode.RETURN: "Return", Mode.GUIDED: "Offboard"}
# A standard mode would be set by another command than the mode number is.
_NOT_STANDARD = mavlink.MAV_STANDARD_MODE_NON_STANDARD


def available_modes(context: Context, index: float) -> list[Message]:
    """AVAILABLE_MODES of one mode, counted from 1; of all for 0; none for any other index."""
    persona = context.persona
    names = _PX4_NAMES if persona.px4_modes else _ARDUPILOT_NAMES
    modes = list(persona.numbers)
    chosen = range(1, len(modes) + 1) if index == 0.0 else [int(index)] if index in range(1, len(modes) + 1) else []
    return [
        mavlink.MAVLink_available_modes_message(
            len(modes), number, _NOT_STANDARD, persona.numbers[modes[number - 1]], 0, names[modes[number - 1]].encode()
        )
        for number in chosen
    ]


def current_mode(context: Context) -> Message:
    """CURRENT_MODE."""
    number = context.persona.custom_mode(context.autopilot)
    return mavlink.MAVLink_current_mode_message(_NOT_STANDARD, number, number)
