"""What the mission protocol needs of a list: mission, fence and rally points are kept apart and alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from rover_sim.mavlink.wire import WireItem


class ItemStore(Protocol):
    """One list, replaced whole or not at all."""

    kind: int  # MAV_MISSION_TYPE
    name: str
    capacity: int
    items: tuple[WireItem, ...]
    opaque_id: int  # 0 if the list is empty

    @property
    def readable(self) -> tuple[WireItem, ...]:
        """What can be read by its number."""
        ...

    def check_item(self, item: WireItem, seq: int) -> None:
        """Raises RefusedItemError for an item that no list of this kind can have at this place."""
        ...

    def replace(self, items: Sequence[WireItem]) -> None:
        """Store checked items and put them to use.

        Raises RefusedItemError, and changes nothing, where the items do not go together.
        """
        ...
