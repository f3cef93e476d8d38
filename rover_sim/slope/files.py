"""``slope.csv`` and ``slope.json``: written anew, whole, with every point that is done."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from rover_sim import __version__
from rover_sim.files import write_json, write_text
from rover_sim.slope.bands import SLIP_ANGLE_CURVES, SLIP_CURVES
from rover_sim.slope.campaign import Campaign, Point, of_kind
from rover_sim.slope.drawbar import DrawbarPoint
from rover_sim.slope.rig import SlopePoint
from rover_sim.slope.tilt_table import TiltPoint
from rover_sim.slope.turning import TurnPoint

CSV, JSON, PNG = "slope.csv", "slope.json", "slope.png"


def clear(folder: Path) -> None:
    """Remove what an earlier campaign left, so that nothing old is taken for new."""
    for name in (CSV, JSON, PNG):
        (folder / name).unlink(missing_ok=True)


def write(folder: Path, campaign: Campaign, points: Mapping[int, Point], *, complete: bool) -> None:
    """Write both files; each is whole at any moment."""
    write_text(folder / CSV, _table(of_kind(points, SlopePoint)))
    write_json(folder / JSON, report(campaign, points, complete=complete))


def report(campaign: Campaign, points: Mapping[int, Point], *, complete: bool) -> dict[str, Any]:
    """The content of ``slope.json``."""
    return {
        "version": __version__,
        "complete": complete,
        "speed_m_s": campaign.speed_m_s,
        "load_kg": campaign.load_kg,
        "rows": [asdict(point) for point in of_kind(points, SlopePoint)],
        "turning": [asdict(point) for point in of_kind(points, TurnPoint)],
        "drawbar": [asdict(point) for point in of_kind(points, DrawbarPoint)],
        "tilt_table": [asdict(point) for point in of_kind(points, TiltPoint)],
        "published": [
            {"curve": curve.label, "soil": curve.soil, "source": curve.source, "confidence": curve.confidence}
            for curve in (*SLIP_CURVES, *SLIP_ANGLE_CURVES)
        ],
    }


def _table(rows: list[SlopePoint]) -> str:
    """The rows as CSV; the two ends of the band are two columns, what does not exist is empty."""
    names = [name.name for name in fields(SlopePoint) if name.name != "band"]
    columns = [*names[:-1], "band_low", "band_high", names[-1]]
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        low, high = row.band or (None, None)
        cells = {**asdict(row), "band_low": low, "band_high": high}
        del cells["band"]
        writer.writerow({name: _cell(value) for name, value in cells.items()})
    return text.getvalue()


def _cell(value: Any) -> Any:
    """True and false as in JSON."""
    return str(value).lower() if isinstance(value, bool) else value
