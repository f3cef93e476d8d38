"""Speed of the physics behind ArduPilot's JSON interface: steps a second on one core, over a loopback socket.

    OMP_NUM_THREADS=1 uv run python benchmarks/hil_speed.py [--seconds 20] [--repeat 5]

The world is that of the physics benchmark: 20 m x 20 m of fractal ground with 300 rocks of 8 to 35 cm, soil wheels and
ruts, 240 Hz. A traverse is stepped with all that belongs to it: sensors and pose filter, companion on its link, judge
and trace; without a camera, and with pictures, perception and planner at 2 Hz. The other end of the socket sends
ready-made packets and throws the replies away: its share of the system calls is counted, an autopilot's own work is
not, as it has a core of its own. Figures are medians of processor time.
"""

from __future__ import annotations

import argparse
import itertools
import socket
import sys
import time
from pathlib import Path
from statistics import median
from typing import Self

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.physics_speed import MIXES_M, ROCKS, STARTS_M, command, field_of
from rover_sim.driven_rover import STEPS_PER_S, home
from rover_sim.given_way import Way
from rover_sim.hil.ardupilot import ArduPilotSession, Clockwork
from rover_sim.hil.autopilot_link import AutopilotLink
from rover_sim.hil.lockstep import Datagram, Lockstep, Peer
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.servo_port import ServoPort
from rover_sim.hil.session import Driven, Watchers
from rover_sim.mavlink.foreign_pursuit import Patience
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, Traverse
from tests.ardupilot_double import pack, servos
from worlds.types import World

TARGETS = {"without camera": 2000.0, "pictures, perception and planner at 2 Hz": 1200.0}  # steps a second
GRACE_S = 1e9  # nobody is on the other end of the link for missions


class Autopilot:
    """The port of a session with the other end in the same process: each reply is followed by the next packet."""

    def __init__(self, port: ServoPort, steps: int) -> None:
        self._port, self._steps, self._count = port, steps, 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        fastest = load_rover("husky").motor.max_speed_rad_s
        self._packets = itertools.cycle(
            [
                servos(*(round(1500 + 500 * speed / fastest) for speed in command(step)))
                for step in range(16 * STEPS_PER_S)
            ]
        )
        self._next()

    def wait(self, seconds: float) -> bool:
        """As the port."""
        return self._port.wait(seconds)

    def take(self) -> list[Datagram]:
        """As the port."""
        return self._port.take()

    def send(self, data: bytes, peer: Peer) -> None:
        """As the port; the reply is read and thrown away."""
        self._port.send(data, peer)
        self._socket.recv(4096)
        if self._count <= self._steps:
            self._next()

    @property
    def done(self) -> bool:
        """Whether all steps have been asked for."""
        return self._count > self._steps

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def _next(self) -> None:
        self._socket.sendto(pack(STEPS_PER_S, self._count, next(self._packets)), self._port.address)
        self._count += 1


def drive(world: World, steps: int, *, sees: bool) -> tuple[float, int]:
    """Processor time of the whole session, and the steps that it made: the judge may end it before."""
    rover, (ours, _) = load_rover("husky"), memory_link()
    ahead = Way((world.scenario.rover.start_m, world.scenario.goal.position_m), 1.0)
    options = RunOptions(link_grace_s=GRACE_S, way=None if sees else ahead)

    def begin() -> Driven:
        outputs = OutputDriver(rover.footprint())
        link = AutopilotLink(LocalFrame(world.origin), home(world), ours, patience=Patience(vehicle_s=GRACE_S))
        return Driven(Traverse(world, rover, outputs, link, options), outputs)

    with ServoPort("127.0.0.1:0") as port, Autopilot(port, steps) as autopilot:
        watchers = Watchers(stopped=lambda: autopilot.done)
        clockwork = Clockwork(lambda: 0.0, lambda _: None, GRACE_S)
        with ArduPilotSession(autopilot, Lockstep(loopback_only=True), begin, clockwork, watchers) as session:
            begin_s = time.process_time()
            session.run()
            return time.process_time() - begin_s, round(session.traverse.simulation.time_s * STEPS_PER_S)


def main() -> int:
    """Print a line with and without camera; exit code 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--repeat", type=int, default=5)
    args = parser.parse_args()
    steps, missed = round(args.seconds * STEPS_PER_S), False
    for sees, (name, target) in zip((False, True), TARGETS.items(), strict=True):
        drive(field_of(MIXES_M[0], STARTS_M[0], 0), STEPS_PER_S, sees=sees)  # compiles
        rates = []
        for place in range(args.repeat):
            spent_s, made = drive(field_of(MIXES_M[0], STARTS_M[place % len(STARTS_M)], place), steps, sees=sees)
            rates.append(made / spent_s)
            print(f"   {made} steps, {rates[-1]:.0f} a second", flush=True)
        middle = median(rates)
        missed |= middle < target
        print(
            f"{ROCKS} rocks, {name}: {middle:.0f} steps/s ({min(rates):.0f} to {max(rates):.0f}), "
            f"{middle / STEPS_PER_S:.1f} x real time; target {target / STEPS_PER_S:.1f}",
            flush=True,
        )
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
