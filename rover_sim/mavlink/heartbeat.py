"""HEARTBEAT and AUTOPILOT_VERSION: who the vehicle says it is.

It poses as its persona's autopilot and says openly (firmware type DEV, a STATUSTEXT) that it is a simulator.
"""

from __future__ import annotations

from importlib.metadata import version

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.persona import Persona

SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_AUTOPILOT1
BANNER = "rover-sim: simulated rover, not a real vehicle"
_MODE_FLAGS = {
    Mode.MANUAL: mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED,
    Mode.HOLD: 0,
    Mode.AUTO: mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
    Mode.RETURN: mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
    Mode.SMART_RETURN: mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
    Mode.GUIDED: mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
}


def heartbeat(autopilot: Autopilot, persona: Persona) -> Message:
    """HEARTBEAT of the vehicle."""
    flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | _MODE_FLAGS[autopilot.mode]
    if autopilot.armed:
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GROUND_ROVER,
        persona.autopilot,
        flags,
        persona.custom_mode(autopilot),
        _system_status(autopilot, persona),
        3,
    )


def autopilot_version(persona: Persona) -> Message:
    """AUTOPILOT_VERSION: our own version or the imitated one, with firmware type DEV (0)."""
    own = (int(part) for part in version("rover-sim").split(".")[:3])
    major, minor, patch = own if persona.imitates is None else persona.imitates
    no_hash = (0,) * 8
    number = (major & 255) << 24 | (minor & 255) << 16 | (patch & 255) << 8
    return mavlink.MAVLink_autopilot_version_message(
        persona.capabilities, number, 0, 0, 0, no_hash, no_hash, no_hash, 0, 0, SYSTEM
    )


def _system_status(autopilot: Autopilot, persona: Persona) -> int:
    """CRITICAL after a fail-safe; otherwise STANDBY at rest: in Hold for an ArduRover, disarmed for others."""
    if autopilot.tripped:
        return int(mavlink.MAV_STATE_CRITICAL)
    at_rest = not autopilot.armed if persona.px4_modes else autopilot.mode is Mode.HOLD
    return int(mavlink.MAV_STATE_STANDBY if at_rest else mavlink.MAV_STATE_ACTIVE)
