"""What a slope campaign found, as tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.box import SIMPLE
from rich.table import Table

from rover_sim.slope.campaign import Point, of_kind
from rover_sim.slope.drawbar import DrawbarPoint
from rover_sim.slope.rig import SlopePoint
from rover_sim.slope.tilt_table import TiltPoint
from rover_sim.slope.turning import TurnPoint

_VERDICTS = {True: "inside", False: "[red]outside[/red]", None: ""}


def tables(points: Mapping[int, Point]) -> Iterator[Table]:
    """A table for each test that has points."""
    rows = of_kind(points, SlopePoint)
    for soil in dict.fromkeys(row.soil for row in rows):
        yield _slopes([row for row in rows if row.soil == soil])
    if turns := of_kind(points, TurnPoint):
        yield _turns(turns)
    if pulls := of_kind(points, DrawbarPoint):
        yield _pulls(pulls)
    if tilts := of_kind(points, TiltPoint):
        yield _tilts(tilts)


def verdict(points: Mapping[int, Point]) -> str:
    """How many points with a published band lie inside it, and which do not."""
    judged = [row for row in of_kind(points, SlopePoint) if row.inside is not None]
    outside = [f"{row.soil} {row.slope_deg:g} deg" for row in judged if not row.inside]
    text = f"{len(judged) - len(outside)} of {len(judged)} points with a published band inside it"
    return f"{text}; outside: {', '.join(outside)}" if outside else text


def _slopes(rows: list[SlopePoint]) -> Table:
    """A line a slope: up with its band, then down and across."""
    columns = ("slope", "slip up", "band", "", "sinkage", "slip down", "side slip")
    table = _table(rows[0].soil, columns, left=("band", ""))
    for slope_deg in sorted({row.slope_deg for row in rows}):
        ways = {row.direction: row for row in rows if row.slope_deg == slope_deg}
        down, across = ways.get("down"), ways.get("across")
        last = (f"{down.slip:.3f}" if down else "", f"{across.slip_angle_deg:.1f} deg" if across else "")
        table.add_row(f"{slope_deg:g} deg", *_climb(ways.get("up")), *last)
    return table


def _climb(row: SlopePoint | None) -> tuple[str, ...]:
    """Slip, band, verdict and sinkage of a climb."""
    if row is None:
        return ("",) * 4
    band = f"{row.band[0]:.2f} to {row.band[1]:.2f}" if row.band else ""
    state = "embeds" if row.embedded else "stalls" if row.stalled else ""
    notes = ", ".join(filter(None, (_VERDICTS[row.inside], state)))
    slip = f"{row.slip:.3f}" if row.slip <= 1.01 else "slides"
    return slip, band, notes, f"{1e3 * row.sinkage_m:.1f} mm"


def _table(title: str, columns: Sequence[str], left: Sequence[str]) -> Table:
    table = Table(title=title, box=SIMPLE, title_justify="left", title_style="bold", pad_edge=False)
    for name in columns:
        table.add_column(name, justify="left" if name in left else "right")
    return table


def _turns(rows: list[TurnPoint]) -> Table:
    table = _table(
        "turns on level ground",
        ("soil", "path radius, m", "track ratio", "power, W", "drift, three turns, m"),
        left=("soil",),
    )
    for row in rows:
        radius = "stuck" if row.radius_m is None else f"{row.radius_m:.2f}"
        ratio = "" if row.track_ratio is None else f"{row.track_ratio:.3f}"
        table.add_row(
            row.soil, radius, ratio, f"{row.power_W:.0f}", "" if row.drift_m is None else f"{row.drift_m:.3f}"
        )
    return table


def _pulls(rows: list[DrawbarPoint]) -> Table:
    table = _table(
        "largest drawbar pull on level ground", ("soil", "pull / weight", "pull, N", "at slip"), left=("soil",)
    )
    for soil in dict.fromkeys(row.soil for row in rows):
        best = max((row for row in rows if row.soil == soil), key=lambda row: row.pull_N)
        table.add_row(soil, f"{best.pull_per_weight:.3f}", f"{best.pull_N:.0f}", f"{best.slip:.2f}")
    return table


def _tilts(rows: list[TiltPoint]) -> Table:
    table = _table(
        "tilt table",
        ("over", "analytic", "wheels lift", "error", "force-angle alarm"),
        left=("over",),
    )
    for row in rows:
        values = (row.tip_deg, row.error_deg, row.margin_zero_deg)
        table.add_row(
            row.axis, f"{row.analytic_deg:.2f} deg", *("never" if v is None else f"{v:.2f} deg" for v in values)
        )
    return table
