"""A link inside the process, on the simulation clock, with seeded loss and delay where wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_PEER = "memory"


@dataclass(frozen=True)
class Faults:
    """What a link does to its frames; each frame is lost or delayed on its own, in order."""

    loss: float = 0.0  # probability
    delay_s: float = 0.0


class MemoryEnd:
    """One end of a memory link: what it sends arrives at the other end."""

    is_stream = False

    def __init__(self, faults: Faults, rng: np.random.Generator | None) -> None:
        self._faults = faults
        self._rng = rng
        self._arriving: list[tuple[float, bytes]] = []
        self.other: MemoryEnd | None = None

    def peers(self, time_s: float) -> tuple[str, ...]:  # noqa: ARG002  (the interface passes the time)
        """The other end, until it is closed."""
        return (_PEER,) if self.other is not None else ()

    def send(self, frame: bytes, peer: str, time_s: float) -> None:  # noqa: ARG002
        """Put the frame on its way."""
        lost = self._rng is not None and self._rng.random() < self._faults.loss
        if self.other is not None and not lost:
            self.other._arriving.append((time_s + self._faults.delay_s, frame))  # noqa: SLF001  (its own twin)

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        """Frames that have arrived by now."""
        due = [frame for at, frame in self._arriving if at <= time_s]
        self._arriving = [(at, frame) for at, frame in self._arriving if at > time_s]
        return [(_PEER, frame) for frame in due]

    def close(self) -> None:
        """Cut the link for both ends."""
        if self.other is not None:
            self.other.other = None
            self.other = None


def memory_link(faults: Faults | None = None, rng: np.random.Generator | None = None) -> tuple[MemoryEnd, MemoryEnd]:
    """Both ends of a new link; a lossy one needs the generator that draws its losses."""
    faults = faults or Faults()
    if faults.loss > 0.0 and rng is None:
        raise ValueError("a lossy link needs a random generator")
    one, other = MemoryEnd(faults, rng), MemoryEnd(faults, rng)
    one.other, other.other = other, one
    return one, other
