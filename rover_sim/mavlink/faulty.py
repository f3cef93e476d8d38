"""A real link made bad on purpose: what passes it in either direction suffers the same faults."""

from __future__ import annotations

import numpy as np

from rover_sim.mavlink.faults import Faults, Lane
from rover_sim.mavlink.transport import Learner, Transport


class FaultyLink:
    """A transport around another; on a stream the unit that is lost or delayed is the chunk."""

    def __init__(self, inner: Transport, faults: Faults, rng: np.random.Generator) -> None:
        self._inner, self._faults, self._rng = inner, faults, rng
        self._out: dict[str, Lane] = {}
        self._in: dict[str, Lane] = {}

    @property
    def is_stream(self) -> bool:
        """As the link inside."""
        return self._inner.is_stream

    def peers(self, time_s: float) -> tuple[str, ...]:
        """The peers of the link inside."""
        peers = self._inner.peers(time_s)
        for lanes in (self._in, self._out):
            for gone in lanes.keys() - set(peers):
                del lanes[gone]
        return peers

    def forget(self, peer: str) -> None:
        """As the link inside."""
        if isinstance(self._inner, Learner):
            self._inner.forget(peer)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:
        """Put the frame on its way; it leaves at a later call."""
        self._lane(self._out, peer).put(frame, time_s)
        self._flush(time_s)

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        """What has made it through by now."""
        self._flush(time_s)
        for peer, data in self._inner.receive(time_s):
            self._lane(self._in, peer).put(data, time_s)
        return [(peer, data) for peer, lane in self._in.items() for data in lane.take(time_s)]

    def handles(self) -> tuple[int, ...]:
        """Those of the link inside."""
        return self._inner.handles()

    def close(self) -> None:
        """Close the link inside."""
        self._inner.close()

    def _flush(self, time_s: float) -> None:
        for peer, lane in self._out.items():
            for frame in lane.take(time_s):
                self._inner.send(frame, peer, time_s)

    def _lane(self, lanes: dict[str, Lane], peer: str) -> Lane:
        if peer not in lanes:
            lanes[peer] = Lane(self._faults, self._rng)
        return lanes[peer]
