"""PX4 on a board, on a serial line or USB: one line for its simulator, its planner and the ground stations.

In HITL the board's clock is its own. So the world goes at the pace of the wall clock, and the line carries the board's
usual MAVLink beside the HIL messages: whoever else wants to talk to it must be let through.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from rover_sim.errors import InputError, LinkError
from rover_sim.mavlink.serial_port import SerialPort
from rover_sim.mavlink.transport import LinkUrl, Transport, open_link, parse_url

DEFAULT_SPEED = 921600
# A step's HIL_SENSOR takes up to 77 bytes, and a byte on the line ten bits: 250 of them a second, and a little else.
_LEAST_SPEED = 230400
_STATION_KINDS = ("udpin", "udpout")
Chunks = list[tuple[str, bytes]]


def is_board(bind: str) -> bool:
    """Whether ``--bind`` names a device rather than an address."""
    return bind.startswith("/dev/")


class BoardPort:
    """The device of a board; when it is gone, as while a board on USB starts again, it is looked for anew."""

    is_stream = True

    def __init__(self, url: LinkUrl) -> None:
        """Raises LinkError without a device, InputError for its speed."""
        self._url = url
        self._port, self._count = SerialPort(url), 1

    def peers(self, time_s: float) -> tuple[str, ...]:
        """The board, under another name after each start."""
        return (self._name,) if self._port.peers(time_s) else ()

    def send(self, frame: bytes, peer: str, time_s: float) -> None:
        """Send whole frames."""
        if peer == self._name:
            self._port.send(frame, self._url.host, time_s)

    def receive(self, time_s: float) -> Chunks:
        """Bytes since the last call."""
        if not self._port.peers(time_s):
            self._look_again()
        return [(self._name, data) for _, data in self._port.receive(time_s)]

    def handles(self) -> tuple[int, ...]:
        """The device, while it is there."""
        return self._port.handles()

    def close(self) -> None:
        """Release the device."""
        self._port.close()

    @property
    def _name(self) -> str:
        return f"{self._url.host} {self._count}"

    def _look_again(self) -> None:
        with suppress(LinkError):  # still away: the next call looks again
            self._port, self._count = SerialPort(self._url), self._count + 1


def open_board(bind: str) -> BoardPort:
    """The line of ``/dev/DEVICE[,SPEED]``; raises InputError for a bad speed, LinkError without a device."""
    url = parse_url(bind if "," in bind else f"{bind},{DEFAULT_SPEED}")
    if url.port < _LEAST_SPEED:
        raise InputError(
            f"--bind {bind!r}: speed {url.port} is too slow for sensors at 250 Hz; "
            f"allowed: {_LEAST_SPEED} or more (USB ignores the number)"
        )
    return BoardPort(url)


class LineEnd:
    """One user of a shared line; it hears all that comes, and what it sends goes out whole."""

    is_stream = True

    def __init__(self, line: SharedLine) -> None:
        self._line = line
        self.waiting: Chunks = []

    def peers(self, time_s: float) -> tuple[str, ...]:
        """The board, while the device is there."""
        return self._line.transport.peers(time_s)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:
        """Send whole frames."""
        self._line.transport.send(frame, peer, time_s)

    def receive(self, time_s: float) -> Chunks:
        """Bytes since the last call."""
        self._line.pull(time_s)
        chunks, self.waiting = self.waiting, []
        return chunks

    def handles(self) -> tuple[int, ...]:
        """The device."""
        return self._line.transport.handles()

    def close(self) -> None:
        """Forget what was not taken; the line is for others too, and stays open."""
        self.waiting = []


class SharedLine:
    """A line with a simulator's end, a planner's end, and ground stations to which all is passed on.

    Stations speak by datagrams, which hold whole frames, so that nobody's frames are cut by another's.
    """

    def __init__(self, transport: Transport, stations: Sequence[str] = ()) -> None:
        """``stations``: URLs; raises InputError or LinkError if one cannot be opened, and then closes ``transport``."""
        self.transport = transport
        self.simulator, self.planner = LineEnd(self), LineEnd(self)
        self._stations: list[Transport] = []
        try:
            for url in stations:
                self._stations.append(_station(url))
        except BaseException:
            self.close()
            raise

    def pull(self, time_s: float) -> None:
        """Take what has come from the board to all, and what stations say to the board."""
        chunks = self.transport.receive(time_s)
        for end in (self.simulator, self.planner):
            end.waiting += chunks
        for station in self._stations:
            said = station.receive(time_s)
            for _, data in chunks:
                for peer in station.peers(time_s):
                    station.send(data, peer, time_s)
            for board in self.transport.peers(time_s):
                for _, data in said:
                    self.transport.send(data, board, time_s)

    def close(self) -> None:
        """Close the line and the links to stations."""
        for link in (self.transport, *self._stations):
            link.close()


def _station(url: str) -> Transport:
    if parse_url(url).kind not in _STATION_KINDS:
        raise InputError(f"--connect {url!r}: allowed beside a board: udpin:HOST:PORT or udpout:HOST:PORT")
    return open_link(url)
