"""Parameters of fence and fail-safes, in the names and choices of each autopilot, and what they mean to ours.

ArduRover: ``Rover/Parameters.cpp``, ``libraries/AC_Fence``, ``AP_Rally``, ``AP_BattMonitor``. PX4:
``geofence_params.c``, ``commander_params.c``, ``navigator_params.c``, ``battery_params_common.c``.
Choices that a rover cannot carry out (land, terminate) are out of range.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rover_sim.autopilot.alarm import Response
from rover_sim.autopilot.fence import NO_FENCE_M
from rover_sim.autopilot.modes import Mode
from rover_sim.autopilot.parameters import Parameter, ParameterTable

_CIRCLE, _POLYGON = 2, 4  # bits of FENCE_TYPE
_UNION = 2  # bit of FENCE_OPTIONS
_HOLD: Response = (Mode.HOLD,)
_RETURN: Response = (Mode.RETURN, Mode.HOLD)
_SMART_OR_RETURN: Response = (Mode.SMART_RETURN, Mode.RETURN, Mode.HOLD)
_SMART_OR_HOLD: Response = (Mode.SMART_RETURN, Mode.HOLD)
_ARDUPILOT_ACTIONS: Mapping[int, Response] = {0: (), 1: _RETURN, 2: _HOLD, 3: _SMART_OR_RETURN, 4: _SMART_OR_HOLD}
_PX4_FENCE: Mapping[int, Response] = {0: (), 1: (), 2: _HOLD, 3: _RETURN}
_PX4_LINK: Mapping[int, Response] = {1: _HOLD, 2: _RETURN}

_CHOICES = "0 report only, 1 return, 2 hold, 3 smart return or return, 4 smart return or hold"

ARDUPILOT_SAFETY: tuple[Parameter, ...] = (
    Parameter("BATT_ARM_MAH", 0.0, 0.0, 1e6, "arming needs so much charge, mAh"),
    Parameter("BATT_CRT_MAH", 0.0, 0.0, 1e6, "battery is critical below this charge, mAh"),
    Parameter("BATT_CRT_VOLT", 19.8, 0.0, 100.0, "battery is critical below this voltage, V"),
    Parameter("BATT_FS_CRT_ACT", 0, 0, 4, f"battery critical: {_CHOICES}", integer=True),
    Parameter("BATT_FS_LOW_ACT", 0, 0, 4, f"battery low: {_CHOICES}", integer=True),
    Parameter("BATT_LOW_MAH", 0.0, 0.0, 1e6, "battery is low below this charge, mAh"),
    Parameter("BATT_LOW_TIMER", 10.0, 0.0, 120.0, "how long a low voltage must last, s"),
    Parameter("BATT_LOW_VOLT", 21.0, 0.0, 100.0, "battery is low below this voltage, V"),
    Parameter("FENCE_ACTION", 1, 0, 4, f"on a breach: {_CHOICES}", integer=True),
    Parameter("FENCE_ENABLE", 0, 0, 1, "fence: 0 off, 1 on", integer=True),
    Parameter("FENCE_MARGIN", 2.0, 0.0, 10.0, "distance to the fence at which it warns, m"),
    Parameter(
        "FENCE_OPTIONS", 0, 0, 2, "2: one inclusion area around the rover is enough, 0: all must be", integer=True
    ),
    Parameter("FENCE_RADIUS", 150.0, 1.0, 10000.0, "circle about home, m"),
    Parameter("FENCE_TYPE", 6, 0, 6, "sum of 2 circle about home, 4 polygons and circles of the list", integer=True),
    Parameter("FS_ACTION", 2, 0, 4, f"ground station lost: {_CHOICES}", integer=True),
    Parameter("FS_GCS_ENABLE", 0, 0, 2, "ground station lost: 0 off, 1 FS_ACTION, 2 Auto goes on", integer=True),
    Parameter("FS_GCS_TIMEOUT", 5.0, 2.0, 120.0, "heartbeats of the ground station missed for, s"),
    Parameter("FS_TIMEOUT", 1.5, 0.0, 100.0, "and for this time beside, s"),
    Parameter("RALLY_INCL_HOME", 1, 0, 1, "home counts as a rally point: 0 no, 1 yes", integer=True),
    Parameter("RALLY_LIMIT_KM", 0.5, 0.0, 100.0, "rally points farther than this are not used, 0: all are, km"),
    Parameter("SRTL_ACCURACY", 0.5, 0.1, 10.0, "smart return: spacing of the remembered track, m"),
    Parameter("SRTL_POINTS", 1000, 0, 5000, "smart return: most points remembered, 0: off", integer=True),
)
PX4_SAFETY: tuple[Parameter, ...] = (
    Parameter("BAT_CRIT_THR", 0.07, 0.05, 0.25, "battery is critical below this share"),
    Parameter("BAT_EMERGEN_THR", 0.05, 0.03, 0.1, "battery is nearly empty below this share"),
    Parameter("BAT_LOW_THR", 0.15, 0.12, 0.5, "battery is low below this share"),
    Parameter("COM_DL_LOSS_T", 10.0, 5.0, 300.0, "heartbeats of the ground station missed for, s"),
    Parameter("COM_LOW_BAT_ACT", 0, 0, 3, "battery critical: 0 warn, 2 hold, 3 return", integer=True),
    Parameter("GF_ACTION", 2, 0, 3, "on a breach of the fence: 0 no fence, 1 warn, 2 hold, 3 return", integer=True),
    Parameter("GF_MAX_HOR_DIST", 0.0, 0.0, 10000.0, "circle about home, 0: none, m"),
    Parameter("NAV_DLL_ACT", 0, 0, 2, "ground station lost: 0 nothing, 1 hold, 2 return", integer=True),
)


@dataclass(frozen=True)
class FenceRules:
    """How the fence is to be kept."""

    on: bool
    list_on: bool  # whether the areas of the list count
    radius_m: float  # about home
    margin_m: float
    any_inclusion: bool
    response: Response
    must_exist: bool = False  # where it is on, arming without any line is refused


def fence_rules(parameters: ParameterTable) -> FenceRules:
    """The rules that the parameters set."""
    if "GF_ACTION" in parameters:
        action, radius_m = int(parameters["GF_ACTION"]), parameters["GF_MAX_HOR_DIST"] or NO_FENCE_M
        return FenceRules(
            on=action != 0,
            list_on=True,
            radius_m=radius_m,
            margin_m=0.0,
            any_inclusion=True,
            response=_PX4_FENCE[action],
        )
    kinds = int(parameters["FENCE_TYPE"])
    return FenceRules(
        on=bool(parameters["FENCE_ENABLE"]),
        list_on=bool(kinds & _POLYGON),
        radius_m=parameters["FENCE_RADIUS"] if kinds & _CIRCLE else NO_FENCE_M,
        margin_m=parameters["FENCE_MARGIN"],
        any_inclusion=bool(int(parameters["FENCE_OPTIONS"]) & _UNION),
        response=_ARDUPILOT_ACTIONS[int(parameters["FENCE_ACTION"])],
        must_exist=True,
    )


def rally_rules(parameters: ParameterTable) -> tuple[bool, float]:
    """Whether home counts as a rally point, and how far (m) one may be away."""
    if "RALLY_LIMIT_KM" not in parameters:
        return True, NO_FENCE_M
    return bool(parameters["RALLY_INCL_HOME"]), 1000.0 * parameters["RALLY_LIMIT_KM"] or NO_FENCE_M


def track_rules(parameters: ParameterTable) -> tuple[float, int]:
    """Spacing (m) of the remembered track and its most points, 0 where it is not used."""
    if "SRTL_POINTS" not in parameters:
        return 1.0, 0
    return parameters["SRTL_ACCURACY"], int(parameters["SRTL_POINTS"])


@dataclass(frozen=True)
class StationRules:
    """What the silence of the ground station means."""

    on: bool
    patience_s: float
    response: Response
    auto_goes_on: bool = False


def station_rules(parameters: ParameterTable) -> StationRules:
    """The rules that the parameters set."""
    if "NAV_DLL_ACT" in parameters:
        action = int(parameters["NAV_DLL_ACT"])
        return StationRules(bool(action), parameters["COM_DL_LOSS_T"], _PX4_LINK.get(action, ()))
    mode = int(parameters["FS_GCS_ENABLE"])
    patience_s = parameters["FS_GCS_TIMEOUT"] + parameters["FS_TIMEOUT"]
    response = _ARDUPILOT_ACTIONS[int(parameters["FS_ACTION"])]
    return StationRules(mode > 0, patience_s, response, auto_goes_on=mode == 2)


@dataclass(frozen=True)
class BatteryLevel:
    """Below any of these the battery has reached the level; 0 never is."""

    name: str
    voltage_v: float
    left_mah: float
    left_share: float
    response: Response


def battery_levels(parameters: ParameterTable) -> tuple[BatteryLevel, ...]:
    """Low, critical and, for a PX4, emergency."""
    if "BAT_LOW_THR" not in parameters:
        return tuple(
            BatteryLevel(
                name,
                parameters[f"BATT_{code}_VOLT"],
                parameters[f"BATT_{code}_MAH"],
                0.0,
                _ARDUPILOT_ACTIONS[int(parameters[f"BATT_FS_{code}_ACT"])],
            )
            for name, code in (("low", "LOW"), ("critical", "CRT"))
        )
    action = int(parameters["COM_LOW_BAT_ACT"])
    critical, emergency = {2: (_HOLD, _HOLD), 3: (_RETURN, _HOLD)}.get(action, ((), ()))
    return (
        BatteryLevel("low", 0.0, 0.0, parameters["BAT_LOW_THR"], ()),
        BatteryLevel("critical", 0.0, 0.0, parameters["BAT_CRIT_THR"], critical),
        BatteryLevel("emergency", 0.0, 0.0, parameters["BAT_EMERGEN_THR"], emergency),
    )


def battery_patience_s(parameters: ParameterTable) -> float:
    """How long a low voltage must last."""
    return parameters.get("BATT_LOW_TIMER", 0.0)
