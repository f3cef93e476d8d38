"""TCP links: one connection out, or any number in. A connection that breaks is a peer that is gone."""

from __future__ import annotations

import math
import select
import socket

from rover_sim.mavlink.sockets import CHUNK_BYTES, bound, connected, connecting, name
from rover_sim.mavlink.transport import LinkUrl

_CONNECT_S = 3.0
_AGAIN_S = 1.0
_MOST_CLIENTS = 32
_MOST_UNSENT_BYTES = 262144  # a peer that stops reading is cut off, as a dead one


class _Connection:
    """One connected socket with the bytes that it has not taken yet."""

    def __init__(self, link: socket.socket) -> None:
        link.setblocking(False)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = link
        self._unsent = bytearray()
        self.open = True

    def send(self, data: bytes) -> None:
        self._unsent += data
        self.flush()

    def flush(self) -> None:
        try:
            while self._unsent and self.open:
                del self._unsent[: self._socket.send(self._unsent)]
        except BlockingIOError:
            pass
        except OSError:
            self.close()
        if len(self._unsent) > _MOST_UNSENT_BYTES:
            self.close()

    def receive(self) -> bytes:
        if not self.open:
            return b""
        try:
            data = self._socket.recv(CHUNK_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.close()
        return data

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self.open = False
        self._socket.close()


class _TcpLink:
    """Connections by peer name."""

    is_stream = True

    def __init__(self) -> None:
        self._connections: dict[str, _Connection] = {}

    def peers(self, time_s: float) -> tuple[str, ...]:  # noqa: ARG002  (the interface passes the time)
        """The peers that are connected."""
        self._connections = {peer: connection for peer, connection in self._connections.items() if connection.open}
        return tuple(self._connections)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:  # noqa: ARG002
        """Send to one peer."""
        if peer in self._connections:
            self._connections[peer].send(frame)

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:  # noqa: ARG002
        """Bytes since the last call."""
        chunks = []
        for peer, connection in self._connections.items():
            connection.flush()
            chunks.append((peer, connection.receive()))
        return [(peer, data) for peer, data in chunks if data]

    def handles(self) -> tuple[int, ...]:
        """The connections that are open."""
        return tuple(connection.fileno() for connection in self._connections.values() if connection.open)

    def close(self) -> None:
        """Close all connections."""
        for connection in self._connections.values():
            connection.close()


class TcpClient(_TcpLink):
    """One connection to a server; once it breaks it is tried anew every second."""

    def __init__(self, url: LinkUrl) -> None:
        super().__init__()
        self._url = url
        self._pending: socket.socket | None = None
        self._try_s = -math.inf
        self._adopt(connected(url, socket.SOCK_STREAM, _CONNECT_S))

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        """Bytes since the last call; a lost connection is renewed in here, without blocking."""
        if not self.peers(time_s):
            self._reconnect(time_s)
        return super().receive(time_s)

    def close(self) -> None:
        """Close the connection for good."""
        self._try_s = math.inf
        if self._pending is not None:
            self._pending.close()
            self._pending = None
        super().close()

    def _adopt(self, link: socket.socket) -> None:
        self._connections[name(link.getpeername())] = _Connection(link)

    def _reconnect(self, time_s: float) -> None:
        if self._pending is not None and select.select([], [self._pending], [], 0.0)[1]:
            link, self._pending = self._pending, None
            if link.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) == 0:
                self._adopt(link)
            else:
                link.close()
        elif time_s >= self._try_s:
            if self._pending is not None:
                self._pending.close()
            self._try_s = time_s + _AGAIN_S
            self._pending = connecting(self._url)


class TcpServer(_TcpLink):
    """A listening port; every client is a peer, and those beyond ``most_clients`` wait for their turn."""

    def __init__(self, url: LinkUrl, most_clients: int = _MOST_CLIENTS) -> None:
        super().__init__()
        self._most_clients = most_clients
        self._listener = bound(url, socket.SOCK_STREAM)
        self._listener.listen()

    @property
    def port(self) -> int:
        """The port in use: that of the URL, or the one the system chose for port 0."""
        return int(self._listener.getsockname()[1])

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        """Bytes since the last call; new clients are taken in here."""
        while len(self.peers(time_s)) < self._most_clients:
            try:
                link, address = self._listener.accept()
            except OSError:  # nobody waits, or whoever did has gone
                break
            self._connections[name(address)] = _Connection(link)
        return super().receive(time_s)

    def handles(self) -> tuple[int, ...]:
        """The connections, and the port as long as there is room for more."""
        room = len(self._connections) < self._most_clients
        return (*super().handles(), *([self._listener.fileno()] if room else []))

    def close(self) -> None:
        """Close the port and all connections."""
        self._listener.close()
        super().close()
