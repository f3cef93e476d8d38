"""Ids of plans, by which a ground station sees that a list has changed: MISSION_COUNT, MISSION_ACK, MISSION_CURRENT."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable

from rover_sim.mavlink.wire import WireItem


def plan_id(items: Iterable[WireItem]) -> int:
    """CRC-32 over the items as PX4 makes it, never 0, which stands for no plan; 0 for an empty list."""
    checksum, empty = 0, True
    for item in items:
        numbers = (*item.params, item.z)
        data = struct.pack("<HH5fiiB", item.frame, item.command, *numbers, item.x, item.y, item.autocontinue & 255)
        checksum, empty = zlib.crc32(data, checksum), False
    return 0 if empty else checksum or 1
