"""``rover-sim hil ardupilot`` as a user meets it: messages, exit codes, and a drive under the double over UDP."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from rover_sim.cli import main
from rover_sim.mavlink.mission_file import read_plan, read_waypoints
from rover_sim.run_folder import FILES
from tests import ardupilot_mavlink_double as mavlink_double
from tests.ardupilot_udp import UdpVehicle, read_parameters
from worlds.scenario import Origin

SHORT = """
name = "short"
[terrain]
kind = "flat"
size_m = [12.0, 10.0]
resolution_m = 0.1
[rocks]
cfa = 0.02
min_diameter_m = 0.1
max_diameter_m = 0.4
clear_radius_m = 1.0
[soil]
preset = "firm"
[rover]
heading_deg = 30.0
[goal]
position_m = [3.0, 0.5]
time_limit_s = 60.0
[camera]
rate_hz = 1.0
"""


@pytest.fixture
def short(tmp_path: Path) -> str:
    path = tmp_path / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return str(path)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "AUTOPILOT"),
        (["gazebo"], "invalid choice: 'gazebo'"),
        (["ardupilot", "--bind", "9002"], "--bind '9002': allowed: HOST:PORT, such as 127.0.0.1:9002"),
        (["ardupilot", "--autopilot", "udp:14550"], "link 'udp:14550': unknown kind 'udp'"),
        (["ardupilot", "--wait", "0"], "'0' is not a number of seconds above 0"),
        (["ardupilot", "--seed", "-1"], "--seed"),
        (["ardupilot", "no-such-world"], "no-such-world"),
    ],
)
def test_bad_input_is_one_line_and_code_2(
    arguments: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "out")] if arguments[:1] == ["ardupilot"] else []
    try:
        code = main(["hil", *arguments, *out])
    except SystemExit as ended:
        code = int(str(ended.code))
    assert code == 2
    errors = capsys.readouterr().err
    assert text in errors
    assert "Traceback" not in errors


def test_a_port_in_use_is_a_failed_link(short: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        bind = f"127.0.0.1:{other.getsockname()[1]}"
        assert main(["hil", "ardupilot", short, "--bind", bind, "--out", str(tmp_path / "out")]) == 3
    assert re.search(r"--bind 127.0.0.1:\d+: port \d+ is in use.*another physics", capsys.readouterr().err)


def test_without_an_autopilot_it_says_what_it_waited_for(
    short: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--bind", "127.0.0.1:0", "--autopilot", "udpin:127.0.0.1:0", "--wait", "0.5"]
    assert main(["hil", "ardupilot", short, *arguments, "--out", str(tmp_path / "out")]) == 3
    errors = capsys.readouterr().err
    assert "no autopilot has asked for a step of the physics in 0.5 s" in errors
    assert "--model JSON:127.0.0.1" in errors
    assert "--rate 240" in errors


def test_parameters_that_cannot_be_written_are_a_user_error(
    short: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--bind", "127.0.0.1:0", "--write-params", str(tmp_path / "none" / "rover.parm")]
    assert main(["hil", "ardupilot", short, *arguments, "--out", str(tmp_path / "out")]) == 2
    assert "--write-params" in capsys.readouterr().err


class Program:
    """The command in a process of its own; the test plays the autopilot."""

    def __init__(self, short: str, tmp_path: Path) -> None:
        self.out, self.parameters, self._said = tmp_path / "out", tmp_path / "rover.parm", tmp_path / "said"
        self.physics, self.mavlink = ("127.0.0.1", free_port()), free_port()
        arguments = ["hil", "ardupilot", short, "--seed", "3", "--out", str(self.out)]
        arguments += ["--bind", f"127.0.0.1:{self.physics[1]}", "--autopilot", f"udpin:127.0.0.1:{self.mavlink}"]
        arguments += ["--write-params", str(self.parameters), "--wait", "30"]
        code = "from rover_sim.cli import main; raise SystemExit(main())"
        with self._said.open("w") as said:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code, *arguments], stdout=subprocess.DEVNULL, stderr=said
            )

    @property
    def said(self) -> str:
        return self._said.read_text(encoding="utf-8")

    def autopilot(self) -> UdpVehicle:
        """Started as the program says."""
        deadline = time.monotonic() + 60.0
        while not (told := re.search(r"--home (\S+),(\S+),(\S+),(\S+)", self.said)):
            assert time.monotonic() < deadline, self.said
            with suppress(subprocess.TimeoutExpired):
                pytest.fail(f"it ended with {self.process.wait(0.1)}: {self.said}")
        latitude, longitude, altitude, heading = (float(part) for part in told.groups())
        assert heading == 60.0
        url = f"udpout:127.0.0.1:{self.mavlink}"
        return UdpVehicle(self.physics, url, Origin(latitude, longitude, altitude), read_parameters(self.parameters))


@pytest.mark.timeout(300)
def test_a_drive_over_udp_with_an_autopilot_that_begins_anew(
    short: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time line of getting ready is shortened to 6.5 s; the whole one is in the test of the mission."""
    for name, at_s in {"ACCELS_S": 1.0, "ARMABLE_S": 2.5, "GPS_USED_S": 6.0, "AUTO_S": 6.5}.items():
        monkeypatch.setattr(mavlink_double, name, at_s)
    program = Program(short, tmp_path)
    try:
        with program.autopilot() as first:
            while first.vehicle.json.count < 300:
                first.serve(0.1)
        with program.autopilot() as second:
            while program.process.poll() is None:
                second.serve(0.1)
    finally:
        program.process.kill()
        code = program.process.wait()
    assert code == 0, program.said
    assert "the autopilot began anew" in program.said
    assert "dropped datagrams, second autopilot" in program.said  # until the first one had been silent long enough
    assert second.vehicle.json.clock_s < 60.0
    assert {path.name for path in program.out.iterdir()} == set(FILES)
    summary = json.loads((program.out / "summary.json").read_text(encoding="utf-8"))
    assert (summary["success"], summary["reason"]) == (True, "goal")
    assert summary["sim_time_s"] == pytest.approx(second.vehicle.json.clock_s, abs=0.1)
    sent = read_waypoints(program.out / "mission.waypoints")
    assert len(sent) > 1
    assert [item.x for item in read_plan(program.out / "mission.plan")] == [item.x for item in sent]
