"""Fence and rally points in QGroundControl's plan files. Format: its developer guide, "Plan File Format"."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.fence_store import CIRCLES, RALLY_POINT, RETURN_POINT, VERTICES
from rover_sim.mavlink.geodesy import DEGREES_E7
from rover_sim.mavlink.wire import WireItem

_ABSOLUTE, _RELATIVE = mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
_VERTEX = {inclusion: command for command, inclusion in VERTICES.items()}
_CIRCLE = {inclusion: command for command, inclusion in CIRCLES.items()}


def fence_entry(items: Sequence[WireItem]) -> dict[str, Any]:
    """The plan's ``geoFence`` of a fence as it was uploaded."""
    polygons, circles = [], []
    entry: dict[str, Any] = {"version": 2}
    at = 0
    while at < len(items):
        item = items[at]
        corners = items[at : at + int(item.params[0])] if item.command in VERTICES else [item]
        places = [_degrees(corner) for corner in corners]
        if item.command in VERTICES:
            polygons.append({"inclusion": VERTICES[item.command], "polygon": places, "version": 1})
        elif item.command in CIRCLES:
            circle = {"center": places[0], "radius": item.params[0]}
            circles.append({"circle": circle, "inclusion": CIRCLES[item.command], "version": 1})
        else:
            entry["breachReturn"] = [*places[0], item.z]
        at += len(corners)
    return entry | {"polygons": polygons, "circles": circles}


def rally_entry(items: Sequence[WireItem]) -> dict[str, Any]:
    """The plan's ``rallyPoints``."""
    return {"version": 2, "points": [[*_degrees(item), item.z] for item in items]}


def read_fence(entry: Mapping[str, Any]) -> Iterator[WireItem]:
    """Items of a ``geoFence``; raises KeyError, TypeError or ValueError for what is none."""
    for polygon in entry.get("polygons", []):
        corners = polygon["polygon"]
        for latitude, longitude in corners:
            yield _item(_VERTEX[bool(polygon["inclusion"])], float(len(corners)), latitude, longitude)
    for circle in entry.get("circles", []):
        (latitude, longitude), radius = circle["circle"]["center"], float(circle["circle"]["radius"])
        yield _item(_CIRCLE[bool(circle["inclusion"])], radius, latitude, longitude)
    if entry.get("breachReturn") is not None:
        latitude, longitude, altitude = entry["breachReturn"]
        yield _item(RETURN_POINT, 0.0, latitude, longitude, float(altitude), _RELATIVE)


def read_rally(entry: Mapping[str, Any]) -> Iterator[WireItem]:
    """Items of ``rallyPoints``; raises KeyError, TypeError or ValueError for what is none."""
    for latitude, longitude, altitude in entry.get("points", []):
        yield _item(RALLY_POINT, 0.0, latitude, longitude, float(altitude), _RELATIVE)


def _item(
    command: int, first: float, latitude: float, longitude: float, height_m: float = 0.0, frame: int = _ABSOLUTE
) -> WireItem:
    x, y = round(float(latitude) * DEGREES_E7), round(float(longitude) * DEGREES_E7)
    return WireItem(frame, command, (first, 0.0, 0.0, 0.0), x, y, height_m)


def _degrees(item: WireItem) -> list[float]:
    return [item.x / DEGREES_E7, item.y / DEGREES_E7]
