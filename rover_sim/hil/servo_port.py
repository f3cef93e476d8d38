"""The UDP port at which an autopilot asks for the next step of the physics."""

from __future__ import annotations

import ipaddress
import select
import socket
from typing import Self

from rover_sim.errors import InputError, LinkError
from rover_sim.hil.lockstep import Datagram, Peer
from rover_sim.mavlink.sockets import bound
from rover_sim.mavlink.transport import LinkUrl, parse_url

_LONGEST_BYTES = 2048  # any servo packet, and enough of anything else to tell that it is none


class ServoPort:
    """A bound UDP port and context manager; raises InputError for a bad address, LinkError if it is taken."""

    def __init__(self, bind: str) -> None:
        url = _url(bind)
        try:
            self._socket = bound(url, socket.SOCK_DGRAM)
        except LinkError as error:
            hint = "another physics may answer there: stop it, or give both sides another port"
            raise LinkError(f"--bind {bind}: {str(error).partition(': ')[2]} ({hint})") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def address(self) -> Peer:
        """Host and port in use."""
        host, port, *_ = self._socket.getsockname()
        return str(host), int(port)

    @property
    def on_loopback(self) -> bool:
        """Whether the port is open to this machine only."""
        return ipaddress.ip_address(self.address[0].partition("%")[0]).is_loopback

    def wait(self, seconds: float) -> bool:
        """Wait for a datagram, at most so long; True if there is one."""
        return bool(select.select([self._socket], [], [], seconds)[0])

    def take(self) -> list[Datagram]:
        """All datagrams that have come, oldest first."""
        taken: list[Datagram] = []
        while True:
            try:
                data, peer = self._socket.recvfrom(_LONGEST_BYTES)
            except BlockingIOError:
                return taken
            except ConnectionError:  # an answer to an earlier reply: whoever asked is gone
                continue
            taken.append((data, (str(peer[0]), int(peer[1]))))

    def send(self, data: bytes, peer: Peer) -> None:
        """Send a reply; raises LinkError where the system refuses to."""
        try:
            self._socket.sendto(data, peer)
        except OSError as error:
            raise LinkError(f"reply to {peer[0]}:{peer[1]}: {error.strerror or error}") from error

    def close(self) -> None:
        """Free the port."""
        self._socket.close()


def _url(bind: str) -> LinkUrl:
    try:
        return parse_url(f"udpin:{bind}")
    except InputError as error:
        raise InputError(f"--bind {bind!r}: allowed: HOST:PORT, such as 127.0.0.1:9002") from error
