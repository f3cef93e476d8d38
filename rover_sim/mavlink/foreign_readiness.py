"""Whether a foreign autopilot is ready to drive by itself, and what it is waiting for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.foreign_rules import POSITION_KNOWN, AutopilotRules

STEADY_S = 1.0  # that it must have been ready for
TELLS_S = 5.0  # after which an estimator that has told nothing is one that never does
COMPLAINT_S = 20.0  # after which a text says nothing any more
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK


class Readiness:
    """Hears what an autopilot says of its estimator and its pre-arm checks."""

    def __init__(self) -> None:
        self._flags: int | None = None
        self._prearm: bool | None = None
        self._placed = False
        self._met_s = self._good_since_s = self._time_s = 0.0
        self._good = False
        self._rules: AutopilotRules | None = None
        self.handlers: Mapping[str, Callable[[Message], None]] = {
            "EKF_STATUS_REPORT": self._estimator,
            "ESTIMATOR_STATUS": self._estimator,
            "SYS_STATUS": self._status,
            "GLOBAL_POSITION_INT": self._position,
        }

    def meet(self, rules: AutopilotRules, time_s: float) -> None:
        """The vehicle is there."""
        self._rules, self._met_s = rules, time_s

    def refused(self) -> None:
        """The vehicle has said that it does not tell of its estimator."""
        self._met_s = -inf

    def look(self, time_s: float) -> None:
        """Time goes on; to be called after the messages."""
        good = not self._lacks(time_s)
        if good and not self._good:
            self._good_since_s = time_s
        self._good, self._time_s = good, time_s

    @property
    def waits_for(self) -> str:
        """What is still missing, in words; empty if the vehicle is ready."""
        lacks = self._lacks(self._time_s)
        if lacks or self._time_s - self._good_since_s >= STEADY_S:
            return lacks
        return "a second of steady readiness"

    def _lacks(self, time_s: float) -> str:
        if self._rules is None:
            return "a heartbeat"
        if self._flags is not None and not self._flags & POSITION_KNOWN:
            return f"a position (estimator flags {self._flags})"
        if self._flags is None and time_s - self._met_s < TELLS_S:
            return "the state of its estimator"
        return self._lacks_more(self._rules)

    def _lacks_more(self, rules: AutopilotRules) -> str:
        """What is missing beside the estimator's word, or in its place."""
        counts = rules.prearm_counts or self._flags is None
        if counts and self._prearm is False:
            return "its pre-arm checks"
        if self._flags is None and self._prearm is None and not self._placed:
            return "a word about its position (EKF_STATUS_REPORT, ESTIMATOR_STATUS, SYS_STATUS, GLOBAL_POSITION_INT)"
        return ""

    def _estimator(self, message: Message) -> None:
        self._flags = message.flags

    def _status(self, message: Message) -> None:
        if message.onboard_control_sensors_enabled & _PREARM:
            self._prearm = bool(message.onboard_control_sensors_health & _PREARM)

    def _position(self, message: Message) -> None:
        self._placed = self._placed or bool(message.lat or message.lon)


def complaint(texts: tuple[tuple[float, int, str], ...], rules: AutopilotRules, since_s: float) -> str:
    """The last text since then that says why the vehicle is not ready; empty if there is none."""
    said = [text for at_s, _, text in texts if at_s >= since_s and text.startswith(rules.complaints)]
    return said[-1] if said else ""
