"""The wall clock: the only place that reads it or waits for it."""

from __future__ import annotations

import select
import time
from array import array


def unix_time_s() -> float:
    """Seconds since 1970: message signing goes by it, since both sides must."""
    return time.time()


def wait_for_news(handles: tuple[int, ...], seconds: float) -> float:
    """Wait until one of some files has news, at most so long; the seconds passed."""
    start = time.perf_counter()
    select.select(handles, [], [], max(0.0, seconds))
    return time.perf_counter() - start


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


class RealTime:
    """Keeps a simulation at the pace of the wall clock; what it falls behind by more than a moment is given up."""

    def __init__(self, forgiven_s: float = 0.25) -> None:
        self._clock = WallClock()
        self._forgiven_s = forgiven_s
        self._behind_s = 0.0

    @property
    def factor(self) -> float:
        """Simulated seconds in a second of wall time, since the start."""
        elapsed_s = self._clock.elapsed_s()
        return (elapsed_s - self._behind_s) / elapsed_s if elapsed_s > 0.0 else 1.0

    def left_s(self, time_s: float) -> float:
        """Seconds until it is ``time_s`` after the start, less what was given up; not above 0 once it is."""
        late_s = self._clock.elapsed_s() - self._behind_s - time_s
        if late_s > self._forgiven_s:
            self._behind_s += late_s
        return -late_s


class Pace:
    """Keeps steps to the lengths of wall time that each is given; being late by more than a moment is given up."""

    def __init__(self, forgiven_s: float) -> None:
        self._due_s = time.perf_counter()
        self._forgiven_s = forgiven_s

    def left_s(self, length_s: float) -> float:
        """Seconds left of the step that is over now, of so many that it is to take; not above 0 where it was late."""
        now_s = time.perf_counter()
        self._due_s += length_s
        if now_s - self._due_s > self._forgiven_s:
            self._due_s = now_s
        return self._due_s - now_s


class Beat:
    """How steadily something happens that should happen at even intervals of wall time."""

    def __init__(self) -> None:
        self._intervals_s = array("d")
        self._last_s: float | None = None

    def tick(self) -> None:
        """It happens."""
        now_s = time.perf_counter()
        if self._last_s is not None:
            self._intervals_s.append(now_s - self._last_s)
        self._last_s = now_s

    def pause(self) -> None:
        """The time until the next tick is none of the intervals."""
        self._last_s = None

    def figures(self) -> dict[str, float] | None:
        """Rate (Hz), and of the intervals the median, the 99th of 100 and the longest (ms); None before two ticks."""
        if not self._intervals_s:
            return None
        ordered = sorted(self._intervals_s)
        count = len(ordered)
        return {
            "rate_hz": round(count / sum(ordered), 2),
            "median_ms": round(1e3 * ordered[count // 2], 3),
            "p99_ms": round(1e3 * ordered[min(count - 1, 99 * count // 100)], 3),
            "longest_ms": round(1e3 * ordered[-1], 3),
        }
