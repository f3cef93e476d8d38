"""Random missions, fences and lists of rally points, with mistakes and without."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.wire import WireItem

LISTS = (0, 1, 2)  # MAV_MISSION_TYPE
LATITUDE, LONGITUDE = 384064000, -1107919000
NAN = math.nan


def seeded(seed: int) -> random.Random:
    """Python's own generator: draws of single numbers cost a tenth of numpy's."""
    return random.Random(seed)  # noqa: S311  (nothing secret)


@dataclass(frozen=True, eq=False)
class Offer:
    """A list that a station has announced; ``good`` if the vehicle may take it."""

    kind: int
    count: int
    items: tuple[WireItem, ...]
    good: bool
    older_messages: bool = False  # MISSION_ITEM with degrees


def random_offer(rng: random.Random, kind: int) -> Offer:
    """A list of one kind, one in four with a mistake somewhere."""
    items = {0: _mission, 1: _fence, 2: _rally}.get(kind, _mission)(rng)
    count, good = len(items), kind in LISTS
    draw = rng.random()
    if items and draw < 0.18:
        at = rng.randrange(len(items))
        items[at] = replace(items[at], **_mistake(rng, kind, items[at]))
        good = False
    elif draw < 0.22:
        count, good = rng.choice((60000, 2001 if kind == 0 else 1001)), False
    elif draw < 0.25 and count:
        count += 1  # one more than there is: never complete
        good = False
    older = kind == 0 and rng.random() < 0.15
    if older:
        items = [_rounded(item) for item in items]
    return Offer(kind, count, tuple(items), good, older)


def _mistake(rng: random.Random, kind: int, item: WireItem) -> dict[str, Any]:
    """Fields that make any item of the kind wrong."""
    wrong: list[dict[str, Any]] = [{"command": 9999}, {"command": 16 if kind else 5001}]
    if item.command not in (19, 16) and kind == 0:
        return rng.choice(wrong)
    wrong += [{"frame": 1}, {"frame": 77}, {"x": 2**31 - 1}, {"y": -(2**31)}, {"x": 100, "y": 100, "frame": 3}]
    if kind == 0:
        wrong = [{**one, "command": 19} for one in wrong[2:]]  # a waypoint at the head may be a home anywhere
        wrong += [{"command": 19, "params": (bad, 0.0, 0.0, 0.0)} for bad in (-1.0, math.inf)]
    return rng.choice(wrong)


def _mission(rng: random.Random) -> list[WireItem]:
    items = []
    for _ in range(rng.randrange(9)):
        kind = rng.randrange(6)
        if kind <= 2:
            frame = rng.choice((0, 3, 5, 6))
            params = (rng.choice((0.0, 1.5, NAN)), rng.choice((0.0, 0.25, NAN)), 0.0, rng.choice((0.0, NAN)))
            items.append(_at(rng, rng.choice((16, 16, 17, 19)), frame, params, rng.choice((0.0, 2.5, NAN))))
        elif kind == 3:
            items.append(WireItem(2, 178, (1.0, 0.5, -1.0, 0.0), 0, 0, NAN))
        elif kind == 4:
            items.append(WireItem(2, 112, (2.0, 0.0, 0.0, 0.0), 0, 0, 0.0))
        else:
            items.append(WireItem(2, 115, (90.0, 0.0, 1.0, 0.0), 0, 0, 0.0))
    return items


def _fence(rng: random.Random) -> list[WireItem]:
    items = []
    for _ in range(rng.randrange(4)):
        if rng.random() < 0.6:
            corners, command = rng.randrange(3, 6), rng.choice((5001, 5002))
            items += [_at(rng, command, 0, (float(corners), 0.0, 0.0, 0.0)) for _ in range(corners)]
        else:
            items.append(_at(rng, rng.choice((5003, 5004)), 3, (rng.choice((2.0, 30.5)), 0.0, 0.0, 0.0)))
    if rng.random() < 0.2:
        items.append(_at(rng, 5000, 3, (0.0, 0.0, 0.0, 0.0)))
    return items


def _rally(rng: random.Random) -> list[WireItem]:
    return [_at(rng, 5100, rng.choice((0, 3)), (0.0, 0.0, 0.0, 0.0)) for _ in range(rng.randrange(6))]


def _at(
    rng: random.Random, command: int, frame: int, params: tuple[float, float, float, float], z: float = 0.0
) -> WireItem:
    x, y = LATITUDE + rng.randrange(-9000, 9000), LONGITUDE + rng.randrange(-9000, 9000)
    return WireItem(frame, command, params, x, y, z)


def _rounded(item: WireItem) -> WireItem:
    """The item as degrees of single precision make it."""
    x, y = (round(struct.unpack("<f", struct.pack("<f", part / 1e7))[0] * 1e7) for part in (item.x, item.y))
    return replace(item, x=x, y=y)


def message_of(offer: Offer, seq: int, kind: int | None = None) -> Message:
    """An item of an offer as its sender says it."""
    item, about = offer.items[seq], offer.kind if kind is None else kind
    if not offer.older_messages:
        return item.message(1, 1, seq, about)
    return mavlink.MAVLink_mission_item_message(
        1, 1, seq, item.frame, item.command, 0, 1, *item.params, item.x / 1e7, item.y / 1e7, item.z, about
    )


def same(items: Sequence[WireItem], others: Sequence[WireItem]) -> bool:
    """Whether two lists are the same bit by bit, NaN included."""
    return [repr(replace(item, current=0)) for item in items] == [repr(replace(item, current=0)) for item in others]
