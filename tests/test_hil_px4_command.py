"""``rover-sim hil px4`` as a user runs it: files, exit codes, one line for what is wrong."""

from __future__ import annotations

import json
import re
import socket
from pathlib import Path

import pytest

from rover_sim import run_folder
from rover_sim.cli import main
from rover_sim.driven_rover import home
from rover_sim.hil.handling import measure_handling
from rover_sim.hil.px4_parameters import Parameters, parameter_text, parameters
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.transport import open_link
from rover_sim.sim.rover import load_rover
from tests.px4_board import BoardOnPty, Px4Board
from tests.px4_board_vehicle import DrivingBoard
from tests.px4_double import Px4Process
from tests.px4_vehicle import JoinedPx4
from worlds.build import build_world
from worlds.scenario import Origin, load_scenario

TINY = """
name = "tiny"
[terrain]
kind = "flat"
size_m = [10.0, 8.0]
resolution_m = 0.1
[rocks]
cfa = 0.0
[soil]
preset = "firm"
[camera]
rate_hz = 1.0
[goal]
position_m = [2.0, 0.0]
time_limit_s = 60.0
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY, encoding="utf-8")
    return path


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def fitted(scenario_file: Path, *, board: bool) -> tuple[Origin, Parameters]:
    """Where the rover starts, and what the command writes for it."""
    scenario, rover = load_scenario(str(scenario_file)), load_rover("husky")
    world = build_world(scenario, 0)
    place = LocalFrame(world.origin).to_geo(home(world))
    handling = measure_handling(rover, world.soil, scenario.gravity_m_s2)
    values = parameters(rover, handling, scenario.goal.radius_m, board=board)
    return Origin(place.latitude_deg, place.longitude_deg, place.altitude_m), values


def test_a_whole_traverse_over_real_sockets(tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, file = tmp_path / "out", tmp_path / "rover.params"
    origin, values = fitted(tiny, board=False)
    hil, missions = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_DGRAM)
    link = open_link(f"udpout:127.0.0.1:{missions}")
    vehicle = JoinedPx4(link, origin, values, head_start_s=10.0)
    words = ["hil", "px4", str(tiny), "--bind", f"127.0.0.1:{hil}", "--autopilot", f"udpin:127.0.0.1:{missions}"]
    words += ["--out", str(out), "--write-params", str(file), "--speed", "20"]
    with Px4Process(hil, vehicle.px4, within_s=100.0):
        assert main(words) == 0
    link.close()
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["reason"], summary["hil"]["autopilot"]) == ("goal", "px4")
    assert summary["hil"]["lockstep"]["most_steps"] <= 1
    assert summary["hil"]["beat"]["rate_hz"] > 0.0
    assert {path.name for path in out.iterdir()} >= set(run_folder.FILES) - {"ruts.npz"}
    assert file.read_text() == parameter_text(values, "PX4 for husky on firm, 3.71 m/s2")
    said = capsys.readouterr().err
    assert "PX4 is expected at 127.0.0.1" in said
    assert re.search(r"steps a second, .* ms apart .* answers late, by [01] steps at most", said)


@pytest.mark.slow
def test_a_whole_traverse_over_one_serial_line(tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    origin, values = fitted(tiny, board=True)
    board, out, file = DrivingBoard(origin, values), tmp_path / "out", tmp_path / "board.params"
    with BoardOnPty(board, within_s=100.0) as pty:
        words = ["hil", "px4", str(tiny), "--bind", pty.device, "--out", str(out), "--write-params", str(file)]
        assert main(words) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["reason"], summary["hil"]["lockstep"]) == ("goal", None)
    assert summary["hil"]["beat"]["longest_ms"] > 0.0
    assert "SYS_HITL" in file.read_text()
    assert "ms apart in the median" in capsys.readouterr().err


def test_a_board_that_is_not_in_hil_mode_ends_with_3(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with BoardOnPty(Px4Board(in_hil=False)) as pty:
        words = ["hil", "px4", str(tiny), "--bind", f"{pty.device},921600", "--wait", "1"]
        assert main([*words, "--out", str(tmp_path / "out")]) == 3
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "waited 1 s for HIL mode of the PX4 at /dev/" in last


def test_without_px4_it_ends_with_3_and_says_what_it_waited_for(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hil, missions = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_DGRAM)
    words = ["hil", "px4", str(tiny), "--bind", f"127.0.0.1:{hil}", "--autopilot", f"udpin:127.0.0.1:{missions}"]
    assert main([*words, "--out", str(tmp_path / "out"), "--wait", "0.2"]) == 3
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last == f"rover-sim hil: waited 0.2 s for PX4 at 127.0.0.1:{hil}"


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (["--bind", "4560"], 2, "--bind '4560': allowed: HOST:PORT, such as 127.0.0.1:4560"),
        (["--bind", "/dev/ttyACM0,9600"], 2, "allowed: 230400 or more"),
        (["--bind", "/dev/no-such-board"], 3, "cannot open /dev/no-such-board"),
        (["--connect", "udpout:127.0.0.1:14550"], 2, "--connect: for a board's line only"),
        (["--bind", "/dev/ttyACM0", "--speed", "2"], 2, "--speed 2: a board has a clock of its own"),
        (["--autopilot", "nonsense"], 2, "unknown kind 'nonsense'"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(
    words: list[str], code: int, text: str, tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["hil", "px4", str(tiny), "--out", str(tmp_path / "out"), *words]) == code
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith("rover-sim hil: ")
    assert text in last


def test_a_port_in_use_ends_with_3(tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        bind = f"127.0.0.1:{other.getsockname()[1]}"
        assert main(["hil", "px4", str(tiny), "--bind", bind, "--out", str(tmp_path / "out")]) == 3
    assert "is in use" in capsys.readouterr().err.splitlines()[-1]


def test_parameters_are_those_of_the_rover() -> None:
    """Handling as measured goes in; whole numbers stay whole, as PX4 tells them apart by type."""
    rover = load_rover("husky")
    world = build_world(load_scenario("rock-field"), 0)
    handling = measure_handling(rover, world.soil, 3.71)
    program = parameters(rover, handling, 0.5, board=False)
    assert (program["PWM_MAIN_FUNC1"], program["PWM_MAIN_FUNC2"], program["CA_AIRFRAME"]) == (101, 102, 6)
    assert program["RO_MAX_THR_SPEED"] == pytest.approx(handling.full_m_s)
    assert program["RD_WHEEL_TRACK"] * handling.turn_rate_rad_s == pytest.approx(2.0 * handling.full_m_s)
    board = parameters(rover, handling, 0.5, board=True)
    assert (board["SYS_HITL"], board["HIL_ACT_FUNC1"], board["HIL_ACT_DIS1"]) == (1, 101, 500)
    lines = parameter_text(board, "about").splitlines()
    assert lines[0] == "# about"
    assert "1\t1\tSYS_HITL\t1\t6" in lines
    assert all(len(line.split("\t")) == 5 for line in lines if not line.startswith("#"))
