"""The teleop command as a user meets it: in a terminal, over the loopback, and its mistakes as one line."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from planner.mobility import STOP
from rover_sim.autopilot.modes import Mode
from rover_sim.cli import main
from rover_sim.mavlink.persona import ARDUPILOT, PX4, Persona
from rover_sim.mavlink.transport import parse_url
from rover_sim.mavlink.udp import UdpIn
from tests.mavlink_live import LiveRover

SCRIPT = "from rover_sim.cli import main; raise SystemExit(main())"
LIMIT_S = 40.0  # a loaded machine takes its time to start a process


class Console:
    """A terminal with the command in it."""

    def __init__(self, port: int) -> None:
        self._master, self._slave = pty.openpty()  # both stay open: what the command said last can be read
        arguments = [sys.executable, "-c", SCRIPT, "teleop", f"udpin:127.0.0.1:{port}"]
        self.process = subprocess.Popen(
            arguments, stdin=self._slave, stdout=self._slave, stderr=self._slave, start_new_session=True
        )
        self.shown = ""

    def type(self, text: str) -> None:
        os.write(self._master, text.encode())

    def until(self, done: Callable[[], bool], hold: str = "") -> None:
        """Wait, and hold a key if there is one, until ``done``."""
        end = time.perf_counter() + LIMIT_S
        while not done():
            assert time.perf_counter() < end, self.shown
            if hold:
                self.type(hold)
            if select.select([self._master], [], [], 0.04)[0]:
                self.shown += os.read(self._master, 4096).decode(errors="replace")

    def end(self) -> int:
        """The exit code; what is still shown is read, or the command could not end."""
        self.until(lambda: self.process.poll() is not None)
        return self.process.returncode

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self._master)
        os.close(self._slave)


@contextmanager
def cockpit(persona: Persona) -> Iterator[tuple[LiveRover, Console]]:
    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    port = free.port
    free.close()
    live = LiveRover(f"udpout:127.0.0.1:{port}", persona)
    console = Console(port)
    live.start()
    try:
        yield live, console
    finally:
        console.close()
        live.close()


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_a_rover_is_armed_driven_and_let_go_from_a_terminal(persona: Persona) -> None:
    with cockpit(persona) as (live, console):
        autopilot = live.autopilot
        console.until(lambda: "Hold disarmed" in console.shown)
        console.type("M")
        console.until(lambda: autopilot.mode is Mode.MANUAL)
        assert not autopilot.armed
        console.type("A")
        console.until(lambda: autopilot.armed)
        console.until(lambda: autopilot.motion.linear_m_s > 0.1, hold="i")
        console.until(lambda: autopilot.motion == STOP)  # the key is not held any more
        console.until(lambda: autopilot.motion.linear_m_s < -0.1, hold="\x1b[B")
        console.type("\x1b[O")  # the window has lost the focus
        console.until(lambda: autopilot.motion == STOP)
        console.until(lambda: "loss 0.0 %" in console.shown and "round trip" in console.shown)
        console.until(lambda: autopilot.motion.yaw_rate_rad_s > 0.05, hold="j")
        console.type("q")
        assert console.end() == 0
        live.until(lambda: autopilot.motion == STOP)
        assert autopilot.pilot.sticks is None or autopilot.pilot.sticks.centred


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_however_it_is_ended_neutral_is_the_last_word(number: signal.Signals) -> None:
    with cockpit(ARDUPILOT) as (live, console):
        console.until(lambda: "Hold disarmed" in console.shown)
        console.type("MA")
        console.until(lambda: live.autopilot.armed)
        console.until(lambda: live.autopilot.motion.linear_m_s > 0.1, hold="i")
        console.process.send_signal(number)
        assert console.end() == 0
        live.until(lambda: live.autopilot.motion == STOP, 1.0)  # long before the sticks would count as lost


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["udpin:127.0.0.1:0"], "standard input is not a terminal; allowed: a terminal"),
        (["udpin:127.0.0.1:0", "--gamepad"], "standard input is not a terminal"),
    ],
)
def test_without_a_terminal_it_is_one_line(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False)
    assert main(["teleop", *arguments]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert says in line


def test_a_wrong_system_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["teleop", "udpin:127.0.0.1:0", "--system", "0"])
    assert caught.value.code == 2
    assert "'0' is not a whole number from 1 to 255" in capsys.readouterr().err
