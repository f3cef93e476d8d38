"""The joined double over loopback UDP: a process of its own to the program under test.

    uv run python -m tests.ardupilot_udp rover.parm --home LAT,LNG,ALT,YAW [--physics 127.0.0.1:9002] ...

Started so it stands in for ArduPilot's simulator, to try a command without it; it imitates and is not ArduPilot.
"""

from __future__ import annotations

import argparse
import select
import socket
import sys
from pathlib import Path
from typing import Self

from rover_sim.mavlink.transport import open_link
from rover_sim.pacing import WallClock
from tests.ardupilot_vehicle import JoinedVehicle
from worlds.scenario import Origin

Address = tuple[str, int]


class UdpVehicle:
    """Both sides on sockets; `serve` is called in a loop."""

    def __init__(self, physics: Address, mavlink_url: str, home: Origin, parameters: dict[str, float]) -> None:
        self._transport = open_link(mavlink_url)
        self.vehicle = JoinedVehicle(self._transport, home, parameters)
        self._physics, self._clock = physics, WallClock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()
        self._transport.close()

    def serve(self, seconds: float) -> None:
        """Send what is to be sent, then wait for replies, at most so long."""
        double = self.vehicle.json
        for data in double.packets(self._clock.elapsed_s()):
            self._socket.sendto(data, self._physics)
        select.select([self._socket], [], [], seconds)
        while True:
            try:
                double.deliver(self._socket.recv(65536))
            except BlockingIOError:
                return
            except ConnectionError:  # nobody listens there yet
                continue


def read_parameters(path: Path) -> dict[str, float]:
    """NAME VALUE lines; others are comments."""
    pairs = (line.split() for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
    return {name: float(value) for name, value in pairs}


def address(text: str) -> Address:
    host, _, port = text.rpartition(":")
    return host, int(port)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parameters", type=Path, help="the file that --write-params wrote")
    parser.add_argument("--home", required=True, metavar="LAT,LNG,ALT,YAW")
    parser.add_argument("--physics", type=address, default=("127.0.0.1", 9002), metavar="HOST:PORT")
    parser.add_argument("--mavlink", default="udpout:127.0.0.1:14550", metavar="URL")
    parser.add_argument("--patience", type=float, default=60.0, help="seconds without a new step after which it ends")
    args = parser.parse_args()
    latitude, longitude, altitude, *_ = (float(part) for part in args.home.split(","))
    clock, count, heard_s = WallClock(), 0, 0.0
    home = Origin(latitude, longitude, altitude)
    with UdpVehicle(args.physics, args.mavlink, home, read_parameters(args.parameters)) as udp:
        while clock.elapsed_s() - heard_s < args.patience:
            udp.serve(0.1)
            if udp.vehicle.json.count != count:
                count, heard_s = udp.vehicle.json.count, clock.elapsed_s()
    print(f"{count} steps, {udp.vehicle.json.clock_s:.1f} s")  # noqa: T201 - a program's result
    return 0


if __name__ == "__main__":
    sys.exit(main())
