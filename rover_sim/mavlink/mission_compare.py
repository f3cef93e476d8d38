"""Whether a mission that was read back is the one that was sent, within what the autopilot is known to change."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.foreign_rules import AutopilotRules, ReadBack
from rover_sim.mavlink.wire import WireItem

_SINGLE = 1e-6  # relative: a float in four bytes
# The frames that end in _INT differ from the others in how the place travels, not in what it means.
_SAME_FRAME = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}


def first_difference(sent: Sequence[WireItem], read: Sequence[WireItem], rules: AutopilotRules) -> str:
    """What is not as it was sent, in words; empty if nothing. An ArduPilot's item 0 is its own home."""
    if len(sent) != len(read):
        return f"{len(read)} items instead of {len(sent)}"
    first = 1 if rules.persona.home_first else 0
    for seq, (wanted, got) in enumerate(zip(sent, read, strict=True)):
        what = _difference(wanted, got, rules.read_back) if seq >= first else ""
        if what:
            return f"item {seq}: {what}"
    return ""


def _difference(sent: WireItem, read: WireItem, rules: ReadBack) -> str:
    if sent.command != read.command:
        return f"command {read.command} instead of {sent.command}"
    dropped, whole = (table.get(sent.command, frozenset()) for table in (rules.dropped, rules.whole))
    for number, (wanted, got) in enumerate(zip(sent.params, read.params, strict=True), start=1):
        if number not in dropped and not _same(wanted, got, cut=number in whole):
            return f"parameter {number} is {got:g} instead of {wanted:g}"
    return "" if sent.frame == mavlink.MAV_FRAME_MISSION else _place_difference(sent, read, rules)


def _place_difference(sent: WireItem, read: WireItem, rules: ReadBack) -> str:
    if _frame(sent) != _frame(read):
        return f"frame {read.frame} instead of {sent.frame}"
    if max(abs(sent.x - read.x), abs(sent.y - read.y)) > rules.place_e7:
        return f"place ({read.x}, {read.y}) instead of ({sent.x}, {sent.y})"
    if abs(_given(sent.z) - _given(read.z)) > rules.height_m:
        return f"altitude {read.z:g} instead of {sent.z:g}"
    return ""


def _frame(item: WireItem) -> int:
    return int(_SAME_FRAME.get(item.frame, item.frame))


def _same(sent: float, read: float, *, cut: bool) -> bool:
    """Equal as four-byte floats; NaN is "not given", which autopilots keep as 0."""
    wanted, got = _given(sent), _given(read)
    return math.isclose(wanted, got, rel_tol=_SINGLE, abs_tol=_SINGLE) or (cut and math.trunc(wanted) == got)


def _given(value: float) -> float:
    return 0.0 if math.isnan(value) else value
