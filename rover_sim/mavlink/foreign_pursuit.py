"""From what is wanted of a foreign vehicle to what it does: readiness, item to begin with, arming, mode, set points."""

from __future__ import annotations

from dataclasses import dataclass

from rover_sim.autopilot.modes import Mode, Severity
from rover_sim.mavlink.commander import Commander, CommandState, PendingCommand
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.foreign_readiness import COMPLAINT_S, complaint
from rover_sim.mavlink.foreign_rules import GENERIC_RULES, AutopilotRules
from rover_sim.mavlink.uploader import Upload, UploadState
from rover_sim.mavlink.vehicle_control import Trouble, TroubleKind
from rover_sim.mavlink.vehicle_watch import VehicleStatus

AGAIN_S = 2.0  # after a refusal
CERTAIN_S = 1.0  # after an unanswered command a heartbeat tells what became of it
FIRST_ITEM = 1  # home is 0


@dataclass(frozen=True)
class Patience:
    """How long each thing is waited for, in the link's time (seconds)."""

    vehicle_s: float = 30.0
    ready_s: float = 120.0
    armed_s: float = 60.0
    started_s: float = 30.0


@dataclass(frozen=True)
class Wish:
    """What is wanted of the vehicle."""

    handle: PendingCommand  # for who wished it
    mode: Mode | None = None  # None: only to be armed
    upload: Upload | None = None  # that must be on board before
    yaw_rad: float | None = None  # to be held by set points, until another wish
    armed: bool = False  # to be armed before


class Pursuit:
    """Pursues one wish at a time, one command at a time; a person who changes the mode meanwhile ends it."""

    def __init__(self, commander: Commander, patience: Patience) -> None:
        self.trouble: Trouble | None = None
        self.wish: Wish | None = None
        self._rules: AutopilotRules = GENERIC_RULES
        self._commander, self._patience = commander, patience
        self._pending: PendingCommand | None = None
        self._step = ""  # that the pending command is to bring about
        self._since_s: dict[str, float] = {}  # when each step of the wish was first tried
        self._again_s = 0.0
        self._base: int | None = None  # the mode in which the wish found the armed vehicle
        self._sent_mode = Mode.HOLD  # by the pending command
        self._sent_for: Upload | None = None  # the mission whose first item the pending command names
        self._rewound: Upload | None = None  # the mission whose first item is the current one
        self._accepted: tuple[Mode, float] | None = None  # the mode that it took last
        self._armed_s: float | None = None
        self._doubt_s: float | None = None  # when a start was left unanswered: it may be in Auto, or not
        self._paused, self._paused_s = False, 0.0  # holding for a new mission, since then

    def meet(self, rules: AutopilotRules) -> None:
        """The vehicle is there."""
        self._rules = rules

    def want(self, wish: Wish | None, status: VehicleStatus) -> None:
        """Another wish; the one before is given up. A command that is under way still counts."""
        if self.wish is None or wish is None or self.wish.mode is not wish.mode:
            self._since_s, self._again_s = {}, 0.0  # else patience goes on: planners change their minds often
        self._end(CommandState.FAILED)
        self.wish = wish
        mode, armed = self._told(status)
        self._base = mode if armed else None
        self._paused = self._paused and wish is not None and wish.mode is Mode.AUTO

    def seen(self, status: VehicleStatus) -> tuple[int | None, bool]:
        """Mode and arming as they are by now.

        While the vehicle only holds for a new mission its mode is Auto, as it was and will be.
        """
        mode, armed = self._told(status)
        return (int(Mode.AUTO) if self._paused and mode == Mode.HOLD else mode), armed

    def may_upload(self, status: VehicleStatus) -> bool:
        """A mission that is being driven, or about to be, must not be torn."""
        mode, armed = self._told(status)
        starting = self._pending is not None and self._step == "mode" and self._sent_mode is Mode.AUTO
        heard_s = -1.0 if status.heard_s is None else status.heard_s
        doubtful = self._doubt_s is not None and heard_s < self._doubt_s + CERTAIN_S
        return self._rules.atomic or not (starting or doubtful or (armed and mode == Mode.AUTO))

    def tick(self, status: VehicleStatus, waits_for: str, time_s: float) -> None:
        """The next step towards the wish, if the last one is answered."""
        if self._pending is not None and self._pending.state is not CommandState.SENDING:
            self._answered(self._pending, status, time_s)
        if self.wish is None or self._pending is not None or time_s < self._again_s:
            return
        if self._taken(self.wish, status):
            self._end(CommandState.FAILED)
            self._paused = False
        else:
            self._next(self.wish, status, waits_for, time_s)

    def _next(self, wish: Wish, status: VehicleStatus, waits_for: str, time_s: float) -> None:
        mode, armed = self._told(status)
        if wish.upload is not None and wish.upload.state is UploadState.SENDING:
            if not self.may_upload(status):
                self._change_mode("hold", Mode.HOLD, time_s)
            return
        if wish.upload is not None and wish.upload.state is not UploadState.DONE:
            self._give_up(TroubleKind.REFUSED, f"the mission is not on board: {wish.upload.reason}")
        elif waits_for and wish.mode is not Mode.HOLD and not _is_so(wish, mode, armed=armed):
            self._wait(waits_for, status, time_s)
        elif wish.upload is not None and self._rules.resumes and self._rewound is not wish.upload:
            first, self._sent_for = float(FIRST_ITEM - self._rules.first_item), wish.upload
            self._try("rewind", mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, (first,), time_s)
        elif wish.armed and not armed:
            self._try("arm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), time_s)
        elif wish.mode is not None and mode != wish.mode:
            self._change_mode("mode", wish.mode, time_s)
        else:
            wish.handle.state, self._base = CommandState.DONE, mode
            if wish.yaw_rad is None:
                self._end(CommandState.DONE)

    def _told(self, status: VehicleStatus) -> tuple[int | None, bool]:
        """Mode and arming by the last heartbeat, or by an acceptance, which tells sooner than the next one."""
        heard_s = -1.0 if status.heard_s is None else status.heard_s
        mode = status.mode
        if self._accepted is not None and self._accepted[1] >= heard_s:
            mode = int(self._accepted[0])
        return mode, status.armed or (self._armed_s is not None and self._armed_s >= heard_s)

    def _taken(self, wish: Wish, status: VehicleStatus) -> bool:
        """Whether an armed vehicle is in a mode that neither was nor is wanted: a person's, or a fail-safe's."""
        mode, armed = self._told(status)
        if self._paused and any(at_s > self._paused_s and grave <= Severity.ERROR for at_s, grave, _ in status.texts):
            return True  # a fail-safe's hold looks like ours
        if wish.handle.state is CommandState.DONE:
            return mode != wish.mode
        return armed and self._base is not None and mode not in (self._base, Mode.HOLD, wish.mode)

    def _end(self, state: CommandState) -> None:
        """No wish any more."""
        if self.wish is not None and self.wish.handle.state is CommandState.SENDING:
            self.wish.handle.state = state
        self.wish = None

    def _change_mode(self, step: str, mode: Mode, time_s: float) -> None:
        self._sent_mode = mode
        self._try(step, mavlink.MAV_CMD_DO_SET_MODE, self._rules.mode_parameters(mode), time_s)

    def _try(self, step: str, command: int, parameters: tuple[float, ...], time_s: float) -> None:
        self._since_s.setdefault(step, time_s)
        self._step, self._pending = step, self._commander.command(command, *parameters)

    def _answered(self, pending: PendingCommand, status: VehicleStatus, time_s: float) -> None:
        step, self._pending = self._step, None
        if pending.state is CommandState.DONE:
            self._achieved(step, time_s)
            return
        if pending.result is None and step == "mode" and self._sent_mode is Mode.AUTO:
            self._doubt_s = time_s
        self._again_s = time_s + AGAIN_S
        limit_s = self._patience.armed_s if step == "arm" else self._patience.started_s
        if step not in self._since_s or time_s - self._since_s[step] < limit_s:
            return
        kind = TroubleKind.NOT_ARMED if step == "arm" else TroubleKind.NOT_STARTED
        self._give_up(kind, f"{_STEPS[step]}: {self._reason(pending, status, time_s)}")

    def _achieved(self, step: str, time_s: float) -> None:
        self._since_s.pop(step, None)
        if step in ("hold", "mode"):
            self._accepted, self._doubt_s = (self._sent_mode, time_s), None
            self._paused, self._paused_s = step == "hold", time_s
        elif step == "arm":
            self._armed_s = time_s
        else:
            self._rewound = self._sent_for

    def _reason(self, pending: PendingCommand, status: VehicleStatus, time_s: float) -> str:
        said = complaint(status.texts, self._rules, time_s - COMPLAINT_S)
        return said or ("no answer" if pending.result is None else _RESULTS.get(pending.result, "refused"))

    def _wait(self, waits_for: str, status: VehicleStatus, time_s: float) -> None:
        begun_s = self._since_s.setdefault("ready", time_s)
        if time_s - begun_s >= self._patience.ready_s:
            said = complaint(status.texts, self._rules, time_s - COMPLAINT_S)
            lasted = f"not ready within {self._patience.ready_s:g} s: it waits for {waits_for}"
            self._give_up(TroubleKind.NOT_READY, f"{lasted}; it says: {said}" if said else lasted)

    def _give_up(self, kind: TroubleKind, text: str) -> None:
        self.trouble, self._paused = Trouble(kind, text), False
        self._end(CommandState.FAILED)


def _is_so(wish: Wish, mode: int | None, *, armed: bool) -> bool:
    """Whether the vehicle does already what is wished."""
    return wish.mode is not None and mode == wish.mode and (armed or not wish.armed)


_STEPS = {
    "hold": "it does not hold for the new mission",
    "rewind": "it does not take the mission's first item as the current one",
    "arm": "arming refused",
    "mode": "it does not change its mode",
}
_RESULTS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "not now",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "not supported",
    mavlink.MAV_RESULT_FAILED: "failed",
}
