"""How autopilots that are not ours want to be treated by a companion, as tables.

Modes and the rule for item 0 are those of the personas, which imitate the same autopilots. Sources: ArduPilot
``AP_Mission``, ``MissionItemProtocol``, ``Rover/GCS_MAVLink_Rover.cpp``, measured with ArduRover 4.6.0-dev;
PX4 ``mavlink_mission.cpp``, ``mavlink_receiver.cpp`` and its user guide, "Offboard mode", read only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import EkfStatusReport, mavlink
from rover_sim.mavlink.persona import ARDUPILOT, GENERIC, PX4, Persona
from rover_sim.mavlink.wire import WAYPOINT, WireItem

POSITION_KNOWN = 0x10  # horizontal position, absolute: the same bit in EKF_STATUS_REPORT and ESTIMATOR_STATUS


class Turn(StrEnum):
    """How a turn on the spot is commanded, in mode Guided."""

    YAW = "yaw"  # SET_POSITION_TARGET_LOCAL_NED with nothing but a yaw
    ATTITUDE = "attitude"  # SET_ATTITUDE_TARGET without thrust


@dataclass(frozen=True)
class ReadBack:
    """What an autopilot changes in the items that it stores; parameters count from 1."""

    dropped: Mapping[int, frozenset[int]] = field(default_factory=dict)  # by command: read back as anything
    whole: Mapping[int, frozenset[int]] = field(default_factory=dict)  # by command: cut to whole numbers
    place_e7: int = 0  # 1e-7 degrees
    height_m: float = 0.011  # kept in centimetres


@dataclass(frozen=True)
class AutopilotRules:
    """The rules of one kind of autopilot."""

    title: str
    persona: Persona  # whose mode numbers and whose rule for item 0 are the same
    atomic: bool  # a new mission takes the old one's place whole, or not at all
    resumes: bool  # Auto goes on at the number of the item where the old mission was
    read_back: ReadBack
    streams_hz: Mapping[int, float]  # messages to be asked for
    prearm_counts: bool  # ready also means that SYS_STATUS tells healthy pre-arm checks
    complaints: tuple[str, ...]  # how texts begin that say why it is not ready or will not arm
    turn: Turn
    unsupported: frozenset[int] = frozenset()  # mission commands that it refuses

    @property
    def first_item(self) -> int:
        """Our number of its item 0: home is our item 0."""
        return 0 if self.persona.home_first else 1

    def mode_of(self, custom_mode: int) -> int:
        """Our number of a mode; one that we have not keeps its own, which is none of ours."""
        mode = self.persona.mode(custom_mode)
        return custom_mode if mode is None else int(mode)

    def mode_parameters(self, mode: Mode) -> tuple[float, ...]:
        """Parameters of DO_SET_MODE."""
        custom, number = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), self.persona.numbers[mode]
        if self.persona.px4_modes:
            return custom, float(number >> 16 & 255), float(number >> 24)
        return custom, float(number)

    def wire_items(self, items: Sequence[WireItem]) -> list[WireItem]:
        """The items as this autopilot counts them, from a list with home first."""
        return list(items) if self.persona.home_first else [_renumbered(item) for item in items[1:]]


def _renumbered(item: WireItem) -> WireItem:
    """A jump in a list without home leads to one less."""
    if item.command != mavlink.MAV_CMD_DO_JUMP:
        return item
    target, *rest = item.params
    one, two, three = rest
    return replace(item, params=(target - 1.0, one, two, three))


_STREAMS: Mapping[int, float] = {
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 5.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 2.0,
}
_ESTIMATOR: Mapping[int, float] = {mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 2.0}
ARDUPILOT_RULES = AutopilotRules(
    title="ArduPilot",
    persona=ARDUPILOT,
    atomic=False,
    resumes=True,
    read_back=ReadBack(dropped={WAYPOINT: frozenset({2, 4})}, whole={WAYPOINT: frozenset({1})}),
    streams_hz={EkfStatusReport.id: 2.0, **_STREAMS},
    prearm_counts=False,  # arming itself says why not, and is tried again
    complaints=("PreArm", "Arm:", "Mode change", "Flight mode change"),
    turn=Turn.YAW,
)
PX4_RULES = AutopilotRules(
    title="PX4",
    persona=PX4,
    atomic=True,
    resumes=False,
    read_back=ReadBack(),
    streams_hz={**_ESTIMATOR, **_STREAMS},
    prearm_counts=True,
    complaints=("Preflight Fail", "Arming denied", "Mode change", "Switching to"),
    turn=Turn.ATTITUDE,
    unsupported=frozenset({mavlink.MAV_CMD_DO_SET_REVERSE, mavlink.MAV_CMD_CONDITION_YAW}),
)
GENERIC_RULES = AutopilotRules(
    title="generic autopilot",
    persona=GENERIC,
    atomic=False,  # unknown
    resumes=False,
    read_back=ReadBack(),
    streams_hz={**_ESTIMATOR, **_STREAMS},
    prearm_counts=True,
    complaints=("PreArm", "Preflight Fail"),
    turn=Turn.YAW,
)
_KNOWN = {rules.persona.autopilot: rules for rules in (ARDUPILOT_RULES, PX4_RULES)}


def rules_of(autopilot: int) -> AutopilotRules:
    """The rules for a MAV_AUTOPILOT; those of the generic one if we know none."""
    return _KNOWN.get(autopilot, GENERIC_RULES)
