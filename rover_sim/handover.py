"""A mission in the hands of a foreign autopilot: uploaded, read back, and started and followed where that is wanted."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from rover_sim import __version__
from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.handover_plans import HandoverPlan, Spot
from rover_sim.mavlink.commander import CommandState, PendingCommand
from rover_sim.mavlink.foreign_companion import ForeignCompanion
from rover_sim.mavlink.geodesy import DEGREES_E7, GeoPoint, LocalFrame
from rover_sim.mavlink.uploader import Upload, UploadState
from rover_sim.mavlink.vehicle_control import TroubleKind
from rover_sim.mavlink.wire import WireItem
from worlds.scenario import Origin

FAR_M = 1000.0  # as far as QGroundControl lets a vehicle be sent
SILENT_S = 10.0  # without the vehicle, after which the link counts as lost
HOLD_S = 5.0  # that a hold at the end may take


class HandoverEnd(StrEnum):
    """How a handover ended; the values are those of ``summary.json``."""

    UPLOADED = "uploaded"  # on board and read back, not started
    COMPLETE = "complete"
    TOO_FAR = "too_far"
    MISSION_REFUSED = "mission_refused"
    NOT_READY = "not_ready"
    NOT_ARMED = "not_armed"
    NOT_STARTED = "not_started"
    TAKEN_OVER = "taken_over"
    TIMEOUT = "timeout"
    LINK_LOST = "link_lost"
    NO_VEHICLE = "no_vehicle"
    WRONG_VEHICLE = "wrong_vehicle"
    ABORTED = "aborted"

    @property
    def is_success(self) -> bool:
        """Whether what was asked for was done."""
        return self in (HandoverEnd.UPLOADED, HandoverEnd.COMPLETE)


@dataclass(frozen=True)
class Ending:
    """How it ended, in one word and in one sentence."""

    end: HandoverEnd
    detail: str


class Handover:
    """Brings one plan to one vehicle; the time of each step is passed in."""

    def __init__(
        self,
        companion: ForeignCompanion,
        plan: HandoverPlan,
        *,
        start: bool,
        limit_s: float,
        plan_at: Callable[[Spot], HandoverPlan] | None = None,
    ) -> None:
        """``start``: arm and drive too; ``limit_s``: of the drive, after which the vehicle is told to hold.

        ``plan_at``: makes the plan that takes the place of ``plan`` where the vehicle says that it stands and looks.
        """
        self.plan, self.companion = plan, companion
        self._plan_at = plan_at
        self.time_s = 0.0
        self.begun_s: float | None = None  # when the vehicle was seen to drive it
        self._start, self._limit_s = start, limit_s
        self._ready: PendingCommand | None = None
        self._upload: Upload | None = None
        self._was_armed = False  # before we came
        self._holding: tuple[PendingCommand, float, Ending] | None = None
        self._next: Callable[[], Ending | None] = self._prepare

    @property
    def doing(self) -> str:
        """What is going on, for a person."""
        companion, status = self.companion, self.companion.status
        if companion.found is None:
            return "waiting for a heartbeat"
        if self._holding is not None:
            return "telling it to stop"
        if self.begun_s is not None:
            left = self._left_m()
            way = "" if left is None else f", {left:.1f} m to the end"
            return f"item {status.current} of {len(self.plan.items) - 1}{way}"
        if (self._start or self._plan_at is not None) and companion.waits_for:
            return f"waiting for {companion.waits_for}"
        return "uploading and reading back" if self._uploading() else "starting"

    def step(self, time_s: float) -> Ending | None:
        """One round of the link; the ending once there is one."""
        self.time_s = time_s
        self.companion.tick(time_s)
        if self._holding is not None:
            return self._held(*self._holding)
        trouble = self.companion.trouble
        if trouble is not None:
            return self._in_trouble(Ending(_ENDS[trouble.kind], trouble.text))
        heard_s = self.companion.status.heard_s
        if heard_s is not None and time_s - heard_s > SILENT_S:
            return Ending(HandoverEnd.LINK_LOST, f"the vehicle has not been heard for {SILENT_S:g} s")
        return self._next()

    def abort(self, why: str) -> Ending | None:
        """End it: a vehicle that drives our mission is told to hold first, which further steps bring about."""
        ending = Ending(HandoverEnd.ABORTED, why)
        if self._start and self._upload is not None and self.companion.linked:
            self._hold(ending)
            return None
        return ending

    def _prepare(self) -> Ending | None:
        """Only a vehicle that knows its place can be told whether the way begins near it, or where it begins."""
        if (self._start or self._plan_at is not None) and not self._is_ready():
            return None
        if self._plan_at is not None:
            place, heading_deg = self.companion.status.place, self.companion.status.heading_deg
            if place is None or heading_deg is None:
                return Ending(HandoverEnd.NOT_READY, "it does not tell where it stands and looks (GLOBAL_POSITION_INT)")
            self.plan = self._plan_at(Spot(place.latitude_deg, place.longitude_deg, heading_deg))
        if not self._start:
            self._upload, self._next = self.companion.upload(self.plan.items, self.time_s), self._bring
            return None
        far_m = self._distance_m(self.plan.places[0])
        if far_m is not None and far_m > FAR_M:
            return Ending(HandoverEnd.TOO_FAR, f"the way begins {far_m:.0f} m from the vehicle; allowed: {FAR_M:g} m")
        self._was_armed = self.companion.status.armed
        self._upload, self._next = self.companion.drive(self.plan.items, self.time_s), self._bring
        return None

    def _is_ready(self) -> bool:
        if self._ready is None:
            self._ready = self.companion.get_ready()
        return self._ready.state is CommandState.DONE

    def _bring(self) -> Ending | None:
        """Until the mission is on board, and is driven if that is wanted."""
        upload = self._upload
        if upload is None or upload.state is UploadState.SENDING or self.companion.transfers:
            return None
        if upload.state is not UploadState.DONE:
            return Ending(HandoverEnd.MISSION_REFUSED, upload.reason)
        if not self._start:
            count = len(self.plan.places)
            return Ending(HandoverEnd.UPLOADED, f"{count} waypoints are on board, read back as they were sent")
        if not self.companion.busy:
            status = self.companion.status
            if status.mode != Mode.AUTO or not status.armed:
                return Ending(HandoverEnd.TAKEN_OVER, "somebody changed the mode before it could be started")
            self.begun_s, self._next = self.time_s, self._follow
        return None

    def _follow(self) -> Ending | None:
        """Until the vehicle says that the mission is complete; a person who changes the mode has it."""
        status = self.companion.status
        if status.mission_state is MissionState.COMPLETE:
            self._hold(Ending(HandoverEnd.COMPLETE, "the vehicle says that its mission is complete"))
        elif status.mode != Mode.AUTO or not status.armed:
            said = [text for at_s, severity, text in status.texts if at_s > self.time_s - SILENT_S and severity <= 4]
            what = "was disarmed" if not status.armed else f"is in {_mode_name(status.mode)}"
            return Ending(HandoverEnd.TAKEN_OVER, f"the vehicle {what}" + (f": {said[-1]}" if said else ""))
        elif self.companion.owns_mission is False:
            return Ending(HandoverEnd.TAKEN_OVER, "somebody sent the vehicle another mission")
        elif self.begun_s is not None and self.time_s - self.begun_s > self._limit_s:
            self._hold(Ending(HandoverEnd.TIMEOUT, f"not complete within {self._limit_s:g} s"))
        return None

    def _in_trouble(self, ending: Ending) -> Ending | None:
        """A torn mission is cleared, and what we armed for nothing is disarmed, before anything is said."""
        if self.companion.transfers:
            return None
        if self._upload is None or self._was_armed or not self.companion.status.armed:
            return ending
        self._holding = self.companion.arm(on=False), self.time_s, ending
        return None

    def _hold(self, ending: Ending) -> None:
        """In Auto, the next mission that anybody sends would be driven at once."""
        self._holding = self.companion.set_mode(Mode.HOLD), self.time_s, ending

    def _held(self, pending: PendingCommand, since_s: float, ending: Ending) -> Ending | None:
        if pending.state is CommandState.SENDING and self.time_s - since_s < HOLD_S:
            return None
        held = pending.state is CommandState.DONE
        return ending if held else Ending(ending.end, f"{ending.detail}; it did not obey the last command, to stop")

    def _uploading(self) -> bool:
        return self._upload is None or self._upload.state is UploadState.SENDING

    def _left_m(self) -> float | None:
        """The straight way to the last place."""
        return self._distance_m(self.plan.places[-1])

    def _distance_m(self, item: WireItem) -> float | None:
        place = self.companion.status.place
        if place is None:
            return None
        there = GeoPoint(item.x / DEGREES_E7, item.y / DEGREES_E7, place.altitude_m)
        origin = Origin(place.latitude_deg, place.longitude_deg, place.altitude_m)
        x, y, _ = LocalFrame(origin).to_world(there)
        return math.hypot(x, y)


def summary(handover: Handover, ending: Ending, url: str) -> dict[str, Any]:
    """What ``summary.json`` says."""
    found, status = handover.companion.found, handover.companion.status
    reached, place = set(status.reached), status.place
    numbers = [seq for seq, item in enumerate(handover.plan.items) if item in handover.plan.places]
    return {
        "plan": handover.plan.source,
        "url": url,
        "autopilot": None if found is None else found.name,
        "success": ending.end.is_success,
        "reason": ending.end.value,
        "detail": ending.detail,
        "items": len(handover.plan.items),
        "waypoints": len(handover.plan.places),
        "waypoints_reached": len(reached.intersection(numbers)),
        "started": handover.begun_s is not None,
        "time_s": round(handover.time_s, 2),
        "drive_time_s": None if handover.begun_s is None else round(handover.time_s - handover.begun_s, 2),
        "last_place_deg": None if place is None else [place.latitude_deg, place.longitude_deg],
        "texts": [[round(at_s, 2), severity, text] for at_s, severity, text in status.texts],
        "version": __version__,
    }


_ENDS = {kind: HandoverEnd(kind.value) for kind in TroubleKind}


def _mode_name(mode: int | None) -> str:
    return Mode(mode).name.title() if mode in set(Mode) else f"mode {mode}"
