"""Modes of the autopilot and states of its mission."""

from __future__ import annotations

from enum import IntEnum


class Mode(IntEnum):
    """Driving modes, numbered as ArduRover numbers them (ArduPilot ``Rover/mode.h``)."""

    MANUAL = 0
    HOLD = 4
    AUTO = 10
    RETURN = 11
    SMART_RETURN = 12
    GUIDED = 15


DRIVING_MODES = (Mode.AUTO, Mode.GUIDED, Mode.RETURN, Mode.SMART_RETURN)
"""Modes in which the autopilot itself moves the rover."""


class MissionState(IntEnum):
    """What the mission is doing; the numbers are those of MAVLink's ``MISSION_STATE``."""

    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


class Severity(IntEnum):
    """How much a text matters; the numbers are those of MAVLink's ``MAV_SEVERITY``."""

    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
