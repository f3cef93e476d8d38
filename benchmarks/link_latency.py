"""Delays, jitter and cost of the link of a served rover on this machine: ``python benchmarks/link_latency.py``.

The rover is ``rover-sim serve demo`` in a process of its own with two ground stations on the loopback. One of them
connects as QGroundControl does (``tests/qgc_replay.py``), sends the rover driving and asks; the other one listens. The
cost is the processor time of the link's own calls in a rover that is stepped in this process. Whatever else the machine
does is in the delays, so the load is printed, and what a process that only echoes needs at the same time.
"""

from __future__ import annotations

import argparse
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rover_sim.autopilot.modes import Mode
from rover_sim.live import LiveRover
from rover_sim.mavlink.dialect import Message, Packer, Parser, mavlink
from rover_sim.mavlink.persona import PERSONAS, Persona
from rover_sim.sim.rover import load_rover
from tests.qgc_replay import Qgc
from worlds.build import build_world
from worlds.scenario import load_scenario

START_S = 90.0  # until a loaded machine has built the world
CHANGES, ASKED, LISTEN_S = 60, 600, 40.0
DRIVE_M = 25.0
DEGREES_E7_A_METRE = 115.0  # of longitude, about, at the demo's latitude
_MODES = (Mode.MANUAL, Mode.HOLD)


class Station:
    """A ground station that notes when each message comes."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.packer, self.parser = Packer(255, 190), Parser()
        self.port = int(self.socket.getsockname()[1])

    def meet(self) -> None:
        """Wait for the rover's first datagram, and talk to it from then on."""
        if not select.select([self.socket], [], [], START_S)[0]:
            raise SystemExit("the rover did not come up")
        self.socket.connect(self.socket.recvfrom(65536)[1])

    def send(self, message: Message) -> None:
        """Send one message."""
        self.socket.sendall(self.packer.pack(message))

    def listen(self, seconds: float) -> Iterator[tuple[float, Message]]:
        """Messages and when they came, for so long."""
        end_s = time.perf_counter() + seconds
        while (left_s := end_s - time.perf_counter()) > 0.0:
            if select.select([self.socket], [], [], left_s)[0]:
                data, now_s = self.socket.recv(65536), time.perf_counter()
                yield from ((now_s, message) for message in self.parser.datagram(data))

    def wait(self, wanted: Callable[[Message], bool], seconds: float = 3.0) -> float | None:
        """When the next such message came; None if it did not."""
        return next((now_s for now_s, message in self.listen(seconds) if wanted(message)), None)


@contextmanager
def served(persona: str, stations: list[Station]) -> Iterator[None]:
    """A rover in a process of its own that sends to these stations."""
    with tempfile.TemporaryDirectory() as folder:
        links = [part for one in stations for part in ("--connect", f"udpout:127.0.0.1:{one.port}")]
        script = "from rover_sim.cli import main; raise SystemExit(main())"
        command = [sys.executable, "-c", script, "serve", "demo", "--persona", persona, "--out", folder, *links]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:  # noqa: S603
            try:
                yield
            finally:
                process.send_signal(signal.SIGINT)
                process.wait(30)


def connect_s(persona: Persona, station: Station) -> tuple[float, Qgc]:
    """Seconds until QGroundControl is ready, and its notes."""
    qgc = Qgc(persona, station.socket.sendall)
    script, start_s = qgc.connect(), time.perf_counter()
    while True:
        if select.select([station.socket], [], [], 0.002)[0]:
            qgc.hear(station.socket.recv(65536))
        qgc.look(time.perf_counter())
        try:
            next(script)
        except StopIteration:
            return time.perf_counter() - start_s, qgc


def changes_ms(persona: Persona, station: Station) -> list[float]:
    """From a command that changes mode or arming to the heartbeat that tells it."""
    delays = []
    for count in range(CHANGES):
        message, told = _arming(count // 3 % 2 == 0) if count % 3 == 2 else _mode(persona, _MODES[count % 3])
        start_s = time.perf_counter()
        station.send(message)
        found_s = station.wait(told)
        delays.append(np.inf if found_s is None else 1e3 * (found_s - start_s))
        time.sleep(0.05 + 0.03 * (count % 7))
    return delays


def _arming(on: bool) -> tuple[Message, Callable[[Message], bool]]:
    return _command(
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM, on
    ), lambda one: one.get_type() == "HEARTBEAT" and bool(one.base_mode & 128) == on


def _mode(persona: Persona, mode: Mode) -> tuple[Message, Callable[[Message], bool]]:
    number = persona.numbers[mode]
    parameters = (1, number >> 16 & 255, number >> 24) if persona.px4_modes else (1, number)
    return _command(
        mavlink.MAV_CMD_DO_SET_MODE, *parameters
    ), lambda one: one.get_type() == "HEARTBEAT" and one.custom_mode == number


_ECHO = """
import socket
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.bind(("127.0.0.1", 0))
print(link.getsockname()[1], flush=True)
while True:
    data, peer = link.recvfrom(65536)
    link.sendto(data, peer)
"""


def echoes_ms() -> list[float]:
    """What this machine makes of a process that answers at once."""
    delays = []
    with subprocess.Popen([sys.executable, "-c", _ECHO], stdout=subprocess.PIPE, text=True) as process:  # noqa: S603
        assert process.stdout is not None
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.connect(("127.0.0.1", int(process.stdout.readline())))
            for count in range(ASKED):
                start_s = time.perf_counter()
                link.send(b"?")
                link.recv(16)
                delays.append(1e3 * (time.perf_counter() - start_s))
                time.sleep(0.005 + 0.001 * (count % 40))
        process.kill()
    return delays


def acks_ms(station: Station, seed: int = 1) -> list[float]:
    """From a command to its acknowledgement, at times that the rover does not know."""
    rng, delays = np.random.default_rng(seed), []
    message = _command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE)
    for _ in range(ASKED):
        start_s = time.perf_counter()
        station.send(message)
        found_s = station.wait(lambda one: one.get_type() == "COMMAND_ACK" and one.command == message.command)
        delays.append(np.inf if found_s is None else 1e3 * (found_s - start_s))
        time.sleep(float(rng.uniform(0.005, 0.045)))
    return delays


def jitter_ms(station: Station) -> dict[str, list[float]]:
    """How far the gaps between two messages of a stream are from its period; and the rover's own clock against ours."""
    periods_s = {"ATTITUDE": 0.1, "GLOBAL_POSITION_INT": 0.2, "VFR_HUD": 0.25}
    while select.select([station.socket], [], [], 0.0)[0]:
        station.socket.recv(65536)  # what came while nobody read
    came: dict[str, list[float]] = {name: [] for name in periods_s}
    stamps: list[tuple[float, float]] = []
    for now_s, message in station.listen(LISTEN_S):
        name = message.get_type()
        if name in came:
            came[name].append(now_s)
        if name == "ATTITUDE":
            stamps.append((now_s, message.time_boot_ms / 1e3))
    gaps = {name: list(1e3 * np.abs(np.diff(times) - periods_s[name])) for name, times in came.items()}
    factor = (stamps[-1][1] - stamps[0][1]) / (stamps[-1][0] - stamps[0][0])
    print(f"  real-time factor {factor:.3f}, {len(stamps)} ATTITUDE in {LISTEN_S:.0f} s")
    return gaps


def drive(persona: Persona, station: Station, east_m: float) -> None:
    """Armed and on the way to a place."""
    qgc = Qgc(persona, station.socket.sendall)
    station.send(_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1))
    place = next(one for _, one in station.listen(5.0) if one.get_type() == "GLOBAL_POSITION_INT")
    next(qgc.go_to(place.lat, place.lon + round(east_m * DEGREES_E7_A_METRE), first=False))
    if station.wait(lambda one: one.get_type() == "VFR_HUD" and one.groundspeed > 0.1, 15.0) is None:
        raise SystemExit("the rover does not drive")


def cost_share(persona: Persona, seconds: float = 60.0) -> tuple[float, float]:
    """Processor time of the link with two stations, as a share of simulated time; and that of the whole rover."""
    scenario = load_scenario("demo")
    world, stations = build_world(scenario, 0, source="demo"), [Station(), Station()]
    spent = [0.0]

    def metered(call: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any) -> Any:
            start_s = time.thread_time()
            try:
                return call(*arguments)
            finally:
                spent[0] += time.thread_time() - start_s

        return run

    urls = [f"udpout:127.0.0.1:{station.port}" for station in stations]
    with tempfile.TemporaryDirectory() as folder:
        rover = LiveRover(world, load_rover(scenario.rover.model), persona, urls, Path(folder) / "log.tlog")
        with rover:
            for name in ("tick", "answer"):
                setattr(rover.vehicle, name, metered(getattr(rover.vehicle, name)))
            rover.autopilot.parameters.set("CRUISE_SPEED", 0.6)
            for _ in range(240):
                rover.step()
            rover.autopilot.arm()
            rover.autopilot.goto((40.0, 0.0, 0.0))
            spent[0], start_s = 0.0, time.thread_time()
            for step in range(round(240 * seconds)):
                rover.step()
                if step % 48 == 0:
                    for station in stations:
                        while select.select([station.socket], [], [], 0.0)[0]:
                            station.socket.recv(65536)
            whole_s = time.thread_time() - start_s
    return spent[0] / seconds, whole_s / seconds


def _command(number: int, *parameters: float) -> Message:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *parameters, *(0.0,) * (7 - len(parameters)))


def _figures(delays: list[float]) -> str:
    p50, p95, p99, most = np.percentile(delays, [50, 95, 99, 100])
    return f"p50 {p50:5.1f}  p95 {p95:5.1f}  p99 {p99:5.1f}  most {most:6.1f} ms of {len(delays)}"


def main() -> None:
    """Print all figures for each persona."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--persona", choices=list(PERSONAS), action="append", help="one or more (default: all)")
    for name in parser.parse_args().persona or PERSONAS:
        persona, first, second = PERSONAS[name], Station(), Station()
        print(f"{name}: load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
        with served(name, [first, second]):
            first.meet()
            second.meet()
            time.sleep(3.0)
            ready_s, qgc = connect_s(persona, first)
            print(f"  QGroundControl ready after {ready_s:.2f} s, retries {qgc.retries}, complaints {qgc.complaints}")
            print(f"  heartbeat after a change  {_figures(changes_ms(persona, first))}")
            drive(persona, first, DRIVE_M)
            print(f"  acknowledgement           {_figures(acks_ms(first))}")
            print(f"  a process that echoes     {_figures(echoes_ms())}")
            drive(persona, first, -DRIVE_M)
            for stream, gaps in jitter_ms(second).items():
                print(f"  jitter {stream:<19}{_figures(gaps)}")
        link, whole = cost_share(persona)
        print(
            f"  link {100 * link:.2f} % of a core, the whole rover {100 * whole:.1f} %; load {os.getloadavg()[0]:.1f}"
        )


if __name__ == "__main__":
    main()
