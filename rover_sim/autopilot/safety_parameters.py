"""Parameters of the fence, in the names and choices of each autopilot, and what they mean to ours.

ArduRover: ``libraries/AC_Fence/AC_Fence.cpp``, ``libraries/AP_Rally/AP_Rally.cpp``. PX4: ``geofence_params.c``.
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
_ARDUPILOT_FENCE: Mapping[int, Response] = {0: (), 1: _RETURN, 2: _HOLD, 3: _SMART_OR_RETURN, 4: _SMART_OR_HOLD}
_PX4_FENCE: Mapping[int, Response] = {0: (), 1: (), 2: _HOLD, 3: _RETURN}

_CHOICES = "0 report only, 1 return, 2 hold, 3 smart return or return, 4 smart return or hold"

ARDUPILOT_SAFETY: tuple[Parameter, ...] = (
    Parameter("FENCE_ACTION", 1, 0, 4, f"on a breach: {_CHOICES}", integer=True),
    Parameter("FENCE_ENABLE", 0, 0, 1, "fence: 0 off, 1 on", integer=True),
    Parameter("FENCE_MARGIN", 2.0, 0.0, 10.0, "distance to the fence at which it warns, m"),
    Parameter(
        "FENCE_OPTIONS", 0, 0, 2, "2: one inclusion area around the rover is enough, 0: all must be", integer=True
    ),
    Parameter("FENCE_RADIUS", 150.0, 1.0, 10000.0, "circle about home, m"),
    Parameter("FENCE_TYPE", 6, 0, 6, "sum of 2 circle about home, 4 polygons and circles of the list", integer=True),
    Parameter("RALLY_INCL_HOME", 1, 0, 1, "home counts as a rally point: 0 no, 1 yes", integer=True),
    Parameter("RALLY_LIMIT_KM", 0.5, 0.0, 100.0, "rally points farther than this are not used, 0: all are, km"),
    Parameter("SRTL_ACCURACY", 0.5, 0.1, 10.0, "smart return: spacing of the remembered track, m"),
    Parameter("SRTL_POINTS", 1000, 0, 5000, "smart return: most points remembered, 0: off", integer=True),
)
PX4_SAFETY: tuple[Parameter, ...] = (
    Parameter("GF_ACTION", 2, 0, 3, "on a breach of the fence: 0 no fence, 1 warn, 2 hold, 3 return", integer=True),
    Parameter("GF_MAX_HOR_DIST", 0.0, 0.0, 10000.0, "circle about home, 0: none, m"),
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
        response=_ARDUPILOT_FENCE[int(parameters["FENCE_ACTION"])],
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
