"""All tests of one campaign: what is to be measured, on how many cores, and what came out."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import TypeVar

from rover_sim.slope.drawbar import IMPOSED_SLIPS, DrawbarPoint, measure_drawbar
from rover_sim.slope.rig import Direction, Setup, SlopePoint, measure_slope
from rover_sim.slope.tilt_table import AXES, TiltPoint, measure_tilt
from rover_sim.slope.turning import RADII_IN_TRACKS, TurnPoint, measure_turn

Point = SlopePoint | TurnPoint | DrawbarPoint | TiltPoint
Task = Callable[[], Point]
P = TypeVar("P", SlopePoint, TurnPoint, DrawbarPoint, TiltPoint)

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Campaign:
    """What the user asked for."""

    soils: tuple[str, ...]
    slopes_deg: tuple[float, ...]
    directions: tuple[Direction, ...]
    gravity_m_s2: float
    rover: str
    load_kg: float
    speed_m_s: float

    def setups(self) -> list[Setup]:
        """The rover on each soil."""
        return [Setup(soil, self.gravity_m_s2, self.rover, self.load_kg, self.speed_m_s) for soil in self.soils]

    def tasks(self) -> list[Task]:
        """Everything to measure, in the order of the results."""
        setups = self.setups()
        tasks: list[Task] = [
            partial(measure_slope, setup, direction, slope_deg)
            for setup in setups
            for direction in self.directions
            for slope_deg in self.slopes_deg
        ]
        tasks += [partial(measure_turn, setup, radius) for setup in setups for radius in RADII_IN_TRACKS]
        tasks += [partial(measure_drawbar, setup, slip) for setup in setups for slip in IMPOSED_SLIPS]
        tasks += [partial(measure_tilt, setups[0], axis) for axis in AXES]
        return tasks


def of_kind(points: Mapping[int, Point], kind: type[P]) -> list[P]:
    """The points of one test, in the order of their tasks."""
    return [point for _, point in sorted(points.items()) if isinstance(point, kind)]


def run_tasks(tasks: Sequence[Task], workers: int) -> Iterator[tuple[int, Point]]:
    """Place and result of each task as it is done; with one worker in this process and in order.

    When the caller stops early, by an error or by Ctrl-C, tasks that have not begun are dropped.
    """
    if workers == 1:
        yield from ((place, task()) for place, task in enumerate(tasks))
        return
    with _one_thread_each():
        pool = ProcessPoolExecutor(workers, get_context("spawn"))
        try:
            with _deaf_to_interrupts():  # inherited by the workers, which the first task starts
                places: dict[Future[Point], int] = {pool.submit(task): place for place, task in enumerate(tasks)}
            for done in as_completed(places):
                yield places[done], done.result()
        finally:
            pool.shutdown(cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Numerical libraries of the workers stay on one thread; each has its core."""
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


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes started meanwhile leave Ctrl-C to this one, which stops them in order."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
