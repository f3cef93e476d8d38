"""Work spread over processes: each has a core to itself, and one that crashes or hangs costs its own task only."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from concurrent.futures import TimeoutError as OutOfTime
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Lost:
    """What became of a task without a result."""

    text: str  # one line
    error: BaseException | None = None  # that the task itself raised


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_processes(
    tasks: Sequence[Callable[[], R]], workers: int, timeout_s: float | None = None
) -> Iterator[tuple[int, R | Lost]]:
    """Place and result of each task as it is done, in ``workers`` spawned processes; tasks must be picklable.

    A task that raises, crashes its process or runs longer than ``timeout_s`` comes back as `Lost`. When the caller
    stops early, by an error or by Ctrl-C, running tasks are ended and the others dropped.
    """
    from multiprocessing import get_context

    from pebble import ProcessExpired, ProcessPool

    with _one_thread_each():
        # A forked child would inherit the threads of OpenCV in whatever state they are.
        pool = ProcessPool(workers, context=get_context("spawn"), initializer=_one_thread)
        try:
            places: dict[Future[R], int] = {
                pool.schedule(task, timeout=timeout_s): place for place, task in enumerate(tasks)
            }
            for done in as_completed(places):
                result: R | Lost
                try:
                    result = done.result()
                except ProcessExpired as error:
                    result = Lost(f"its process died with exit code {error.exitcode}")
                except OutOfTime:
                    result = Lost(f"ended after {timeout_s:g} s of wall time")
                except Exception as error:  # noqa: BLE001 - whatever it was, the other tasks go on
                    result = Lost(f"{type(error).__name__}: {error}".splitlines()[0], error)
                yield places[done], result
        finally:
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()


def run_tasks(tasks: Sequence[Callable[[], R]], workers: int) -> Iterator[tuple[int, R]]:
    """Place and result of each task as it is done; with one worker in this process and in order.

    What a task raises is raised here; a process that dies is a RuntimeError.
    """
    if workers == 1:
        yield from ((place, task()) for place, task in enumerate(tasks))
        return
    for place, result in in_processes(tasks, workers):
        if isinstance(result, Lost):
            raise result.error or RuntimeError(f"task {place}: {result.text}")
        yield place, result


def over_cores(work: Callable[[T], R], items: Sequence[T], text: str, workers: int) -> list[R]:
    """``work`` on each item, in their order, in up to ``workers`` processes, with a progress bar."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    hidden = len(items) < 2 or not console.is_terminal
    done: Iterable[tuple[int, R]] = run_tasks([partial(work, item) for item in items], max(1, min(workers, len(items))))
    results = dict(track(done, text, len(items), console=console, disable=hidden, transient=True))
    return [results[place] for place in range(len(items))]


@contextmanager
def terminable() -> Iterator[None]:
    """A termination signal ends the work as Ctrl-C does."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Numerical libraries of processes started meanwhile stay on one thread."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _one_thread() -> None:
    import cv2

    cv2.setNumThreads(1)
