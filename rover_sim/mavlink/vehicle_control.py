"""What a planner wants of its side of the link, whoever the vehicle is: our own autopilot or a foreign one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from rover_sim.mavlink.commander import PendingCommand
from rover_sim.mavlink.uploader import Upload
from rover_sim.mavlink.vehicle_watch import VehicleStatus
from rover_sim.mavlink.wire import WireItem


class TroubleKind(StrEnum):
    """What makes going on pointless."""

    NO_VEHICLE = "no_vehicle"
    WRONG_VEHICLE = "wrong_vehicle"
    NOT_READY = "not_ready"
    NOT_ARMED = "not_armed"
    NOT_STARTED = "not_started"
    REFUSED = "mission_refused"


@dataclass(frozen=True)
class Trouble:
    """Why the vehicle cannot be used, in one line."""

    kind: TroubleKind
    text: str


class VehicleControl(Protocol):
    """One vehicle, as a planner sees and commands it; modes are our ``Mode`` numbers, item 0 of a mission is home."""

    @property
    def status(self) -> VehicleStatus:
        """What is known of the vehicle now."""
        ...

    @property
    def linked(self) -> bool:
        """Whether the vehicle has been heard lately."""
        ...

    @property
    def trouble(self) -> Trouble | None:
        """What makes going on pointless; None while there is hope."""
        ...

    @property
    def waits_for(self) -> str:
        """What the vehicle is still waited for, in words; empty once it is ready to drive."""
        ...

    @property
    def reverses(self) -> bool:
        """Whether a mission can make it drive backwards."""
        ...

    @property
    def owns_mission(self) -> bool | None:
        """Whether the vehicle's mission was uploaded here; None without a mission, or where nothing tells."""
        ...

    def upload(self, items: Sequence[WireItem], time_s: float) -> Upload:
        """Send a mission; while another is on its way it waits, and only the newest waits."""
        ...

    def drive(self, items: Sequence[WireItem], time_s: float) -> Upload:
        """Send a mission and, once the vehicle has it whole, arm and start where that is not so already."""
        ...

    def command(self, command: int, *parameters: float) -> PendingCommand:
        """Send a command (COMMAND_LONG), after those that are still unanswered."""
        ...

    def arm(self, *, on: bool = True) -> PendingCommand:
        """Arm or disarm."""
        ...

    def set_mode(self, number: int) -> PendingCommand:
        """Change the mode."""
        ...

    def start_mission(self) -> PendingCommand:
        """Start the mission, or go on with it."""
        ...

    def change_speed(self, speed_m_s: float) -> PendingCommand:
        """Cruise at another speed on what is being driven."""
        ...

    def turn_to(self, yaw_rad: float) -> PendingCommand:
        """Turn on the spot to a heading in the world."""
        ...

    def say(self, severity: int, text: str) -> None:
        """Tell people a text (STATUSTEXT), as soon as somebody hears; ``severity`` as in MAV_SEVERITY."""
        ...

    def tick(self, time_s: float) -> None:
        """Hear, answer, repeat, and show that we are here."""
        ...

    def close(self) -> None:
        """Close the link."""
        ...
