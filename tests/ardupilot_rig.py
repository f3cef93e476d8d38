"""A session's port with the double behind it, in memory: one clock, faults on demand."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field

from rover_sim.hil.ardupilot import Clockwork
from rover_sim.hil.lockstep import Datagram, Peer
from tests.ardupilot_double import RESEND_S, ArduPilotDouble

_POLL_S = 0.01
PAUSE_S = 0.01  # of the autopilot's own pacing


def frame_count(data: bytes) -> int:
    return int(struct.unpack_from("<HHI", data)[2])


@dataclass
class Faults:
    """What goes wrong, by frame counts; each happens once."""

    lost_packets: set[int] = field(default_factory=set)
    lost_replies: set[int] = field(default_factory=set)
    doubled_packets: set[int] = field(default_factory=set)
    crossed_replies: set[int] = field(default_factory=set)  # the packet is repeated just as its reply leaves
    before: dict[int, list[Datagram]] = field(default_factory=dict)  # strangers' datagrams just before a packet


class MemoryPort:
    """The port as a session sees it."""

    def __init__(
        self, double: ArduPilotDouble, faults: Faults | None = None, at_count: Callable[[int], None] | None = None
    ) -> None:
        """``at_count`` hears of each packet on its way."""
        self.double, self.faults = double, faults or Faults()
        self.now_s = 0.0
        self.peer: Peer = ("127.0.0.1", 50000)
        self.sent: list[tuple[bytes, Peer]] = []
        self._queue: list[Datagram] = []
        self._resumes_s = 0.0  # when the autopilot wakes from a pause of its own pacing
        self._at_count = at_count or (lambda _: None)

    def clockwork(self, patience_s: float = 60.0) -> Clockwork:
        """Its clock, for the session."""
        return Clockwork(lambda: self.now_s, self.pass_time, patience_s)

    def wait(self, seconds: float) -> bool:
        end_s = self.now_s + seconds
        self._pump()
        while not self._queue and self.now_s < end_s - 1e-9:
            self.now_s = min(self.now_s + _POLL_S, end_s)
            self._pump()
        return bool(self._queue)

    def pass_time(self, seconds: float) -> None:
        """Time goes by while nobody looks at the port."""
        end_s = self.now_s + seconds
        while self.now_s < end_s - 1e-9:
            self.now_s = min(self.now_s + _POLL_S, end_s)
            self._pump()

    def take(self) -> list[Datagram]:
        self._pump()
        taken, self._queue = self._queue, []
        return taken

    def send(self, data: bytes, peer: Peer) -> None:
        self.sent.append((data, peer))
        if peer != self.peer:
            return
        if self.double.count in self.faults.lost_replies:
            self.faults.lost_replies.discard(self.double.count)
            return
        if self.double.count in self.faults.crossed_replies:
            self._queue += [(packet, self.peer) for packet in self.double.packets(self.now_s + RESEND_S)]
            self._resumes_s = self.now_s + PAUSE_S
        self.double.deliver(data)

    def restart_autopilot(self) -> None:
        """A new process, at a port of its own."""
        self.double.restart()
        self.peer = (self.peer[0], self.peer[1] + 1)

    def _pump(self) -> None:
        if self.now_s < self._resumes_s - 1e-9:
            return
        for data in self.double.packets(self.now_s):
            count = frame_count(data)
            self._at_count(count)
            self._queue += self.faults.before.pop(count, [])
            if count in self.faults.lost_packets:
                self.faults.lost_packets.discard(count)
                continue
            copies = 2 if count in self.faults.doubled_packets else 1
            self.faults.doubled_packets.discard(count)
            self._queue += [(data, self.peer)] * copies
