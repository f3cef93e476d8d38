"""Keys to sticks. A terminal tells presses and repeats, never releases: a key counts as held for a moment after each.

The layout is that of ROS' teleop_twist_keyboard, whose keys are around ``k``; the arrows do the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from rover_sim.autopilot.sticks import Sticks

AXES: Mapping[str, tuple[int, int]] = {  # throttle and steering
    "u": (1, -1), "i": (1, 0), "o": (1, 1),
    "j": (0, -1), "k": (0, 0), "l": (0, 1),
    "m": (-1, -1), ",": (-1, 0), ".": (-1, 1),
    "up": (1, 0), "left": (0, -1), "right": (0, 1), "down": (-1, 0), " ": (0, 0),
}  # fmt: skip
STEPS: Mapping[str, float] = {"+": 0.1, "-": -0.1}  # of full deflection
FOCUS_LOST = "focus lost"
HELP = (
    "u i o / j k l / m , . or arrows: drive while held; + -: faster, slower; M Manual, H Hold, A arm, D disarm, q quit"
)
_SEQUENCES: Mapping[bytes, str] = {
    b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[C": "right", b"\x1b[D": "left",
    b"\x1bOA": "up", b"\x1bOB": "down", b"\x1bOC": "right", b"\x1bOD": "left",
    b"\x1b[O": FOCUS_LOST,
}  # fmt: skip
# ECMA-48: escape, bracket, parameters, final byte; or escape and one or two bytes. The end of a left arrow is a D: a
# sequence that comes in two pieces must not be taken for the key that disarms.
_KEY = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]|O.|[^\[O])|[^\x1b]", re.DOTALL)
_ESCAPE = 0x1B
_FIRST_S = 0.7  # a terminal repeats a key after half a second
_REPEAT_S = 0.2  # and then some 30 times a second


@dataclass(frozen=True)
class Hand:
    """What one hand on the keyboard asks for."""

    key: str = "k"
    until_s: float = 0.0
    share: float = 0.5  # deflection of a held key


def keys(data: bytes) -> tuple[list[str], bytes]:
    """Names of the keys in what a terminal sent, and the beginning of an escape sequence whose end is not there yet.

    Sequences that mean nothing here are left out.
    """
    names, at = [], 0
    while match := _KEY.match(data, at):
        at = match.end()
        found = match.group()
        name = _SEQUENCES.get(found) if found[0] == _ESCAPE else chr(found[0])
        if name is not None:
            names.append(name)
    return names, data[at:]


def press(hand: Hand, key: str, time_s: float) -> Hand:
    """The hand after a key came in: pressed, or repeated because it is held."""
    if key in STEPS:
        return replace(hand, share=min(max(round(hand.share + STEPS[key], 3), 0.1), 1.0))
    if key == FOCUS_LOST:
        return replace(hand, until_s=time_s)
    if key not in AXES:
        return hand
    repeated = key == hand.key and time_s < hand.until_s
    return replace(hand, key=key, until_s=time_s + (_REPEAT_S if repeated else _FIRST_S))


def sticks(hand: Hand, time_s: float) -> Sticks:
    """Deflections now; centred once the key is not held any more."""
    if time_s >= hand.until_s:
        return Sticks()
    throttle, steer = AXES[hand.key]
    return Sticks(throttle * hand.share, steer * hand.share)


class Keyboard:
    """A hand on the keys of one terminal."""

    def __init__(self) -> None:
        self.hand = Hand()
        self._rest = b""

    def look(self, data: bytes, time_s: float) -> tuple[list[str], Sticks]:
        """Keys that came in with the next bytes of the terminal, and where the sticks are now."""
        pressed, self._rest = keys(self._rest + data)
        for key in pressed:
            self.hand = press(self.hand, key, time_s)
        return pressed, sticks(self.hand, time_s)
