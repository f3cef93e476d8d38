"""What commands that drive a traverse show: a progress bar, and a table at the end."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planner.route_following import Following
    from rover_sim.traverse import Status
    from worlds.scenario import Scenario

TABLE = {
    "reason": "reason",
    "detail": "",
    "sim_time_s": "simulated time, s",
    "wall_time_s": "wall time, s",
    "real_time_factor": "real-time factor",
    "distance_m": "distance driven, m",
    "straight_line_m": "straight line, m",
    "goal_distance_m": "left to the goal, m",
    "collisions": "collisions",
    "max_tilt_deg": "largest tilt, deg",
    "mean_slip": "mean slip ratio",
    "max_sinkage_m": "largest sinkage, m",
    "energy_J": "energy, J",
    "frames": "pictures",
    "missions_sent": "missions sent",
    "waypoints_sent": "waypoints sent",
    "ttam": "TTAM of the terrain classes, %",
}


def expected_s(scenario: Scenario) -> float:
    """About how long the traverse takes at half a metre a second."""
    goal, start = scenario.goal.position_m, scenario.rover.start_m
    return 2.0 * math.hypot(goal[0] - start[0], goal[1] - start[1])


@contextmanager
def progress_bar(name: str, seed: int) -> Iterator[Callable[[Status], None]]:
    """Bar over the way to the goal, with simulated time, distance left, slip and what the rover does."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[numbers]}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(f"{name} seed {seed}", total=1.0, numbers="building the world")

        def show(status: Status) -> None:
            text = (
                f"t {status.time_s:5.1f} s  goal {status.goal_distance_m:5.1f} m  "
                f"slip {100 * status.slip:3.0f} %  {status.doing}"
                + (f"  [red]{status.faults}[/red]" if status.faults else "")
            )
            progress.update(task, completed=status.share_done, numbers=text)

        yield show


def print_plan(route: Following | None) -> None:
    """The legs of a route with what is forecast of each, before it is driven; nothing without a forecast.

    The distance off a leg is the one that 95 % of the rollouts keep to.
    """
    from rich.console import Console
    from rich.table import Table

    from planner.route_following import least_risky
    from planner.route_risk import in_words

    risk = None if route is None else least_risky(route)
    if route is None or risk is None or route.risk_model is None:
        return
    limit = route.risk_model.limit
    allowed = "no limit" if limit is None else f"limit {100 * limit:.0f} %"
    what = f"the route {in_words(risk)}; {allowed}" if route.route.refusal is None else f"refused: {route.route.reason}"
    names = "leg", "to, m", "length, m", "fails", "rolls over", "sticks", "off it, m", ""
    table = Table(*names, title="Plan", box=None, padding=(0, 2, 0, 0))
    for number, (way, leg) in enumerate(zip(risk.ways_w, risk.legs, strict=True)):
        chances = [f"{100 * chance.probability:.0f} %" for chance in (leg.fails, leg.rollover, leg.immobilised)]
        mark = "riskiest" if number == risk.riskiest and leg.fails.probability > 0.0 else ""
        length_m = math.dist(*way)
        place = f"({way[1][0]:.1f}, {way[1][1]:.1f})"
        table.add_row(f"{number + 1}", place, f"{length_m:.1f}", *chances, f"{leg.lateral_p95_m:.2f}", mark)
    console = Console()
    console.print(table)
    console.print(what, highlight=False)


def print_summary(summary: dict[str, Any], folder: Path) -> None:
    """Table of the figures, then where the files are."""
    from rich.console import Console
    from rich.table import Table

    title = "goal reached" if summary["success"] else "goal not reached"
    table = Table(title=f"{summary['scenario']} seed {summary['seed']}: {title}", show_header=False)
    for key, label in TABLE.items():
        value = summary[key]
        if value not in (None, ""):
            table.add_row(label, f"{value:.3f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value))
    counts = [f"{kind.replace('_', ' ')} {count}" for kind, count in summary["event_counts"].items() if count]
    table.add_row("mobility events", ", ".join(counts) or "none")
    for fault in summary["faults"]["events"]:
        over = "to the end" if fault["over_s"] is None else f"to {fault['over_s']:g} s"
        when = f"from {fault['time_s']:g} s {over}" if fault["happened"] else "did not happen"
        table.add_row("fault", f"{fault['fault']}, {when}")
    if (risk := summary["risk"]) is not None:
        limit = "no limit" if risk["limit"] is None else f"limit {100 * risk['limit']:.0f} %"
        table.add_row("risk of failure, forecast", f"{100 * risk['route']['fails']:.0f} %, {limit}")
    console = Console()
    console.print(table)
    left = ", ".join(sorted(path.name for path in folder.iterdir()))
    console.print(f"{folder}: {left}", soft_wrap=True)
