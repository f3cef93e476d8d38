"""The TCP port to which PX4 connects."""

from __future__ import annotations

from rover_sim.errors import InputError, LinkError
from rover_sim.mavlink.tcp import TcpServer
from rover_sim.mavlink.transport import parse_url

_ALLOWED = "HOST:PORT, such as 127.0.0.1:4560, or a board's /dev/DEVICE,SPEED"


def open_port(bind: str) -> TcpServer:
    """A listening port with room for one PX4; raises InputError for a bad address, LinkError if it is taken."""
    try:
        url = parse_url(f"tcpin:{bind}")
    except InputError as error:
        raise InputError(f"--bind {bind!r}: allowed: {_ALLOWED}") from error
    try:
        return TcpServer(url, most_clients=1)
    except LinkError as error:
        hint = "another simulator may wait there: stop it, or give PX4 and this one another port"
        raise LinkError(f"--bind {bind}: {str(error).partition(': ')[2]} ({hint})") from error
