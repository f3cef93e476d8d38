"""How steadily PX4 is fed at 250 Hz, how far lockstep slips, and what another physics rate changes.

    OMP_NUM_THREADS=1 uv run python benchmarks/hil_px4_rate.py [--seconds 20]

PX4 is a double in a process of its own, behind a real socket or a pseudo-terminal; it is not PX4. `bare` is physics
and sensors alone; `camera` is a traverse of rock-field that sees and plans twice a second, with nobody to drive it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from rover_sim.driven_rover import home
from rover_sim.hil.autopilot_link import AutopilotLink
from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.px4_link import open_port
from rover_sim.hil.px4_peer import BOARD, PROGRAM, Profile, Px4Peer
from rover_sim.hil.px4_session import STEPS_PER_S, Clockwork, Px4Session
from rover_sim.hil.serial_board import open_board
from rover_sim.hil.session import Driven
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.transport import Transport
from rover_sim.outcome import Reason
from rover_sim.pacing import Pace, wait_for_news
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.traverse import RunOptions, Stepped, Traverse
from tests.px4_board import BoardOnPty, Px4Board
from tests.px4_double import Px4Double, Px4Process, armed_from
from tests.px4_rig import Drive, session
from tests.sim_factory import make_world, slope
from worlds.build import build_world
from worlds.scenario import load_scenario

ARMED = armed_from(1.0, 0.1, 0.1)


class Ending(Traverse):
    """A traverse that ends after so many simulated seconds."""

    seconds = 20.0

    def step(self, on_sight: Callable[..., None] = lambda _: None) -> Stepped:
        """As a traverse, but for the end."""
        stepped = super().step(on_sight)
        return stepped if self.simulation.time_s < self.seconds else Stepped(stepped.looked, (Reason.TIMEOUT, ""))


@contextmanager
def child(*words: str) -> Iterator[str]:
    """This script as the other side; what it says first, and later what it found."""
    with subprocess.Popen([sys.executable, __file__, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:  # noqa: S603 - itself
        assert process.stdin is not None
        assert process.stdout is not None
        yield process.stdout.readline().decode().strip()
        process.stdin.close()
        print("     ", process.stdout.read().decode().strip())


def be_px4(port: int) -> None:
    """A PX4 at a port, until our input ends."""
    with Px4Process(port, Px4Double(ARMED), within_s=600.0) as process:
        print("ready", flush=True)
        sys.stdin.read()
    print(f"the double: {process.px4.checks.believed.sensors} steps, {process.poll_timeouts} time-outs of 1 s")


def be_board() -> None:
    """A board on a pseudo-terminal, until our input ends."""
    with BoardOnPty(Px4Board(ARMED), within_s=600.0) as board:
        print(board.device, flush=True)
        sys.stdin.read()
    gaps_ms = 1e3 * np.array(board.gaps_s)
    half, most = np.percentile(gaps_ms, [50, 99])
    print(f"the board: samples arrive {half:.2f} ms apart (median), p99 {most:.1f}, longest {gaps_ms.max():.1f}")


def bare(transport: Transport, profile: Profile, seconds: float, *, paced: bool) -> Px4Session:
    """Physics and sensors alone."""
    drive = Drive(make_world(slope(0.0, 24.0)), seconds)
    left_s = Pace(profile.forgiven_s).left_s if paced else lambda _: 0.0
    return session(drive, transport, wait_for_news, left_s=left_s, profile=profile)


def camera(transport: Transport, profile: Profile, seconds: float, *, paced: bool) -> Px4Session:
    """A traverse that sees and plans, without anybody at the planner's link."""
    world, rover = build_world(load_scenario("rock-field"), 0), load_rover("husky")
    frame, Ending.seconds = LocalFrame(world.origin), seconds
    left_s = Pace(profile.forgiven_s).left_s if paced else lambda _: 0.0

    def begin() -> Driven:
        link, outputs = AutopilotLink(frame, home(world), memory_link()[0]), OutputDriver(rover.footprint())
        return Driven(Ending(world, rover, outputs, link, RunOptions(link_grace_s=1e6), STEPS_PER_S), outputs)

    def meet(driven: Driven) -> Px4Peer:
        x, y, z = driven.traverse.simulation.chassis_motion[:3].tolist()
        return Px4Peer(transport, frame, (x, y, z), "the link", profile)

    return Px4Session(begin, meet, Clockwork(wait_for_news, left_s, 60.0))


def measure(name: str, make: Callable[..., Px4Session], seconds: float, *, board: bool, paced: bool) -> None:
    """One line: rate, intervals, slip."""
    port = None if board else open_port("127.0.0.1:0")
    words = ("--board",) if port is None else ("--px4", str(port.port))
    with child(*words) as said:
        transport: Transport = open_board(said) if port is None else port
        with make(transport, BOARD if board else PROGRAM, seconds, paced=paced) as served:
            begin_s = time.perf_counter()
            hil = served.run()["hil"]
            factor = seconds / (time.perf_counter() - begin_s)
        transport.close()
    beat, slip = hil["beat"], hil["lockstep"]
    text = f"{name:28} {beat['rate_hz']:7.1f} Hz, median {beat['median_ms']:.2f} ms, p99 {beat['p99_ms']:.2f}, "
    text += f"longest {beat['longest_ms']:.1f}; {factor:.2f} x real time"
    print(text if slip is None else f"{text}; slip at most {slip['most_steps']}, late {slip['late']}/{slip['answers']}")


def physics_rates() -> None:
    """The same ten seconds of driving at several step rates, against 500 Hz."""
    scenario, rover = load_scenario("rock-field"), load_rover("husky")
    for seed in range(3):
        world, ends = build_world(scenario, seed), {}
        for rate_hz in (240, 250, 500):
            outputs = OutputDriver(rover.footprint())
            with Simulation(world, rover, np.random.default_rng(0), time_step_s=1.0 / rate_hz) as simulation:
                for step in range(10 * rate_hz):
                    time_s = step / rate_hz
                    outputs.set(*((0.5, 0.5) if time_s < 4.0 else (0.2, 0.6) if time_s < 7.0 else (-0.3, 0.3)))
                    simulation.step(outputs.wheel_speed_rad_s)
                ends[rate_hz] = simulation.state
        for rate_hz in (240, 250):
            off_m = np.linalg.norm(ends[rate_hz].pose.position_w - ends[500].pose.position_w)
            print(f"rock-field {seed}, 10 s at {rate_hz} Hz: ends {1e3 * off_m:.1f} mm from where it does at 500 Hz")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--px4", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--board", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.px4 is not None:
        be_px4(args.px4)
    elif args.board:
        be_board()
    else:
        for name, make, board, paced in (
            ("program, bare", bare, False, True),
            ("program, bare, unpaced", bare, False, False),
            ("program, camera", camera, False, True),
            ("board, bare", bare, True, True),
            ("board, camera", camera, True, True),
        ):
            measure(name, make, args.seconds, board=board, paced=paced)
        physics_rates()


if __name__ == "__main__":
    main()
