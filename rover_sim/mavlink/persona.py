"""Personas: as whose vehicle the rover answers, since ground stations treat each autopilot by rules of its own.

A persona is one table of mode numbers, one rule for item 0 of a mission and one encoding of parameters. It is chosen
before the start: ground stations keep what the first heartbeat says. Mode numbers: ArduPilot ``Rover/mode.h`` and PX4
``px4_custom_mode.h`` (main mode in bits 16 to 23, sub mode in bits 24 to 31).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.autopilot.modes import Mode
from rover_sim.autopilot.parameters import Parameter
from rover_sim.autopilot.safety_parameters import ARDUPILOT_SAFETY, PX4_SAFETY
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.persona_parameters import ARDUPILOT_PARAMETERS, GENERIC_PARAMETERS, PX4_PARAMETERS

_COMMON = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
)


def _px4(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


@dataclass(frozen=True)
class SteeringRules:
    """How one kind of autopilot is steered by hand or by set points; parameters are named."""

    neutral_thrust: int  # z of MANUAL_CONTROL that stands still; 1000 is full ahead
    least_thrust: int  # z that is full astern; below it the axis is ignored
    twist_steers: bool  # whether r of MANUAL_CONTROL steers too
    operator: str | None  # parameter: the system whose sticks count, 0 any; None: any
    stick_time: str  # parameter: sticks count as lost after, s
    loss_action: str  # parameter: what then
    loss_modes: Mapping[int, Mode | None]  # by its value; None: stand still
    target_time: str  # parameter: set points count as lost after, s
    places_expire: bool  # whether a place to drive to counts as lost too
    hold_on_loss: bool  # mode Hold once set points are lost; else stand still in Guided
    heading_by_yaw: bool  # a velocity goes where the message's yaw points, if it has one


@dataclass(frozen=True)
class Persona:
    """How one kind of autopilot speaks."""

    name: str
    autopilot: int  # MAV_AUTOPILOT of the heartbeat
    capabilities: int  # MAV_PROTOCOL_CAPABILITY
    numbers: Mapping[Mode, int]  # custom_mode
    asked_for: Mapping[int, Mode]  # custom_mode of modes that are taken for one of these, and never shown
    px4_modes: bool  # DO_SET_MODE names main and sub mode, and Guided is two modes
    home_first: bool  # item 0 of a mission may be the home position
    bytewise: bool  # an integer parameter travels as its bytes, not as a rounded float
    parameters: tuple[Parameter, ...]  # that its ground stations expect beside those of the rover
    steering: SteeringRules
    tells_landed: bool  # whether "flying" is told by EXTENDED_SYS_STATE alone
    replaced: tuple[Parameter, ...] = ()  # of the rover's own, because this autopilot calls them differently
    imitates: tuple[int, int, int] | None = None  # the version that is claimed; None: that of rover-sim

    def custom_mode(self, autopilot: Autopilot) -> int:
        """custom_mode of the heartbeat. PX4 drives to a place in Hold, and follows set points in Offboard.

        A way back on the rover's own track is a return where there is no number for it.
        """
        mode = autopilot.mode
        if mode is Mode.SMART_RETURN and mode not in self.numbers:
            mode = Mode.RETURN
        if self.px4_modes and mode is Mode.GUIDED and autopilot.has_guided_task:
            mode = Mode.HOLD
        return self.numbers[mode]

    def mode(self, custom_mode: int) -> Mode | None:
        """The mode of a number; None if this persona has none such."""
        own = next((mode for mode, number in self.numbers.items() if number == custom_mode), None)
        return self.asked_for.get(custom_mode) if own is None else own

    def commanded_mode(self, main: float, sub: float) -> Mode | None:
        """The mode that parameters 2 and 3 of DO_SET_MODE name."""
        if not self.px4_modes:
            return self.mode(int(main)) if main.is_integer() else None
        sub = sub if sub == sub else 0.0  # noqa: PLR0124  (NaN: not given)
        if not (main.is_integer() and sub.is_integer()):
            return None
        return self.mode(_px4(int(main), int(sub)))


_PX4_NUMBERS: Mapping[Mode, int] = {
    Mode.MANUAL: _px4(1),
    Mode.HOLD: _px4(4, 3),
    Mode.AUTO: _px4(4, 4),
    Mode.RETURN: _px4(4, 5),
    Mode.GUIDED: _px4(6),
}
# Altitude and Position, the modes for sticks that MAVSDK asks for: our Manual holds speed and rate as Position does.
_PX4_STICK_MODES: Mapping[int, Mode] = {_px4(2): Mode.MANUAL, _px4(3): Mode.MANUAL}
ARDUPILOT = Persona(
    name="ardupilot",
    autopilot=int(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
    capabilities=_COMMON | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
    numbers={mode: int(mode) for mode in Mode},
    asked_for={},
    px4_modes=False,
    home_first=True,
    bytewise=False,
    parameters=ARDUPILOT_PARAMETERS,
    steering=SteeringRules(
        neutral_thrust=0,
        least_thrust=-1000,
        twist_steers=False,
        operator="MAV_GCS_SYSID",
        stick_time="RC_OVERRIDE_TIME",
        loss_action="FS_THR_ENABLE",
        loss_modes={0: None, 1: Mode.HOLD},
        target_time="GUID_TIMEOUT",
        places_expire=False,
        hold_on_loss=False,
        heading_by_yaw=True,
    ),
    tells_landed=False,
)
PX4 = Persona(
    name="px4",
    autopilot=int(mavlink.MAV_AUTOPILOT_PX4),
    capabilities=_COMMON | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
    numbers=_PX4_NUMBERS,
    asked_for=_PX4_STICK_MODES,
    px4_modes=True,
    home_first=False,
    bytewise=True,
    parameters=(*PX4_PARAMETERS, *PX4_SAFETY),
    replaced=ARDUPILOT_SAFETY,
    steering=SteeringRules(
        neutral_thrust=500,
        least_thrust=0,
        twist_steers=False,
        operator=None,
        stick_time="COM_RC_LOSS_T",
        loss_action="NAV_RCL_ACT",
        loss_modes={1: Mode.HOLD, 2: Mode.RETURN},
        target_time="COM_OF_LOSS_T",
        places_expire=True,
        hold_on_loss=True,
        heading_by_yaw=False,
    ),
    tells_landed=True,
    imitates=(1, 15, 0),  # below 1.4.1 QGroundControl warns of an outdated firmware
)
GENERIC = Persona(
    name="generic",
    autopilot=int(mavlink.MAV_AUTOPILOT_GENERIC),
    capabilities=_COMMON | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
    numbers=_PX4_NUMBERS,  # what MAVSDK sends to an autopilot that it does not know
    asked_for=_PX4_STICK_MODES,
    px4_modes=True,
    home_first=False,
    bytewise=True,
    parameters=GENERIC_PARAMETERS,
    steering=SteeringRules(
        neutral_thrust=0,
        least_thrust=-1000,
        twist_steers=True,
        operator="MAV_GCS_SYSID",
        stick_time="FS_STICK_S",
        loss_action="FS_STICK_ACT",
        loss_modes={0: None, 1: Mode.HOLD},
        target_time="FS_TARGET_S",
        places_expire=True,
        hold_on_loss=True,
        heading_by_yaw=False,
    ),
    tells_landed=True,
)
PERSONAS: Mapping[str, Persona] = {persona.name: persona for persona in (ARDUPILOT, PX4, GENERIC)}
