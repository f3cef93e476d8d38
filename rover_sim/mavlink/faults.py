"""What a bad link does to frames: loss, delay, jitter, duplicates, wrong order, a slow line; seeded."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np

from rover_sim.errors import InputError

_BITS_PER_BYTE = 10  # of a serial line: start bit, eight bits, stop bit
_FULL_S = 2.0  # that a slow line holds; what does not fit is lost


@dataclass(frozen=True)
class Faults:
    """Faults of one direction of a link; each frame suffers them on its own."""

    loss: float = 0.0  # probability
    delay_s: float = 0.0
    jitter_s: float = 0.0  # added to the delay, evenly from 0 to this
    duplicate: float = 0.0  # probability of arriving twice
    reorder: float = 0.0  # probability of being overtaken by later frames
    rate_baud: float = math.inf


_KEYS = {
    "loss": "loss",
    "delay": "delay_s",
    "jitter": "jitter_s",
    "dup": "duplicate",
    "reorder": "reorder",
    "rate": "rate_baud",
}
_SHARES = ("loss", "dup", "reorder")
ALLOWED = "loss, dup, reorder (0 to 1), delay, jitter (0 to 60 s), rate (300 to 1e9 baud), each as KEY=NUMBER"


def parse_faults(text: str) -> Faults:
    """Faults from ``"loss=0.2,delay=0.3,rate=9600"``; raises InputError with what is allowed."""
    values: dict[str, float] = {}
    for part in text.split(","):
        key, _, number = part.strip().partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        low, high = (0.0, 1.0) if key in _SHARES else (300.0, 1e9) if key == "rate" else (0.0, 60.0)
        if key not in _KEYS or _KEYS[key] in values or not low <= value <= high:
            raise InputError(f"--link {text!r}: {part.strip()!r}; allowed: {ALLOWED}")
        values[_KEYS[key]] = value
    return Faults(**values)


class Lane:
    """One direction of a link: frames go in, and come out when they arrive, those that do."""

    def __init__(self, faults: Faults, rng: np.random.Generator | None) -> None:
        if rng is None and faults != Faults(delay_s=faults.delay_s, rate_baud=faults.rate_baud):
            raise ValueError("a link with random faults needs a random generator")
        self._faults, self._rng = faults, rng
        self._arriving: list[tuple[float, int, bytes]] = []
        self._count = 0
        self._busy_until_s = -math.inf
        self._last_s = -math.inf

    def put(self, frame: bytes, time_s: float) -> None:
        """Send a frame."""
        faults = self._faults
        begin_s = max(time_s, self._busy_until_s)
        if begin_s - time_s > _FULL_S:
            return
        self._busy_until_s = begin_s + _BITS_PER_BYTE * len(frame) / faults.rate_baud
        if self._chance(faults.loss):
            return
        for _ in range(1 + self._chance(faults.duplicate)):
            self._send(frame, self._busy_until_s + faults.delay_s + faults.jitter_s * self._draw())

    def take(self, time_s: float) -> list[bytes]:
        """Frames that have arrived by now, in the order of their arrival."""
        frames = []
        while self._arriving and self._arriving[0][0] <= time_s:
            frames.append(heapq.heappop(self._arriving)[2])
        return frames

    def _send(self, frame: bytes, at_s: float) -> None:
        """Frames keep their order, except for one that falls back by up to as much as the link delays."""
        if self._chance(self._faults.reorder):
            at_s += (self._faults.delay_s + self._faults.jitter_s + 0.05) * self._draw()
        else:
            at_s = self._last_s = max(at_s, self._last_s)
        self._count += 1
        heapq.heappush(self._arriving, (at_s, self._count, frame))

    def _chance(self, probability: float) -> bool:
        return probability > 0.0 and self._draw() < probability

    def _draw(self) -> float:
        return 0.0 if self._rng is None else float(self._rng.random())
