"""Ctrl-C and termination as a wish that a long command looks at, so that it can finish its files."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def stop_flag(*, hang_up: bool = False) -> Iterator[Callable[[], bool]]:
    """Function that says whether Ctrl-C or a termination signal came; a second Ctrl-C interrupts at once.

    With ``hang_up`` a terminal that is closed counts too.
    """
    seen: list[int] = []

    def note(number: int, _: object) -> None:
        seen.append(number)
        signal.signal(signal.SIGINT, signal.default_int_handler)

    watched = (signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hang_up else []))
    before = {number: signal.signal(number, note) for number in watched}
    try:
        yield lambda: bool(seen)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
