"""The stored mission: the items as received, and the same ones for the autopilot; replaced whole or not."""

from __future__ import annotations

from collections.abc import Sequence

from rover_sim.autopilot.mission import Item, Jump, Mission, SetFence
from rover_sim.mavlink.context import Context
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.plan_ids import plan_id
from rover_sim.mavlink.wire import WAYPOINT, RefusedItemError, WireItem, typed_item

CAPACITY = 2000


class MissionStore:
    """Items keep the numbers that their sender gave them, home included if the sender put it first."""

    kind = int(mavlink.MAV_MISSION_TYPE_MISSION)
    name = "Mission"
    capacity = CAPACITY

    def __init__(self, context: Context) -> None:
        self._context = context
        self.items: tuple[WireItem, ...] = ()
        self.opaque_id = 0

    def check_item(self, item: WireItem, seq: int) -> None:
        """An item that the autopilot can carry out."""
        self._typed(item, seq)

    def replace(self, items: Sequence[WireItem]) -> None:
        """Store checked items and hand them to the autopilot; the item marked as current is where it begins.

        Refused where a jump leads to itself or to no item.
        """
        if len(items) == 1 and items[0].is_blank:
            items = []
        typed = tuple(self._typed(item, seq) for seq, item in enumerate(items))
        mission = Mission(typed)
        for seq, item in enumerate(typed):
            if isinstance(item, Jump) and (item.index == seq or not mission.first <= item.index < len(typed)):
                raise RefusedItemError(mavlink.MAV_MISSION_INVALID_PARAM1)
        marked = next((seq for seq, item in enumerate(items) if item.current == 1), None)
        self.items, self.opaque_id = tuple(items), plan_id(items)
        self._context.autopilot.set_mission(mission, marked)

    @property
    def readable(self) -> tuple[WireItem, ...]:
        """What can be read: an ArduPilot's item 0 is its home, mission or not."""
        return self.items or ((self._home(),) if self._context.persona.home_first else ())

    @property
    def for_files(self) -> list[WireItem]:
        """The mission with a home at its head, as both mission file formats want it."""
        has_home = bool(self.items) and self._context.persona.home_first and self.items[0].is_home
        return [*self.items] if has_home else [self._home(), *self.items]

    def _typed(self, item: WireItem, seq: int) -> Item:
        may_be_home = seq == 0 and self._context.persona.home_first
        autopilot = self._context.autopilot
        typed = typed_item(item, self._context.frame, autopilot.home_w, may_be_home=may_be_home)
        if isinstance(typed, SetFence) and "FENCE_ENABLE" not in autopilot.parameters:
            raise RefusedItemError(mavlink.MAV_MISSION_UNSUPPORTED)
        return typed

    def _home(self) -> WireItem:
        place = self._context.frame.to_geo(self._context.autopilot.home_w)
        return WireItem(
            mavlink.MAV_FRAME_GLOBAL,
            WAYPOINT,
            (0.0, 0.0, 0.0, 0.0),
            place.latitude_e7,
            place.longitude_e7,
            place.altitude_m,
        )
