"""HEARTBEAT and AUTOPILOT_VERSION: who the vehicle says it is.

It poses as an ArduPilot ground rover, the one identity for which ground stations show all their controls, and says
openly (firmware type DEV, a STATUSTEXT) that it is a simulator.
"""

from __future__ import annotations

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import Message, mavlink

SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_AUTOPILOT1
CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
)
BANNER = "rover-sim: simulated rover, not a real vehicle"
_MODE_FLAGS = {
    Mode.MANUAL: mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED,
    Mode.HOLD: 0,
    Mode.AUTO: mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
    Mode.RETURN: mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
    Mode.GUIDED: mavlink.MAV_MODE_FLAG_GUIDED_ENABLED,
}


def heartbeat(autopilot: Autopilot) -> Message:
    """HEARTBEAT of the vehicle."""
    flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | _MODE_FLAGS[autopilot.mode]
    if autopilot.armed:
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GROUND_ROVER,
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        flags,
        int(autopilot.mode),
        _system_status(autopilot),
        3,
    )


def autopilot_version(version: str) -> Message:
    """AUTOPILOT_VERSION with a version such as ``0.1.0`` and firmware type DEV (0)."""
    major, minor, patch = (int(part) for part in version.split(".")[:3])
    no_hash = (0,) * 8
    number = (major & 255) << 24 | (minor & 255) << 16 | (patch & 255) << 8
    return mavlink.MAVLink_autopilot_version_message(
        CAPABILITIES, number, 0, 0, 0, no_hash, no_hash, no_hash, 0, 0, SYSTEM
    )


def _system_status(autopilot: Autopilot) -> int:
    """As ArduRover: STANDBY in Hold, ACTIVE otherwise, CRITICAL after a fail-safe."""
    if autopilot.tripped:
        return int(mavlink.MAV_STATE_CRITICAL)
    return int(mavlink.MAV_STATE_STANDBY if autopilot.mode is Mode.HOLD else mavlink.MAV_STATE_ACTIVE)
