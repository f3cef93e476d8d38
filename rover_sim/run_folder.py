"""The folder that a traverse leaves: its files, each written whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rover_sim.files import write_json, write_text
from rover_sim.report.run_map import MapData, save_run_map
from rover_sim.sights import Sights
from rover_sim.traverse import Traverse
from worlds.scenario import dump_scenario
from worlds.types import FloatArray

TLOG, VIDEO = "telemetry.tlog", "camera.mp4"
FILES = (
    "map.png",
    "camera.png",
    "summary.json",
    "trace.npz",
    "mission.waypoints",
    "mission.plan",
    TLOG,
    "scenario.toml",
    "ruts.npz",  # left out where the scenario says soil.ruts = false
)


def clear(folder: Path) -> None:
    """Remove what an earlier run left, so that no file of it is taken for the new one's.

    For after the links are open, so that a taken port costs nothing; the log that they write to has begun anew.
    """
    for name in (*FILES, VIDEO):
        if name != TLOG:
            (folder / name).unlink(missing_ok=True)


def write(folder: Path, traverse: Traverse, sights: Sights, summary: dict[str, Any]) -> None:
    """Write all but log and video, which were written as they came; the summary first, as it matters most."""
    write_json(folder / "summary.json", summary)
    write_text(folder / "scenario.toml", dump_scenario(traverse.world.scenario))
    traverse.recorder.save(folder / "trace.npz")
    traverse.save_mission(folder / "mission.waypoints", folder / "mission.plan")
    sights.save(folder / "camera.png")
    title = f"{summary['scenario']}, seed {summary['seed']}: {summary['reason']} after {summary['distance_m']:.1f} m"
    ruts = traverse.ruts
    if ruts is not None:
        ruts.save(folder / "ruts.npz")
    data = MapData(
        trace=traverse.recorder.arrays(),
        plans=traverse.onboard.ways_w,
        perceived=_perceived(traverse),
        events=traverse.events,
        title=title,
        ruts=ruts,
        route=traverse.route,
        risky=traverse.risky_ways,
    )
    save_run_map(folder / "map.png", traverse.world, data)


def _perceived(traverse: Traverse) -> FloatArray:
    """Remembered rocks (M, 4): x, y, diameter and one sigma of the place."""
    rocks = traverse.onboard.rocks
    diameter = np.sqrt(rocks.length_m * rocks.width_m)
    return np.column_stack([rocks.centre_w, diameter, rocks.worst_sd_m]).reshape(-1, 4)
