"""A link inside the process, on the simulation clock, with seeded faults where wanted."""

from __future__ import annotations

import numpy as np

from rover_sim.mavlink.faults import Faults, Lane

_PEER = "memory"


class MemoryEnd:
    """One end of a memory link: what it sends arrives at the other end."""

    is_stream = False

    def __init__(self, inbound: Lane) -> None:
        self._inbound = inbound
        self.other: MemoryEnd | None = None

    def peers(self, time_s: float) -> tuple[str, ...]:  # noqa: ARG002  (the interface passes the time)
        """The other end, until it is closed."""
        return (_PEER,) if self.other is not None else ()

    def send(self, frame: bytes, peer: str, time_s: float) -> None:  # noqa: ARG002
        """Put the frame on its way."""
        if self.other is not None:
            self.other._inbound.put(frame, time_s)  # noqa: SLF001  (its own twin)

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        """Frames that have arrived by now."""
        return [(_PEER, frame) for frame in self._inbound.take(time_s)]

    def handles(self) -> tuple[int, ...]:
        """None."""
        return ()

    def close(self) -> None:
        """Cut the link for both ends."""
        if self.other is not None:
            self.other.other = None
            self.other = None


def memory_link(faults: Faults | None = None, rng: np.random.Generator | None = None) -> tuple[MemoryEnd, MemoryEnd]:
    """Both ends of a new link; random faults need the generator that draws them."""
    faults = faults or Faults()
    one, other = MemoryEnd(Lane(faults, rng)), MemoryEnd(Lane(faults, rng))
    one.other, other.other = other, one
    return one, other
