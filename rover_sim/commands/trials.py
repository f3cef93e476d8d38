"""``rover-sim trials``: many traverses over a grid of conditions, with their table and report."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_sim.arguments import worker_count

if TYPE_CHECKING:
    from rover_sim.trials.drive import Keep
    from rover_sim.trials.trial import Row, Trial, Value

MOST_SEEDS = 100_000
WALL_LIMIT_S = 900.0  # of one trial; a traverse takes seconds, on a loaded machine a minute or two ...
SLOWEST_FACTOR = 0.5  # ... and a long one is given up when it takes twice its simulated time
REPORT_EVERY_S = 30.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "suite",
        nargs="?",
        default="nav",
        help="nav, obstacle-course, route, or a scenario's name or path (default: nav)",
    )
    parser.add_argument(
        "--seeds", type=_seeds, default=range(10), metavar="N", help="seeds 0 to N - 1, or FIRST:END (default: 10)"
    )
    parser.add_argument(
        "--cells",
        type=_cells,
        action="append",
        default=[],
        metavar="NAME=VALUES",
        help="only these, e.g. cfa=0.05,0.1 or world=0:200:6; repeatable, one dimension each",
    )
    parser.add_argument(
        "--worlds",
        type=Path,
        metavar="DIR",
        help="folder of barn_*.npz, for obstacle-course, or of a real map, for route",
    )
    parser.add_argument("--workers", type=worker_count, default=0, metavar="N", help="processes (default: one a core)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: trials/SUITE")
    parser.add_argument(
        "--resume", action="store_true", help="go on: trials that are in the table are not driven again"
    )
    parser.add_argument(
        "--keep", choices=("failures", "all", "none"), default="failures", help="run folders (default: failures)"
    )


def _seeds(text: str) -> range:
    """Seeds from N or FIRST:END."""
    words = text.split(":")
    if len(words) > 2 or not all(word.isdecimal() for word in words):
        raise argparse.ArgumentTypeError(f"{text!r}: give a number of seeds as in 20, or FIRST:END as in 100:120")
    seeds = range(*(int(word) for word in words))
    if not 1 <= len(seeds) <= MOST_SEEDS or seeds[-1] >= 2**32:
        raise argparse.ArgumentTypeError(f"{text!r}: allowed are 1 to {MOST_SEEDS} seeds below 2^32")
    return seeds


def _cells(text: str) -> tuple[str, tuple[Value, ...]]:
    """One dimension and its values: NAME=V,V... or NAME=FIRST:END:STEP in whole numbers, END excluded."""
    name, _, values = text.partition("=")
    span = values.split(":")
    wrong = argparse.ArgumentTypeError(f"{text!r}: give NAME=VALUE,VALUE as in cfa=0.05,0.1, or NAME=FIRST:END:STEP")
    if not name or not values:
        raise wrong
    if len(span) == 1:
        return name, tuple(_value(word) for word in values.split(","))
    if len(span) > 3 or not all(word.isdecimal() for word in span) or (len(span) == 3 and int(span[2]) == 0):
        raise wrong
    found = tuple(float(number) for number in range(*(int(word) for word in span)))
    if not found:
        raise wrong
    return name, found


def _value(word: str) -> Value:
    try:
        return float(word)
    except ValueError:
        return word


def execute(args: argparse.Namespace) -> int:
    """Drive all; 0 once every trial has its row, however it ended, as the report says how."""
    from rover_sim.files import output_folder
    from rover_sim.parallel import cores, terminable
    from rover_sim.report import trials_report
    from rover_sim.trials.store import open_store
    from rover_sim.trials.suites import trials_of

    trials = trials_of(args.suite, dict(args.cells), args.seeds, args.worlds)
    folder = output_folder(args.out or Path("trials") / Path(args.suite).stem)
    with open_store(folder, resume=args.resume) as store:
        done = {row.key for row in store.rows() if row.error is None}
        left = [trial for trial in trials if trial.key not in done]
        if len(left) < len(trials):
            print(f"rover-sim trials: {len(trials) - len(left)} of {len(trials)} are done", file=sys.stderr)  # noqa: T201
        planned = len({row.key for row in store.rows()} | {trial.key for trial in trials})
        workers = min(args.workers or cores(), max(len(left), 1))
        try:
            with terminable(), _progress_bar(len(trials), store.rows()) as show:
                written_s = time.monotonic()
                for row in _driven(left, folder, args.keep, workers):
                    store.add(row)
                    show(row)
                    if time.monotonic() - written_s > REPORT_EVERY_S:
                        trials_report.write(folder, store.rows(), planned)
                        written_s = time.monotonic()
        finally:
            _sweep(folder)
            if rows := store.rows():
                _print_report(trials_report.write(folder, rows, planned), folder)
    return 0


def _driven(trials: Sequence[Trial], folder: Path, keep: Keep, workers: int) -> Iterator[Row]:
    """The row of each trial as it is done."""
    from rover_sim.parallel import Lost, in_processes
    from rover_sim.trials.drive import drive, lost

    tasks = [partial(drive, trial, folder, keep) for trial in trials]
    longest_s = max((trial.scenario.goal.time_limit_s for trial in trials), default=0.0)
    for place, result in in_processes(tasks, workers, max(WALL_LIMIT_S, longest_s / SLOWEST_FACTOR)):
        yield lost(trials[place], result.text) if isinstance(result, Lost) else result


def _sweep(folder: Path) -> None:
    """Remove what trials that were ended in mid-drive have left."""
    import shutil

    from rover_sim.trials.drive import SCRATCH

    for scratch in folder.glob(f"{SCRATCH}*"):
        shutil.rmtree(scratch, ignore_errors=True)


@contextmanager
def _progress_bar(total: int, done: Sequence[Row]) -> Iterator[Callable[[Row], None]]:
    """Bar over the trials, with the success rate so far and how the last one ended."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("trials"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[last]}"),
    )
    ended = [row.success for row in done if row.error is None]
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("trials", total=total, completed=len(ended), rate="", last="starting")

        def show(row: Row) -> None:
            ended.append(row.success)
            rate = f"success {100 * sum(ended) / len(ended):.1f} %"
            progress.update(task, advance=1, rate=rate, last=f"{row.key}: {row.reason}")

        yield show


def _print_report(report: dict[str, Any], folder: Path) -> None:
    """A line a cell, the total, and where the files are."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    names = " x ".join(report["cells"][0]["cell"])
    table = Table(names, "success", "95 %", "unsafe", "SPL", "detour", "score", "reasons", box=SIMPLE)
    for cell in [*report["cells"], {"cell": {"": "all"}, **report["total"]}]:
        name = " ".join(f"{value}" for value in cell["cell"].values())
        interval = f"{100 * cell['wilson_low']:.1f} to {100 * cell['wilson_high']:.1f} %"
        means = [
            f"{cell['means'][key]:.3f}" if key in cell["means"] else "" for key in ("spl", "path_inefficiency", "score")
        ]
        reasons = ", ".join(f"{reason} {count}" for reason, count in cell["reasons"].items())
        success = f"{cell['successes']} of {cell['n']}"
        table.add_row(name, success, interval, str(cell["safety_violations"]), *means, reasons)
    console = Console()
    console.print(table)
    console.print(f"{folder}: report.html, report.json, results.sqlite", soft_wrap=True, highlight=False)
