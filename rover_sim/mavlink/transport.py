"""How frames travel: the transport interface, and pymavlink-style URLs to transports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from rover_sim.errors import InputError

ALLOWED_URLS = "udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or /dev/DEVICE,SPEED"
_DEFAULT_SPEED = "57600"


class Transport(Protocol):
    """One link with any number of peers, each named by a string; no call ever blocks.

    The time is passed in: it delays frames on simulated links and lets silent peers expire on real ones.
    """

    @property
    def is_stream(self) -> bool:
        """True if frames may be cut anywhere, False if each chunk holds whole frames."""
        ...

    def peers(self, time_s: float) -> tuple[str, ...]:
        """The peers that can be sent to now."""
        ...

    def send(self, frame: bytes, peer: str, time_s: float) -> None:
        """Send to one peer; what cannot be sent is lost."""
        ...

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:
        """What has arrived since the last call, each chunk with its peer."""
        ...

    def handles(self) -> tuple[int, ...]:
        """Files that the system tells of news on the link, as `select` takes them; none for a link in memory."""
        ...

    def close(self) -> None:
        """Release the link; may be called twice."""
        ...


@runtime_checkable
class Learner(Protocol):
    """A transport whose peers are whoever has spoken, so that a stranger can be turned away."""

    def forget(self, peer: str) -> None:
        """Drop a peer until it speaks again."""
        ...


@dataclass(frozen=True)
class LinkUrl:
    """A parsed link URL."""

    text: str
    kind: str  # udpin | udpout | tcp | tcpin | serial
    host: str  # or the device
    port: int  # or the speed, baud


def parse_url(text: str) -> LinkUrl:
    """Parse ``KIND:HOST:PORT``; raises InputError that names the URL and what is allowed."""
    if text.startswith(("/dev/", "serial:/")):
        return _serial_url(text)
    kind, _, rest = text.partition(":")
    host, _, port = rest.rpartition(":")
    if kind not in ("udpin", "udpout", "tcp", "tcpin"):
        raise InputError(f"link {text!r}: unknown kind {kind!r}; allowed: {ALLOWED_URLS}")
    host = host.removeprefix("//").strip("[]")
    if not host:
        raise InputError(f"link {text!r}: no host; allowed: {ALLOWED_URLS}")
    least = 0 if kind in ("udpin", "tcpin") else 1  # 0: the system chooses a free one
    if not (port.isascii() and port.isdigit() and least <= int(port) <= 65535):
        raise InputError(f"link {text!r}: port {port!r}; allowed: a whole number {least} to 65535")
    return LinkUrl(text, kind, host, int(port))


def _serial_url(text: str) -> LinkUrl:
    """``/dev/DEVICE,SPEED`` or ``serial:/dev/DEVICE:SPEED``; 57600 baud where no speed is given."""
    rest = text.removeprefix("serial:").replace(",", ":", 1)
    device, _, speed = rest.partition(":")
    speed = speed or _DEFAULT_SPEED
    if not (speed.isascii() and speed.isdigit()):
        raise InputError(f"link {text!r}: speed {speed!r}; allowed: a standard one such as 57600 or 115200")
    return LinkUrl(text, "serial", device, int(speed))


def open_link(text: str) -> Transport:
    """Open the link of a URL.

    Raises InputError (bad URL, unknown host) or LinkError (port in use, nobody answers), one line naming the URL.
    """
    from rover_sim.mavlink.serial_port import SerialPort
    from rover_sim.mavlink.tcp import TcpClient, TcpServer
    from rover_sim.mavlink.udp import UdpIn, UdpOut

    url = parse_url(text)
    match url.kind:
        case "udpin":
            return UdpIn(url)
        case "udpout":
            return UdpOut(url)
        case "tcpin":
            return TcpServer(url)
        case "serial":
            return SerialPort(url)
        case _:
            return TcpClient(url)
