"""What UDP and TCP links share: names to addresses, and socket errors as one line."""

from __future__ import annotations

import errno
import socket
from typing import Any

from rover_sim.errors import InputError, LinkError
from rover_sim.mavlink.transport import LinkUrl

Address = tuple[Any, ...]
CHUNK_BYTES = 65536


def resolve(url: LinkUrl, kind: socket.SocketKind) -> tuple[socket.AddressFamily, Address]:
    """Family and address of the URL's host; raises InputError if the name is unknown."""
    try:
        family, _, _, _, address = socket.getaddrinfo(url.host, url.port, type=kind)[0]
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"link {url.text!r}: host {url.host!r} is unknown; allowed: an address or a name that resolves"
        ) from error
    return family, address


def bound(url: LinkUrl, kind: socket.SocketKind) -> socket.socket:
    """Non-blocking socket bound to the URL's host and port; raises LinkError if it is taken or not ours."""
    family, address = resolve(url, kind)
    link = socket.socket(family, kind)
    if kind is socket.SOCK_STREAM:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        link.bind(address)
    except OSError as error:
        link.close()
        raise LinkError(f"link {url.text!r}: {_bind_reason(url, error)}") from error
    link.setblocking(False)
    return link


def connected(url: LinkUrl, kind: socket.SocketKind, timeout_s: float) -> socket.socket:
    """Non-blocking socket connected to the URL's host and port; raises LinkError if nobody answers in time."""
    family, address = resolve(url, kind)
    link = socket.socket(family, kind)
    link.settimeout(timeout_s)
    try:
        link.connect(address)
    except OSError as error:
        link.close()
        raise LinkError(f"link {url.text!r}: cannot connect ({error.strerror or error})") from error
    link.setblocking(False)
    return link


def connecting(url: LinkUrl) -> socket.socket:
    """Non-blocking TCP socket on its way to the URL's host and port; writable once that has worked or failed."""
    family, address = resolve(url, socket.SOCK_STREAM)
    link = socket.socket(family, socket.SOCK_STREAM)
    link.setblocking(False)
    link.connect_ex(address)
    return link


def name(address: Address) -> str:
    """A peer's name."""
    return f"{address[0]}:{address[1]}"


def _bind_reason(url: LinkUrl, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {url.port} is in use; choose a free one"
    if error.errno == errno.EACCES:
        return f"port {url.port} needs privileges; choose one from 1024 to 65535"
    return f"cannot listen on {url.host!r} ({error.strerror}); allowed: an address of this machine, such as 127.0.0.1"
