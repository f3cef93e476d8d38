"""The world that a run has left behind: its scenario, its seed and the ruts that it drove."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from rover_sim.errors import InputError
from rover_sim.sim.ruts import SavedRuts, load_ruts


@dataclass(frozen=True)
class RunWorld:
    """What a run folder says of its world."""

    scenario: Path
    seed: int
    ruts: SavedRuts | None  # None where the ground did not deform


def is_run(folder: str) -> bool:
    """Whether a scenario was given as the folder of a run."""
    return (Path(folder) / "scenario.toml").is_file()


def read_run(folder: Path) -> RunWorld:
    """The world of a run; raises `InputError` for a folder that lacks its summary or holds broken files."""
    summary, ruts = folder / "summary.json", folder / "ruts.npz"
    try:
        seed = json.loads(summary.read_text(encoding="utf-8"))["seed"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{summary}: the seed of the run cannot be read: {error}") from error
    if not ruts.is_file():
        return RunWorld(folder / "scenario.toml", int(seed), None)
    try:
        return RunWorld(folder / "scenario.toml", int(seed), load_ruts(ruts))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{ruts}: no ruts of a run: {error}") from error
