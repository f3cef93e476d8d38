"""The same work on many items over the cores, with a progress bar."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_cores(work: Callable[[T], R], items: Sequence[T], text: str, workers: int) -> list[R]:
    """``work`` on each item, in their order, in up to ``workers`` processes; ``work`` must be importable by name."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)

    def shown(results: Iterable[R]) -> list[R]:
        hidden = len(items) < 2 or not console.is_terminal
        return list(track(results, text, len(items), console=console, disable=hidden, transient=True))

    if min(workers, len(items)) < 2:
        return shown(map(work, items))
    # A forked child would inherit the threads of OpenCV in whatever state they are.
    with ProcessPoolExecutor(
        min(workers, len(items)), mp_context=get_context("spawn"), initializer=_one_thread
    ) as pool:
        return shown(pool.map(work, items))


def _one_thread() -> None:
    import cv2

    cv2.setNumThreads(1)
