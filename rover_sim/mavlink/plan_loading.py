"""Takes a plan file over as if a ground station had uploaded it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rover_sim.errors import InputError
from rover_sim.mavlink.item_store import ItemStore
from rover_sim.mavlink.mission_file import read_plan, read_plan_areas
from rover_sim.mavlink.wire import RefusedItemError, WireItem


def load_plan(path: Path, stores: Sequence[ItemStore], *, home_first: bool) -> None:
    """Store mission, fence and rally points of a plan in these stores, in this order.

    ``home_first``: the mission keeps its planned home as item 0. Raises InputError that names the file and the item;
    lists before the refused one are then stored.
    """
    mission = read_plan(path)
    lists = (mission if home_first else mission[1:], *read_plan_areas(path))
    for store, items in zip(stores, lists, strict=True):
        _load(path, store, [] if store is stores[0] and len(mission) == 1 else items)


def _load(path: Path, store: ItemStore, items: Sequence[WireItem]) -> None:
    place = "all items together"
    try:
        for seq, item in enumerate(items):
            place = f"item {seq} (command {item.command})"
            store.check_item(item, seq)
        store.replace(items)
    except RefusedItemError as error:
        name = store.name.lower()
        raise InputError(f"{path}: {name}, {place}: refused with result {error.result} (MAV_MISSION_RESULT)") from error
