"""What faults happened in a traverse, and what autopilot and planner did from then on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any, Literal

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.vehicle_watch import VehicleStatus
from worlds.fault_events import Event, describe

RESPONSES_LISTED = 200
AutopilotKind = Literal["built-in", "ardupilot", "px4"]
# What a fault of it means nothing to: the built-in autopilot has no barometer and asks for no answers; those from
# outside have no wheel encoders, and ArduPilot's simulator makes all but the inertial unit's samples itself.
_STRANGE: dict[AutopilotKind, frozenset[str]] = {
    "built-in": frozenset({"barometer", "late_physics"}),
    "px4": frozenset({"encoder"}),
    "ardupilot": frozenset({"encoder", "magnetometer", "barometer", "gnss", "gnss_jump"}),
}


@dataclass(frozen=True)
class Response:
    """Something that was done or said after the first fault had begun."""

    time_s: float
    by: str  # autopilot: a text or a change of mode; planner: what it is about
    text: str


def acts(event: Event, kind: AutopilotKind) -> bool:
    """Whether an event means anything to who drives."""
    return not {event.kind, event.sensor} & _STRANGE[kind]


def idle_notes(events: Sequence[Event], kind: AutopilotKind) -> list[str]:
    """A line for each event that will do nothing."""
    return [
        f"event[{number}], {describe(event)}: means nothing to the {kind} autopilot"
        for number, event in enumerate(events)
        if not acts(event, kind)
    ]


class FaultLog:
    """Watches one traverse or served rover."""

    def __init__(self, events: Sequence[Event], kind: AutopilotKind = "built-in") -> None:
        self._events, self._pilot = events, kind
        self._acting = [event for event in events if acts(event, kind)]
        self._responses: list[Response] = []
        self._mode: int | None = None
        self._doing = ""
        self._texts: tuple[tuple[float, int, str], ...] = ()
        self._lasting: tuple[Event, ...] = ()

    def turns(self, time_s: float) -> list[str]:
        """What has begun and what is over since the last call, a line each."""
        before, self._lasting = self._lasting, tuple(event for event in self._acting if event.active(time_s))
        begun = [f"fault: {describe(event)}" for event in self._lasting if event not in before]
        return begun + [f"over: {describe(event)}" for event in before if event not in self._lasting]

    @property
    def lasting(self) -> str:
        """The faults that last, in a few words; empty without any."""
        return ", ".join(describe(event) for event in self._lasting)

    def hear(self, time_s: float, status: VehicleStatus, doing: str) -> None:
        """Note what is new on the planner's side of the link; before the first fault it is only remembered."""
        fresh = _fresh(self._texts, status.texts)
        if any(event.time_s <= time_s for event in self._acting):
            self._note(time_s, "autopilot", [text for _, _, text in fresh])
            if status.mode != self._mode:
                self._note(time_s, "autopilot", [f"mode {_mode_name(status.mode)}"])
            if doing != self._doing:
                self._note(time_s, "planner", [doing])
        self._texts, self._mode, self._doing = status.texts, status.mode, doing

    def summary(self, end_s: float) -> dict[str, Any]:
        """The key ``faults`` of ``summary.json``."""
        return {
            "events": [_told(event, end_s, acts(event, self._pilot)) for event in self._events],
            "responses": [asdict(response) for response in self._responses[:RESPONSES_LISTED]],
        }

    def _note(self, time_s: float, by: str, texts: Sequence[str]) -> None:
        self._responses += [Response(round(time_s, 3), by, text) for text in texts]


def _told(event: Event, end_s: float, acting: bool) -> dict[str, Any]:
    over_s = event.end_s if isfinite(event.end_s) and event.end_s <= end_s else None
    return {
        "kind": event.kind,
        "fault": describe(event),
        "time_s": event.time_s,
        "over_s": over_s,
        "happened": acting and event.time_s <= end_s,
    }


def _fresh(
    known: tuple[tuple[float, int, str], ...], texts: tuple[tuple[float, int, str], ...]
) -> tuple[tuple[float, int, str], ...]:
    """Texts that came after those known; of each the oldest may have been forgotten."""
    for kept in range(len(known), -1, -1):
        if texts[:kept] == known[len(known) - kept :]:
            return texts[kept:]
    return texts


def _mode_name(mode: int | None) -> str:
    return Mode(mode).name.lower() if mode in set(Mode) else str(mode)
