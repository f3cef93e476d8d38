"""A ground station that signs, by pymavlink, and a clock that only the test moves."""

from __future__ import annotations

import hashlib

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.signing import TICKS_PER_S

KEY = hashlib.sha256(b"correct horse").digest()
EPOCH_S = 1_420_070_400.0
NOW_S = 1_700_000_000.0
ARM = mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
PING = mavlink.MAVLink_ping_message(1, 1, 0, 0)


class Clock:
    def __init__(self) -> None:
        self.s = NOW_S

    def __call__(self) -> float:
        return self.s

    @property
    def ticks(self) -> int:
        return round((self.s - EPOCH_S) * TICKS_PER_S)


class Signer:
    """pymavlink as a ground station that signs."""

    def __init__(self, clock: Clock, key: bytes = KEY, link: int = 0, system: int = 255) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=190)
        self.mav.signing.secret_key, self.mav.signing.sign_outgoing = key, True
        self.mav.signing.link_id, self.mav.signing.timestamp = link, clock.ticks

    def pack(self, message: Message, later_s: float = 0.0) -> bytes:
        """A signed frame; ``later_s`` shifts its timestamp alone."""
        kept = self.mav.signing.timestamp
        self.mav.signing.timestamp += round(later_s * TICKS_PER_S)
        frame: bytes = message.pack(self.mav)
        if later_s:
            self.mav.signing.timestamp = kept + 1
        self.mav.seq = (self.mav.seq + 1) % 256
        return frame
