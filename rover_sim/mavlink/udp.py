"""UDP links: listening for ground stations, or sending to one."""

from __future__ import annotations

import socket

from rover_sim.mavlink.sockets import CHUNK_BYTES, Address, bound, connected, name
from rover_sim.mavlink.transport import LinkUrl

PEER_EXPIRES_S = 10.0  # the same as MAVSDK's for its remotes
_MOST_PEERS = 32  # a port scan must not make us answer the world
_MOST_DATAGRAMS = 256  # a poll ends even under a flood


class UdpIn:
    """A UDP port that learns its peers from what they send, and forgets them after 10 s of silence."""

    is_stream = False

    def __init__(self, url: LinkUrl) -> None:
        self._socket = bound(url, socket.SOCK_DGRAM)
        self._peers: dict[str, tuple[Address, float]] = {}
        self.lost_frames = 0

    @property
    def port(self) -> int:
        """The port in use: that of the URL, or the one the system chose for port 0."""
        return int(self._socket.getsockname()[1])

    def peers(self, time_s: float) -> tuple[str, ...]:
        """The peers heard in the last 10 s."""
        silent = [peer for peer, (_, heard) in self._peers.items() if time_s - heard > PEER_EXPIRES_S]
        for peer in silent:
            del self._peers[peer]
        return tuple(self._peers)

    def forget(self, peer: str) -> None:
        """Drop a peer until it speaks again: strangers must not keep the places of others."""
        self._peers.pop(peer, None)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:  # noqa: ARG002  (the interface passes the time)
        """Send to one peer; a frame that the system does not take counts as lost."""
        if peer in self._peers:
            try:
                self._socket.sendto(frame, self._peers[peer][0])
            except OSError:
                self.lost_frames += 1

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        """Datagrams since the last call."""
        chunks: list[tuple[str, bytes]] = []
        while len(chunks) < _MOST_DATAGRAMS:
            try:
                data, address = self._socket.recvfrom(CHUNK_BYTES)
            except BlockingIOError:
                break
            except ConnectionError:  # an answer to an earlier send: that peer's port is closed
                continue
            peer = name(address)
            if peer in self._peers or len(self._peers) < _MOST_PEERS:
                self._peers[peer] = (address, time_s)
                chunks.append((peer, data))
        return chunks

    def handles(self) -> tuple[int, ...]:
        """The socket."""
        return (self._socket.fileno(),)

    def close(self) -> None:
        """Free the port."""
        self._socket.close()


class UdpOut:
    """UDP to one fixed peer, which hears us whether or not it has spoken."""

    is_stream = False

    def __init__(self, url: LinkUrl) -> None:
        self._socket = connected(url, socket.SOCK_DGRAM, 1.0)
        self._peer = name(self._socket.getpeername())
        self.lost_frames = 0

    def peers(self, time_s: float) -> tuple[str, ...]:  # noqa: ARG002
        """The one peer, always."""
        return (self._peer,)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:  # noqa: ARG002
        """Send to the peer; while nobody listens there the frame is lost."""
        try:
            self._socket.send(frame)
        except OSError:
            self.lost_frames += 1

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:  # noqa: ARG002
        """Datagrams since the last call."""
        chunks: list[tuple[str, bytes]] = []
        while len(chunks) < _MOST_DATAGRAMS:
            try:
                chunks.append((self._peer, self._socket.recv(CHUNK_BYTES)))
            except BlockingIOError:
                break
            except ConnectionError:  # an answer to an earlier send: nobody listens there yet
                self.lost_frames += 1
        return chunks

    def handles(self) -> tuple[int, ...]:
        """The socket."""
        return (self._socket.fileno(),)

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
