"""The wall clock: the only place that reads it or waits for it."""

from __future__ import annotations

import time


class WallClock:
    """Seconds since it was made."""

    def __init__(self) -> None:
        self._start = time.perf_counter()

    def elapsed_s(self) -> float:
        """Seconds of wall time since the start."""
        return time.perf_counter() - self._start

    def wait_until(self, elapsed_s: float) -> None:
        """Sleep until ``elapsed_s`` has passed; returns at once when it has."""
        remaining = elapsed_s - self.elapsed_s()
        if remaining > 0:
            time.sleep(remaining)
