"""The stored fence and the stored rally points: the items as received, and what the autopilot makes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rover_sim.autopilot.fence import Circle, Fence, Polygon
from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.plan_ids import plan_id
from rover_sim.mavlink.wire import RefusedItemError, WireItem, place_in
from worlds.types import Vector3

RETURN_POINT = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT
VERTICES = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
RALLY_POINT = mavlink.MAV_CMD_NAV_RALLY_POINT


class _PlaceStore:
    """Items that are places, read as they were written."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self.items: tuple[WireItem, ...] = ()
        self.opaque_id = 0

    @property
    def readable(self) -> tuple[WireItem, ...]:
        """All items."""
        return self.items

    def _place(self, item: WireItem) -> Vector3:
        return place_in(item, self._context.frame, self._context.autopilot.home_w)


class FenceStore(_PlaceStore):
    """Polygons, circles and one return point."""

    kind = int(mavlink.MAV_MISSION_TYPE_FENCE)
    name = "Fence"
    capacity = 1000

    def check_item(self, item: WireItem, seq: int) -> None:  # noqa: ARG002  (a list of another kind needs it)
        """A command of a fence with a place, and with a radius or a number of corners that can be."""
        first = item.params[0]
        if item.command in VERTICES:
            if not (first >= 3.0 and float(first).is_integer()):
                raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1)
        elif item.command in CIRCLES:
            if not 0.0 < first < math.inf:
                raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1)
        elif item.command != RETURN_POINT:
            raise RefusedItemError(mavlink.MAV_MISSION_UNSUPPORTED)
        self._place(item)

    def replace(self, items: Sequence[WireItem]) -> None:
        """Take the fence; refused where a polygon is not complete or there are two return points."""
        fence = fence_of(items, self._context.frame, self._context.autopilot.home_w)
        self.items, self.opaque_id = tuple(items), plan_id(items)
        self._context.autopilot.fence.fence = fence


class RallyStore(_PlaceStore):
    """Places to return to."""

    kind = int(mavlink.MAV_MISSION_TYPE_RALLY)
    name = "Rally"
    capacity = 100

    def check_item(self, item: WireItem, seq: int) -> None:  # noqa: ARG002  (a list of another kind needs it)
        """A rally point with a place."""
        if item.command != RALLY_POINT:
            raise RefusedItemError(mavlink.MAV_MISSION_UNSUPPORTED)
        self._place(item)

    def replace(self, items: Sequence[WireItem]) -> None:
        """Take the points."""
        places = tuple(self._place(item) for item in items)
        self.items, self.opaque_id = tuple(items), plan_id(items)
        self._context.autopilot.returns.rally_w = places


def fence_of(items: Sequence[WireItem], frame: LocalFrame, home_w: Vector3) -> Fence:
    """The fence that checked items make; raises RefusedItemError.

    Each corner says how many its polygon has. One that says another number than the first of its polygon has a wrong
    parameter 1; a polygon that is cut off by another item or by the end is invalid, as is a second return point.
    """
    areas: list[Polygon | Circle] = []
    return_w: Vector3 | None = None
    at = 0
    while at < len(items):
        item = items[at]
        corners = _corners(items, at) if item.command in VERTICES else [item]
        places = [place_in(corner, frame, home_w) for corner in corners]
        if item.command in VERTICES:
            areas.append(Polygon(np.array(places)[:, :2], VERTICES[item.command]))
        elif item.command in CIRCLES:
            areas.append(Circle(places[0][:2], float(item.params[0]), CIRCLES[item.command]))
        elif return_w is not None:
            raise RefusedItemError(mavlink.MAV_MISSION_INVALID)
        else:
            return_w = places[0]
        at += len(corners)
    return Fence(tuple(areas), return_w)


def _corners(items: Sequence[WireItem], at: int) -> Sequence[WireItem]:
    """The corners of the polygon that begins here."""
    first = items[at]
    corners = items[at : at + int(first.params[0])]
    if len(corners) < first.params[0] or any(corner.command != first.command for corner in corners):
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID)
    if any(corner.params[0] != first.params[0] for corner in corners):
        raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1)
    return corners
