"""Who asks for the next step of the physics, and whether it is a new one: the lockstep of ArduPilot's JSON interface.

The autopilot sends a packet and waits. It sends the same packet again every 1.1 s without a reply; it takes every
reply, whatever it answers, for the next step. So each count is answered once, and a second time only where the first
reply must have been lost.
"""

from __future__ import annotations

import ipaddress
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from rover_sim.hil.ardupilot_json import LENGTHS, ServoPacket, parse_servos

Peer = tuple[str, int]
Datagram = tuple[bytes, Peer]
# Two of the pauses after which a waiting autopilot asks again: one that is silent for longer is gone.
GIVEN_UP_S = 2.5


@dataclass(frozen=True)
class Request:
    """What the autopilot wants now."""

    packet: ServoPacket
    peer: Peer
    repeated: bool = False  # this count has had its reply
    restarted: bool = False  # a new autopilot, or one that began anew


class Lockstep:
    """Sorts the datagrams at one port; time is passed in, wall time of the one who waits."""

    def __init__(self, *, loopback_only: bool) -> None:
        self.dropped: Counter[str] = Counter()  # datagrams by what was wrong
        self.peer: Peer | None = None  # the autopilot
        self._loopback_only = loopback_only
        self._heard_s = 0.0
        self._answered: int | None = None  # the last count
        self._notes: list[str] = []

    def hear(self, datagrams: Iterable[Datagram], now_s: float) -> Request | None:
        """The request behind datagrams that have come, oldest first: the newest, as no older one waits any more."""
        request, restarted = None, False
        for data, peer in datagrams:
            packet = self._admit(data, peer, now_s)
            if packet is None:
                continue
            count = packet.frame_count
            if self._answered is not None:
                restarted |= peer != self.peer or (count == 0 and self._answered > 0)
            self.peer, self._heard_s = peer, now_s
            request = Request(packet, peer, count == self._answered and not restarted, restarted)
        return request

    def answer(self, request: Request, come_meanwhile: Iterable[Datagram]) -> list[Datagram]:
        """The request gets its reply now; of what has come since it was heard, that which this does not answer."""
        self._answered = request.packet.frame_count
        return [
            (data, peer)
            for data, peer in come_meanwhile
            if (parse_servos(data), peer) != (request.packet, request.peer)
        ]

    def take_notes(self) -> list[str]:
        """What a user should know since the last call: each kind of trouble once."""
        notes, self._notes = self._notes, []
        return notes

    def _admit(self, data: bytes, peer: Peer, now_s: float) -> ServoPacket | None:
        """The packet, if it is one and comes from the autopilot; else it is dropped."""
        packet = parse_servos(data)
        if self._loopback_only and not ipaddress.ip_address(peer[0].partition("%")[0]).is_loopback:
            self._drop("from another machine", peer, "the port is open to this machine only")
        elif packet is None:
            self._drop("no servo packet", peer, f"{len(data)} bytes; allowed: {LENGTHS}")
        elif peer != self.peer and self.peer is not None and now_s - self._heard_s <= GIVEN_UP_S:
            self._drop("second autopilot", peer, "one autopilot is served at a time")
        elif peer == self.peer and self._answered is not None and 0 < packet.frame_count < self._answered:
            # One that begins anew begins at 0: this one has been overtaken on a network.
            self._drop("late packet", peer, f"frame {packet.frame_count}, answered before frame {self._answered}")
        else:
            return packet
        return None

    def _drop(self, reason: str, peer: Peer, text: str) -> None:
        self.dropped[reason] += 1
        if self.dropped[reason] == 1:
            self._notes.append(f"dropped, from {peer[0]}:{peer[1]}: {reason} ({text})")
