"""What sessions under an autopilot outside have in common, whichever it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rover_sim.hil.outputs import OutputDriver
from rover_sim.onboard import Sight
from rover_sim.outcome import Reason
from rover_sim.traverse import Status, Traverse

End = tuple[Reason, str]


@dataclass(frozen=True)
class Driven:
    """A traverse whose wheels turn as they are told from outside."""

    traverse: Traverse
    outputs: OutputDriver


@dataclass(frozen=True)
class Watchers:
    """Who hears of a session as it goes."""

    show: Callable[[Status], None] = lambda _: None
    stopped: Callable[[], bool] = lambda: False
    on_sight: Callable[[Sight], None] = lambda _: None
    say: Callable[[str], None] = lambda _: None  # a line that the user should read


NOBODY = Watchers()
