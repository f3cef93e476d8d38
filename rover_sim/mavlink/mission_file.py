"""Mission files of the ground stations: ``QGC WPL 110`` (.waypoints) and QGroundControl's JSON (.plan).

Formats: mavlink.io/en/file_formats/#mission_plain_text_file; QGroundControl developer guide, "Plan File Format".
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rover_sim.errors import InputError
from rover_sim.files import write_json, write_text
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.geodesy import DEGREES_E7
from rover_sim.mavlink.plan_fence import fence_entry, rally_entry, read_fence, read_rally
from rover_sim.mavlink.wire import WAYPOINT, WireItem

_HEADER = "QGC WPL 110"
_PLACED = (WAYPOINT, mavlink.MAV_CMD_NAV_LOITER_TIME)  # commands whose x, y, z are a place
_ABOVE_HOME, _ABSOLUTE = 1, 2  # QGroundControl's AltitudeMode


def write_waypoints(path: Path, items: Sequence[WireItem]) -> None:
    """Write the items, the home item first, as ArduPilot's ground stations expect; one line an item."""
    lines = [_HEADER]
    for seq, item in enumerate(items):
        x, y = item.x / DEGREES_E7, item.y / DEGREES_E7
        numbers = (*item.params, x, y, item.z)
        texts = [repr(0.0) if math.isnan(value) else _number(value) for value in numbers]
        lines.append("\t".join([str(seq), str(int(seq == 0)), str(item.frame), str(item.command), *texts, "1"]))
    write_text(path, "\n".join(lines) + "\n")


def read_waypoints(path: Path) -> list[WireItem]:
    """Read a ``QGC WPL 110`` file; raises InputError that names the file and the line."""
    lines = _text(path).splitlines()
    if not lines or lines[0].strip() != _HEADER:
        raise InputError(f"{path}: line 1: not a mission file; allowed: {_HEADER!r}")
    return [_waypoint_line(path, number, line) for number, line in enumerate(lines[1:], start=2) if line.strip()]


def write_plan(
    path: Path,
    items: Sequence[WireItem],
    cruise_speed_m_s: float,
    fence: Sequence[WireItem] = (),
    rally: Sequence[WireItem] = (),
) -> None:
    """Write mission, fence and rally points as a plan: the first item is the planned home, the others count from 1."""
    home, *rest = items
    mission = {
        "version": 2,
        "firmwareType": int(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
        "vehicleType": int(mavlink.MAV_TYPE_GROUND_ROVER),
        "cruiseSpeed": cruise_speed_m_s,
        "hoverSpeed": cruise_speed_m_s,
        "globalPlanAltitudeMode": _ABOVE_HOME,
        "plannedHomePosition": [home.x / DEGREES_E7, home.y / DEGREES_E7, home.z],
        "items": [_plan_item(seq, item) for seq, item in enumerate(rest, start=1)],
    }
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": mission,
        "geoFence": fence_entry(fence),
        "rallyPoints": rally_entry(rally),
    }
    write_json(path, plan)


def read_plan(path: Path) -> list[WireItem]:
    """Read the simple items of a plan, home first; raises InputError that names the file and the key."""
    plan = _json(path)
    try:
        mission = plan["mission"]
        latitude, longitude, altitude = mission["plannedHomePosition"]
        none = (0.0, 0.0, 0.0, 0.0)
        home = WireItem(mavlink.MAV_FRAME_GLOBAL, WAYPOINT, none, _e7(latitude), _e7(longitude), float(altitude))
        return [home, *(_read_plan_item(path, number, item) for number, item in enumerate(mission["items"]))]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: mission: {error!r}; allowed: the keys of a QGroundControl plan") from error


def read_plan_areas(path: Path) -> tuple[list[WireItem], list[WireItem]]:
    """Read the fence and the rally points of a plan; raises InputError that names the file and the key."""
    plan = _json(path)
    try:
        return list(read_fence(plan["geoFence"])), list(read_rally(plan["rallyPoints"]))
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: geoFence, rallyPoints: {error!r}; allowed: the keys of a plan") from error


def _json(path: Path) -> Any:
    try:
        return json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: line {error.lineno}: not JSON ({error.msg}); allowed: a .plan file") from error


def _waypoint_line(path: Path, number: int, line: str) -> WireItem:
    fields = line.split()
    if len(fields) != 12:
        raise InputError(f"{path}: line {number}: {len(fields)} fields; allowed: 12, separated by tabs")
    try:
        frame, command = int(fields[2]), int(fields[3])
        one, two, three, four, x, y, z = (float(field) for field in fields[4:11])
        return WireItem(frame, command, (one, two, three, four), _e7(x), _e7(y), z, int(fields[11]))
    except (ValueError, OverflowError) as error:
        raise InputError(f"{path}: line {number}: {error}; allowed: numbers") from error


def _plan_item(seq: int, item: WireItem) -> dict[str, Any]:
    """A SimpleItem; null stands for NaN, which JSON does not have."""
    params: list[float | None] = [None if math.isnan(value) else value for value in item.params]
    entry: dict[str, Any] = {
        "type": "SimpleItem",
        "autoContinue": bool(item.autocontinue),
        "command": item.command,
        "doJumpId": seq,
        "frame": item.frame,
        "params": [*params, item.x / DEGREES_E7, item.y / DEGREES_E7, item.z],
    }
    if item.command in _PLACED:
        mode = _ABSOLUTE if item.frame == mavlink.MAV_FRAME_GLOBAL else _ABOVE_HOME
        entry |= {"Altitude": item.z, "AltitudeMode": mode, "AMSLAltAboveTerrain": None}
    return entry


def _read_plan_item(path: Path, number: int, entry: dict[str, Any]) -> WireItem:
    if entry.get("type") != "SimpleItem":
        raise InputError(f"{path}: mission.items[{number}]: type {entry.get('type')!r}; allowed: 'SimpleItem'")
    numbers = [math.nan if value is None else float(value) for value in entry["params"]]
    one, two, three, four, x, y, z = numbers
    automatic = int(entry.get("autoContinue", True))
    return WireItem(int(entry["frame"]), int(entry["command"]), (one, two, three, four), _e7(x), _e7(y), z, automatic)


def _e7(degrees: float) -> int:
    """MAVLink's integer; raises ValueError or OverflowError for what is no number."""
    return round(float(degrees) * DEGREES_E7)


def _number(value: float) -> str:
    """Shortest decimal that reads back as the same number, never in scientific notation."""
    text = repr(float(value))
    return text if "e" not in text else f"{value:.10f}"


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); allowed: a mission file") from error
