"""A mission is on board only once it has been read back as it was sent.

ArduPilot cuts its stored mission at the count and overwrites item after item, so what a broken upload leaves is a
torn mission. An upload that fails for a passing reason is tried again; what can only be refused again is not, and
a torn mission that is left over is cleared, so that nobody drives it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum, auto

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.downloader import Download, Downloader
from rover_sim.mavlink.foreign_rules import GENERIC_RULES, AutopilotRules
from rover_sim.mavlink.mission_compare import first_difference
from rover_sim.mavlink.uploader import Upload, Uploader, UploadState
from rover_sim.mavlink.wire import WireItem

UPLOADS = 4  # of one mission, until it counts as failed
PAUSE_S = 2.0  # before another upload: whoever else transfers may end
CLEARS, CLEAR_S = 5, 1.5
_FOR_GOOD = frozenset(
    {
        mavlink.MAV_MISSION_UNSUPPORTED_FRAME,
        mavlink.MAV_MISSION_UNSUPPORTED,
        mavlink.MAV_MISSION_NO_SPACE,
        mavlink.MAV_MISSION_INVALID,
        *range(mavlink.MAV_MISSION_INVALID_PARAM1, mavlink.MAV_MISSION_INVALID_PARAM7 + 1),
    }
)


class _Phase(Enum):
    IDLE = auto()
    SENDING = auto()
    READING = auto()
    PAUSING = auto()
    CHECKING = auto()  # what the vehicle holds, without an upload of ours
    CLEARING = auto()


class VerifiedUploader:
    """Sends one mission at a time and reads it back; of those that wait, only the newest is kept."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self.verified: Upload | None = None  # what the vehicle is known to hold, as given here
        self.replaced = False  # the vehicle has been read holding a mission of somebody else
        self._send, self._rules = send, GENERIC_RULES
        self._uploader, self._downloader = Uploader(send, 0, 0), Downloader(send, 0, 0)
        self._phase = _Phase.IDLE
        self._active: Upload | None = None
        self._waiting: Upload | None = None
        self._wire: list[WireItem] = []
        self._inner: Upload | None = None
        self._reading = Download()
        self._count = self._tries = 0
        self._trouble = ""
        self._since_s = 0.0
        self.handlers: Mapping[str, Callable[[Message, float], None]] = {
            "MISSION_REQUEST_INT": self._uploader.requested,
            "MISSION_REQUEST": self._uploader.requested,
            **self._downloader.handlers,
            "MISSION_ACK": self._acknowledged,
        }

    def meet(self, system: int, component: int, rules: AutopilotRules) -> None:
        """The vehicle is there."""
        self._uploader.target = self._downloader.target = system, component
        self._rules = rules

    @property
    def busy(self) -> bool:
        """Whether anything is being transferred or waits for it."""
        return self._phase is not _Phase.IDLE or self._waiting is not None

    @property
    def waits(self) -> bool:
        """Whether an upload waits for its turn."""
        return self._waiting is not None

    @property
    def vehicle_items(self) -> int:
        """How many items the vehicle counts in the mission sent last, without home."""
        return len(self._wire) - (1 if self._rules.persona.home_first else 0)

    def upload(self, items: Sequence[WireItem]) -> Upload:
        """A mission, home first, to be sent when its turn comes."""
        self._count += 1
        if self._waiting is not None:
            self._waiting.state = UploadState.REPLACED
        self._waiting = Upload(self._count, tuple(items))
        return self._waiting

    def check(self, time_s: float) -> None:
        """Read what the vehicle holds: somebody may have changed it."""
        if not self.busy and self.verified is not None:
            self._read(_Phase.CHECKING, time_s)

    def refuse(self, reason: str) -> None:
        """The waiting upload is not to be sent."""
        if self._waiting is not None:
            self._waiting.state, self._waiting.reason = UploadState.FAILED, reason
        self._waiting = None

    def tick(self, time_s: float, *, may_begin: bool) -> None:
        """Go on with what is under way, and begin what waits where it may begin."""
        self._uploader.tick(time_s)
        self._downloader.tick(time_s)
        match self._phase:
            case _Phase.IDLE if self._waiting is not None and may_begin:
                self._begin(self._waiting, time_s)
            case _Phase.SENDING:
                self._sent(time_s)
            case _Phase.READING | _Phase.CHECKING if self._reading.done or self._reading.reason:
                self._read_back(time_s)
            case _Phase.PAUSING if time_s - self._since_s >= PAUSE_S:
                self._again(time_s)
            case _Phase.CLEARING if time_s - self._since_s >= CLEAR_S:
                self._clear(time_s)

    def _begin(self, upload: Upload, time_s: float) -> None:
        self._active, self._waiting, self._tries, self._trouble = upload, None, 0, ""
        self.verified, self.replaced = None, False
        self._wire = self._rules.wire_items(upload.items)
        refused = next((seq for seq, item in enumerate(self._wire) if item.command in self._rules.unsupported), None)
        if refused is not None:
            upload.refused_item = refused + self._rules.first_item
            self._fail(
                f"item {upload.refused_item}: {self._rules.title} takes no command {self._wire[refused].command}"
            )
        else:
            self._again(time_s)

    def _again(self, time_s: float) -> None:
        self._tries += 1
        self._phase, self._inner = _Phase.SENDING, self._uploader.upload(self._wire, time_s)

    def _sent(self, time_s: float) -> None:
        """Where the result was lost or is doubtful, reading decides."""
        inner = self._inner
        if inner is None or inner.state is UploadState.SENDING:
            return
        if inner.state is UploadState.FAILED and inner.result in _FOR_GOOD:
            self._refused_for_good(inner, time_s)
            return
        self._trouble = inner.reason
        self._read(_Phase.READING, time_s)

    def _refused_for_good(self, inner: Upload, time_s: float) -> None:
        seq, active = inner.refused_item, self._active
        item = "" if seq is None else f"item {seq + self._rules.first_item} (command {self._wire[seq].command}): "
        if active is not None:
            active.result = inner.result
            active.refused_item = None if seq is None else seq + self._rules.first_item
        self._fail(f"{item}{inner.reason}")
        if inner.result != mavlink.MAV_MISSION_NO_SPACE:  # which is said before anything is touched
            self._leave_nothing_torn(time_s)

    def _read(self, phase: _Phase, time_s: float) -> None:
        self._phase, self._reading = phase, self._downloader.start(time_s)

    def _read_back(self, time_s: float) -> None:
        different = self._reading.reason or first_difference(self._wire, self._reading.items, self._rules)
        checking, self._phase = self._phase is _Phase.CHECKING, _Phase.IDLE
        if checking:
            if self._reading.done and different:
                self.verified, self.replaced = None, True
        elif not different:
            self._done()
        elif self._tries < UPLOADS:
            self._phase, self._since_s = _Phase.PAUSING, time_s
        else:
            self._fail(f"not stored in {UPLOADS} uploads: {self._trouble or 'read back ' + different}")
            self._leave_nothing_torn(time_s)

    def _done(self) -> None:
        if self._active is not None:
            self._active.state = UploadState.DONE
            self._active.opaque_id = 0 if self._inner is None else self._inner.opaque_id
        self.verified, self._active = self._active, None

    def _fail(self, reason: str) -> None:
        if self._active is not None:
            self._active.state, self._active.reason = UploadState.FAILED, reason
        self._active, self._phase = None, _Phase.IDLE

    def _leave_nothing_torn(self, time_s: float) -> None:
        if not self._rules.atomic:
            self._phase, self._tries = _Phase.CLEARING, 0
            self._clear(time_s)

    def _clear(self, time_s: float) -> None:
        if self._tries == CLEARS:
            self._phase = _Phase.IDLE
            return
        self._tries, self._since_s = self._tries + 1, time_s
        self._send(mavlink.MAVLink_mission_clear_all_message(*self._uploader.target))

    def _acknowledged(self, message: Message, time_s: float) -> None:
        if self._phase is _Phase.CLEARING and message.type == mavlink.MAV_MISSION_ACCEPTED:
            self._phase = _Phase.IDLE
        elif self._phase is _Phase.SENDING:
            self._uploader.acknowledged(message, time_s)
        else:
            self._downloader.refused(message)
