"""Parameters that QGroundControl reads from each autopilot without asking whether they exist.

Without them it tells the user that parameters are missing. They say what the simulated rover is: a stick per axis, one
heading sensor that needs no calibration. Names and the values that count as "set up": QGroundControl
``src/AutoPilotPlugins/APM`` and ``src/AutoPilotPlugins/PX4``. A name with one allowed value is read-only.
"""

from __future__ import annotations

from dataclasses import replace

from rover_sim.autopilot.parameters import Parameter


def _fixed(name: str, value: float, meaning: str, *, integer: bool = True) -> Parameter:
    return Parameter(name, value, value, value, meaning, integer)


def _pulse(channel: int, suffix: str, default: float) -> Parameter:
    return Parameter(f"RC{channel}_{suffix}", default, 800, 2200, "stick range, microseconds", integer=True)


_STICKS = (("ROLL", 1), ("PITCH", 2), ("THROTTLE", 3), ("YAW", 4))
_PULSES = (("MIN", 1000), ("MAX", 2000), ("TRIM", 1500))  # 1100 to 1900 would count as "not calibrated"
_STEERS = Parameter("MAV_GCS_SYSID", 255, 0, 255, "the system whose sticks count; 0: any", integer=True)
ARDUPILOT_PARAMETERS: tuple[Parameter, ...] = (
    _fixed("ARMING_REQUIRE", 1, "arming is required"),
    Parameter("FS_THR_ENABLE", 1, 0, 1, "sticks lost in Manual: 0 stand still, 1 hold", integer=True),
    Parameter("GUID_TIMEOUT", 3.0, 0.1, 60.0, "set points of a motion count as lost after, s"),
    _STEERS,
    Parameter("RC_OVERRIDE_TIME", 3.0, 0.1, 120.0, "sticks count as lost after, s"),
    *(_fixed(f"COMPASS_DEV_ID{n}", 97539 if not n else 0, "heading sensor") for n in ("", "2", "3")),
    *(_fixed(f"COMPASS_OFS_{axis}", 1.0, "offset; 0 would count as not calibrated", integer=False) for axis in "XYZ"),
    *(_fixed(f"COMPASS_USE{n}", 0 if n else 1, "heading sensor in use") for n in ("", "2", "3")),
    _fixed("FRAME_CLASS", 1, "rover"),
    *(_fixed(f"INS_ACCOFFS_{axis}", 0.01, "offset; 0 would count as not calibrated", integer=False) for axis in "XYZ"),
    *(_pulse(channel, suffix, value) for _, channel in _STICKS for suffix, value in _PULSES),
    *(_fixed(f"RCMAP_{name}", channel, "channel of the stick") for name, channel in _STICKS),
)
PX4_PARAMETERS: tuple[Parameter, ...] = (
    _fixed("BAT1_N_CELLS", 6, "cells"),
    _fixed("BAT1_SOURCE", 0, "the battery is measured"),
    _fixed("BAT1_V_CHARGED", 4.05, "V of a full cell", integer=False),
    _fixed("BAT1_V_EMPTY", 3.3, "V of an empty cell", integer=False),
    *(_fixed(f"CAL_{sensor}0_ID", 1, "the sensor is there") for sensor in ("ACC", "GYRO", "MAG")),
    Parameter("COM_OF_LOSS_T", 1.0, 0.1, 60.0, "set points count as lost after, s"),
    Parameter("COM_RC_LOSS_T", 0.5, 0.1, 35.0, "sticks count as lost after, s"),
    Parameter("NAV_RCL_ACT", 2, 1, 2, "sticks lost in Manual: 1 hold, 2 return", integer=True),
    _fixed("COM_RC_IN_MODE", 1, "sticks come from the ground station"),
    *(_fixed(f"RC_MAP_{name}", channel, "channel of the stick") for name, channel in _STICKS),
    *(_fixed(f"RC_MAP_{name}", 0, "no such switch") for name in ("AUX1", "AUX2", "FLTMODE", "KILL_SW", "RETURN_SW")),
    _fixed("SYS_AUTOSTART", 50000, "airframe: generic ground vehicle"),
    _fixed("SYS_HAS_MAG", 1, "there is a heading sensor"),
    _fixed("SYS_HAS_NUM_ASPD", 0, "no airspeed sensor"),
)
GENERIC_PARAMETERS: tuple[Parameter, ...] = (
    Parameter("FS_STICK_ACT", 1, 0, 1, "sticks lost in Manual: 0 stand still, 1 hold", integer=True),
    Parameter("FS_STICK_S", 0.5, 0.1, 60.0, "sticks count as lost after, s"),
    Parameter("FS_TARGET_S", 1.0, 0.1, 60.0, "set points count as lost after, s"),
    replace(_STEERS, default=0),
)
