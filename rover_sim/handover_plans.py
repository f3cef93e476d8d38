"""Plans to hand over: the mission of a run, of a file, the path through a picture, or the first plan in a scenario."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_sim.errors import InputError
from rover_sim.mavlink.geodesy import LocalFrame, yaw_rad
from rover_sim.mavlink.mission_file import read_plan, read_waypoints, write_plan, write_waypoints
from rover_sim.mavlink.plan_items import CRUISE_M_S, mission_items, risky_speed
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from worlds.scenario import Origin
from worlds.types import FloatArray

ENDINGS = (".plan", ".waypoints")


@dataclass(frozen=True)
class Spot:
    """Where the rover stands on Earth, and where it looks."""

    latitude_deg: float
    longitude_deg: float
    heading_deg: float = 0.0  # compass


@dataclass(frozen=True)
class HandoverPlan:
    """A mission, home first, and where it comes from."""

    items: tuple[WireItem, ...]
    source: str

    @property
    def places(self) -> tuple[WireItem, ...]:
        """The waypoints after home."""
        return tuple(item for item in self.items[1:] if item.command == WAYPOINT)


def plan_of_file(path: Path) -> HandoverPlan:
    """The mission of a ground station's file; raises InputError for one that cannot be read or leads nowhere."""
    if path.suffix not in ENDINGS:
        raise InputError(f"{path}: allowed: a file that ends in {' or '.join(ENDINGS)}")
    items = read_plan(path) if path.suffix == ".plan" else read_waypoints(path)
    return _checked(HandoverPlan(tuple(items), str(path)))


def plan_of_run(folder: Path) -> HandoverPlan:
    """The last mission of a run's folder."""
    found = [path for ending in ENDINGS if (path := folder / f"mission{ending}").is_file()]
    if not found:
        raise InputError(f"--run {folder}: no mission.plan and no mission.waypoints; allowed: the folder of a run")
    return plan_of_file(found[0])


@dataclass(frozen=True, eq=False)
class SeenWay:
    """A way as it is seen from the rover, to be laid on Earth once it is known where that stands."""

    points_b: FloatArray  # (N, 2) ahead, to the left
    speed_m_s: float
    source: str

    def at(self, spot: Spot) -> HandoverPlan:
        """The mission of a rover that stands at ``spot``."""
        return placed(self.points_b, spot, self.speed_m_s, self.source)


def way_of_picture(path: Path, number: int | None, speed_m_s: float | None) -> SeenWay:
    """One of the paths that ``perceive`` found.

    Without a number it is the best one that was verified, if any was driven, or the most traversable one.
    """
    paths, best = _picture_paths(path)
    chosen = best if number is None else number
    if chosen is None:
        raise InputError(f"--picture {path}: none of its paths was verified; choose one yourself with --path N")
    if not 0 <= chosen < len(paths):
        raise InputError(f"--path {chosen}: {path} has {len(paths)} paths; allowed: 0 to {len(paths) - 1}")
    try:
        points = np.asarray(paths[chosen]["points_m"], dtype=float).reshape(-1, 2)
        traversability = float(paths[chosen]["traversability"])
    except KeyError as error:
        hint = "run perceive with --camera FILE, which gives metres"
        raise InputError(f"{path}: waypoints[{chosen}] has no {error}; {hint}") from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: waypoints[{chosen}]: {error}; allowed: what perceive writes") from error
    if not len(points):
        raise InputError(f"{path}: waypoints[{chosen}] has no points")
    return SeenWay(points, speed_m_s or risky_speed(1.0 - traversability), f"{path}, path {chosen}")


def placed(points_b: FloatArray, spot: Spot, speed_m_s: float, source: str) -> HandoverPlan:
    """A way (N, 2) ahead and to the left of a rover that stands at ``spot``, as a mission."""
    frame = LocalFrame(Origin(latitude_deg=spot.latitude_deg, longitude_deg=spot.longitude_deg, altitude_m=0.0))
    yaw = yaw_rad(spot.heading_deg)
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = points_b @ np.array([[cos, sin], [-sin, cos]])
    places = [(float(x), float(y), 0.0) for x, y in turned]
    items = mission_items(places, frame, (0.0, 0.0, 0.0), round(speed_m_s, 2))
    return _checked(HandoverPlan(tuple(items), source))


def write_mission_file(path: Path, items: Sequence[WireItem]) -> None:
    """Write the mission for a ground station, in the format that the file's name asks for."""
    if path.suffix not in ENDINGS:
        raise InputError(f"--to-file {path}: allowed: a name that ends in {' or '.join(ENDINGS)}")
    if not path.parent.is_dir():
        raise InputError(f"--to-file {path}: there is no folder {path.parent}")
    if path.suffix == ".plan":
        write_plan(path, items, CRUISE_M_S)
    else:
        write_waypoints(path, items)


def _checked(plan: HandoverPlan) -> HandoverPlan:
    if not plan.places:
        raise InputError(f"{plan.source}: no waypoint after home; allowed: a mission that leads somewhere")
    return plan


def _picture_paths(path: Path) -> tuple[list[dict[str, Any]], int | None]:
    """The paths of a picture's report, and the number of the best; None if none stood a verification."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        paths = list(table["waypoints"])
        checks = table.get("verification")
        best = 0 if checks is None else checks["best_verified_path"]
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"--picture {path}: {error}; allowed: a STEM.json of perceive") from error
    if not paths:
        raise InputError(f"--picture {path}: no path was found in this picture")
    return paths, best
